"""Physics and learning of the Gossamer monitoring chain; knows no FMI.

``docs/nomenclature.md`` lists every symbol, its unit and its file, and where each equation of the thesis is implemented.
"""

from .errors import ArtifactError, ConvergenceError, DataError, GossamerError, InputError, ParameterError, StateError
from .step_model import StepModel
from .stepper import Stepper, simulate
from .variables import Variable

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
    "simulate",
]
