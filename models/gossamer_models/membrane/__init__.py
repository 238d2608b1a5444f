"""Prestressed square membrane: explicit production step, and statics, implicit steps and frequencies to verify it."""

from .equations import MembraneEquations
from .implicit import MembraneHistory, integrate_implicit
from .mesh import SquareMesh, square_mesh
from .modal import natural_frequencies
from .model import membrane_model
from .params import MembraneParams
from .statics import static_deflection
from .strain import (
    SENSOR_POINTS,
    deformation_gradients,
    green_lagrange_strain,
    logarithmic_strain,
    nominal_strain,
)

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
    "natural_frequencies",
    # strain measures
    "SENSOR_POINTS",
    "deformation_gradients",
    "nominal_strain",
    "green_lagrange_strain",
    "logarithmic_strain",
]
