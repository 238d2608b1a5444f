"""A membrane of any shape, from a mesh and a setup; the square of the thesis is the setup that ships."""

from .assembly import MembraneEquations
from .built import Surveyed, as_built, surveyed, with_shape
from .effectors import SpringMasses, flex_file, node_file, spring_masses
from .law import LAWS
from .lines import Beam, Cable, PointMass, taken
from .model import first_period, membrane_model
from .portable import read_structure
from .reading import MeshFile, read_mesh
from .reduction import Reach, Reduced, reaches, reduce_membrane, reduced_model
from .setup import Built, Edge, Fault, Gas, Load, Paraboloid, Region, Sensor, Setup, Support
from .square import MembraneParams, square_structure
from .statics import Equilibria, Equilibrium, EquilibriumDerivatives
from .structure import Structure, make_structure
from .surface import SurfaceMesh, surface_mesh
from .vibration import Linearised, Modes, Sensitivities
from .zones import Zone

__all__ = [
    # the model and its equations
    "membrane_model",
    "MembraneEquations",
    "first_period",
    "Equilibria",
    "Equilibrium",
    "EquilibriumDerivatives",
    "Linearised",
    "Modes",
    "Sensitivities",
    "Reach",
    "Reduced",
    "reaches",
    "reduce_membrane",
    "reduced_model",
    "flex_file",
    "node_file",
    "spring_masses",
    "SpringMasses",
    # what it is made of
    "Beam",
    "Built",
    "Cable",
    "Edge",
    "Fault",
    "Gas",
    "LAWS",
    "Load",
    "Paraboloid",
    "PointMass",
    "Region",
    "Sensor",
    "Setup",
    "Support",
    "Zone",
    # where it is
    "as_built",
    "surveyed",
    "Surveyed",
    "with_shape",
    "make_structure",
    "MeshFile",
    "read_mesh",
    "read_structure",
    "Structure",
    "SurfaceMesh",
    "surface_mesh",
    "taken",
    # the square of the thesis
    "MembraneParams",
    "square_structure",
]
