"""A membrane of any shape, from a mesh file and a setup."""

from .mesh import SurfaceMesh, surface_mesh
from .model import mesh_membrane_model
from .reading import MeshFile, read_mesh
from .setup import Edge, Gas, Load, Region, Sensor, Setup, Support, Zone
from .structure import Structure, make_structure

__all__ = [
    # what it is made of
    "Edge",
    "Gas",
    "Load",
    "Region",
    "Sensor",
    "Setup",
    "Support",
    "Zone",
    # where it is
    "MeshFile",
    "read_mesh",
    "SurfaceMesh",
    "surface_mesh",
    # run it
    "make_structure",
    "mesh_membrane_model",
    "Structure",
]
