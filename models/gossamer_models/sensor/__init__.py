"""Sensor: strain to resistance with hysteresis, drift and relaxation."""

from .artifact import DirectInverse, RelaxationTerm, Scales, SensorArtifact, default_artifact
from .exponentials import exponential_sum
from .model import sensor_model

__all__ = [
    "DirectInverse",
    "RelaxationTerm",
    "Scales",
    "SensorArtifact",
    "default_artifact",
    "exponential_sum",
    "sensor_model",
]
