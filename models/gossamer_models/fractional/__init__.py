"""Fractional models of the sensor: memory that fades as a power of time."""

from .artifact import SCHEMA, FadingTerm, FractionalArtifact, FractionalTerm
from .fit import FractionalFit, fit_fractional, predict_record
from .model import fractional_sensor_model, predict
from .problem import FractionalSettings

__all__ = [
    "SCHEMA",
    "FadingTerm",
    "FractionalArtifact",
    "FractionalFit",
    "FractionalSettings",
    "FractionalTerm",
    "fit_fractional",
    "fractional_sensor_model",
    "predict",
    "predict_record",
]
