"""A membrane of any shape, from a mesh and a setup; the square of the thesis is the setup that ships."""

from .assembly import MembraneEquations
from .implicit import MembraneHistory, integrate_implicit
from .mesh import SquareMesh, square_mesh
from .mesh_model import mesh_membrane_model
from .model import membrane_model
from .params import MembraneParams
from .reading import MeshFile, read_mesh
from .setup import Edge, Gas, Load, Region, Sensor, Setup, Support, Zone
from .square import square_structure
from .statics import static_deflection
from .strain import SENSOR_POINTS
from .structure import Structure, make_structure
from .surface import SurfaceMesh, surface_mesh

__all__ = [
    # the production model
    "membrane_model",
    "mesh_membrane_model",
    "square_structure",
    # what it is made of
    "Edge",
    "Gas",
    "Load",
    "MembraneParams",
    "Region",
    "Sensor",
    "Setup",
    "Support",
    "Zone",
    # where it is
    "make_structure",
    "MeshFile",
    "read_mesh",
    "Structure",
    "SurfaceMesh",
    "surface_mesh",
    # the square's equations, and other ways to solve them
    "MembraneEquations",
    "SquareMesh",
    "square_mesh",
    "integrate_implicit",
    "MembraneHistory",
    "static_deflection",
    # where strain is measured
    "SENSOR_POINTS",
]
