"""Fractional models of the sensor: memory that fades as a power of time."""

from .artifact import SCHEMA, FadingTerm, FractionalArtifact, FractionalTerm
from .identify import FractionalFit, identify_fractional
from .kernels import ModeGrid
from .model import fractional_sensor_model, predict
from .operators import derivative, integral
from .parameters import Parameter
from .records import Misfit, UniformRecord, misfit
from .settings import FractionalSettings

__all__ = [
    "SCHEMA",
    "FadingTerm",
    "FractionalArtifact",
    "FractionalFit",
    "FractionalSettings",
    "FractionalTerm",
    "Misfit",
    "ModeGrid",
    "Parameter",
    "UniformRecord",
    "derivative",
    "fractional_sensor_model",
    "identify_fractional",
    "integral",
    "misfit",
    "predict",
]
