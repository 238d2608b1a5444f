"""Physics and learning of the Gossamer monitoring chain; knows no FMI."""

from .errors import (
    ArtifactError,
    ConvergenceError,
    DataError,
    GossamerError,
    InputError,
    ParameterError,
    StateError,
)
from .step_model import StepModel, Variable
from .stepper import Stepper

__all__ = [
    "ArtifactError",
    "ConvergenceError",
    "DataError",
    "GossamerError",
    "InputError",
    "ParameterError",
    "StateError",
    "StepModel",
    "Stepper",
    "Variable",
]
