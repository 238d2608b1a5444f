"""Sensor: strain to resistance with hysteresis, drift and relaxation."""

from .artifact import DirectInverse, Scales, SensorArtifact, TemperatureEffect, default_artifact
from .drives import EXTENSIONS, RelaxationTerm
from .model import sensor_model

__all__ = [
    "EXTENSIONS",
    "DirectInverse",
    "RelaxationTerm",
    "Scales",
    "SensorArtifact",
    "TemperatureEffect",
    "default_artifact",
    "sensor_model",
]
