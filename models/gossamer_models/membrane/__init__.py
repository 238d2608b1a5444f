"""Prestressed square membrane: explicit production step, and statics, implicit steps and frequencies to verify it."""

from .equations import MembraneEquations
from .model import membrane_model
from .params import MembraneParams
from .strain import SENSOR_POINTS, green_lagrange_strain, logarithmic_strain, nominal_strain

__all__ = [
    # the production model
    "membrane_model",
    # its equations
    "MembraneEquations",
    "MembraneParams",
    # strain measures
    "SENSOR_POINTS",
    "nominal_strain",
    "green_lagrange_strain",
    "logarithmic_strain",
]
