"""What can go wrong in a model.

One root, ``GossamerError``; every leaf is also the built-in it resembles. A message names the number or the name at
fault and ends in what to do next.
"""

from gossamer_files.errors import DataError, GossamerError, NotFiniteError

__all__ = [
    "ArtifactError",
    "CompilerError",
    "ConvergenceError",
    "DataError",
    "GossamerError",
    "InputError",
    "NotFiniteError",
    "ParameterError",
    "StateError",
    "require",
]


class ParameterError(GossamerError, ValueError):
    """A parameter, start value or option outside its meaning."""


class InputError(GossamerError, ValueError):
    """A value or step handed to a running model that it cannot take; the model's state is as before."""


class StateError(GossamerError, RuntimeError):
    """A call that does not fit the state the model is in, or a saved state that does not fit the model."""


class ConvergenceError(GossamerError, ArithmeticError):
    """An iteration or a step without a usable (finite, converged) result; the model's state is as before."""


class ArtifactError(GossamerError, ValueError):
    """A stored artifact that is truncated, of another kind, or of a version this program does not know."""


class CompilerError(GossamerError, RuntimeError):
    """The C compiler failed, for instance on a full disk."""


def require(condition: object, message: str, error: type[GossamerError] = ParameterError) -> None:
    """Raise an error unless a condition holds."""
    if not condition:
        raise error(message)
