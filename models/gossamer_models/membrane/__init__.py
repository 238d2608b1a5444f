"""Prestressed square membrane: explicit production step, and statics and implicit steps to verify it."""

from .assembly import MembraneEquations
from .implicit import MembraneHistory, integrate_implicit
from .mesh import SquareMesh, square_mesh
from .model import membrane_model
from .params import MembraneParams
from .statics import static_deflection
from .strain import SENSOR_POINTS

__all__ = [
    # the production model
    "membrane_model",
    # its equations
    "MembraneEquations",
    "MembraneParams",
    "SquareMesh",
    "square_mesh",
    # other ways to solve them
    "integrate_implicit",
    "MembraneHistory",
    "static_deflection",
    # where strain is measured
    "SENSOR_POINTS",
]
