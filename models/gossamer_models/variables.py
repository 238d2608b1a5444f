"""A model's variables as one table of rows, and its vectors by name.

A row is ``parameter``, ``input_``, ``output`` or ``local`` of name, unit, description, start value and range. Elements of an
array carry their index in the name, ``damage[1]``; inside a step the array is one column, ``u.damage``. A state is one
column too, or a dataclass whose fields are states: ``x.sensor.front``.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from difflib import get_close_matches
from functools import partial
from itertools import accumulate
from types import SimpleNamespace
from typing import Any, Literal, NoReturn, TypeVar

import casadi as ca
import numpy as np

from .errors import InputError, ParameterError

Causality = Literal["parameter", "input", "output", "local"]
Values = SimpleNamespace  # inputs or parameters inside a step
Results = Mapping[str, ca.MX]  # outputs and locals of a step
State = TypeVar("State")
CAUSALITIES: tuple[Causality, ...] = ("parameter", "input", "output", "local")


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar real variable of a model's interface.

    Attributes
    ----------
    causality : {"parameter", "input", "output", "local"}
        Parameters are fixed once the model is initialized.
    name : str
        FMI structured name, for instance ``strain[1]``.
    unit : str
        Unit symbol, ``"1"`` for a ratio.
    description : str
        One line, without the unit.
    start : float or None
        Start value; needed for parameters and inputs, not allowed elsewhere.
    minimum, maximum : float or None
        Closed range of meaningful values. Parameters and inputs outside of it are refused. A result that leaves it means
        that the model has left the range in which it is valid: a running model warns once and goes on.
    nominal : float or None
        Order of magnitude.
    discrete : bool
        True if the value changes at isolated times only.
    advice : str
        What to do where a result leaves its range, for that warning.
    optional : bool
        True for an input that a program may leave at its start value.
    """

    causality: Causality
    name: str
    unit: str
    description: str
    start: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    discrete: bool = False
    advice: str = ""
    optional: bool = False

    def __post_init__(self) -> None:
        if self.causality not in CAUSALITIES:
            msg = f"variable {self.name!r} has causality {self.causality!r}; it is one of {', '.join(CAUSALITIES)}"
            raise ParameterError(msg)
        given = self.causality in ("parameter", "input")
        if given != (self.start is not None):
            msg = f"variable {self.name!r} ({self.causality}) {'needs' if given else 'cannot have'} a start value"
            raise ParameterError(msg)

    @property
    def limits(self) -> tuple[float, float]:
        """Range, without end where there is none."""
        return -np.inf if self.minimum is None else self.minimum, np.inf if self.maximum is None else self.maximum

    @property
    def after(self) -> str:
        """The unit after a number; nothing for a ratio."""
        return "" if self.unit == "1" else f" {self.unit}"

    def refuse(self, value: float, model: str, where: str = "", again: str = "call") -> NoReturn:
        """Raise ``ParameterError`` or ``InputError`` for a value of a model that is out of range or not finite."""
        low, high = self.limits
        msg = (
            f"{self.causality} {self.name!r} of model {model!r} is {value:g}{self.after}{where}; it must be a finite number "
            f"from {low:g} to {high:g}. Correct it and {again} again."
        )
        raise (ParameterError if self.causality == "parameter" else InputError)(msg)


def finite_limits(variables: Sequence[Variable]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return smallest and largest values, shape (2, n): so that infinities are out of range, as NaN is."""
    largest = np.finfo(float).max
    return np.asarray(np.clip(np.array([v.limits for v in variables]).reshape(-1, 2).T, -largest, largest))


def meant(name: str, known: Iterable[str]) -> str:
    """Return a sentence on the name that a wrong one is close to, or on those that are known."""
    names = list(known)
    close = get_close_matches(name, names, n=1)
    return f"Did you mean {close[0]!r}?" if close else f"It has {', '.join(names[:12])}, ..."


parameter = partial(Variable, "parameter")
input_ = partial(Variable, "input")
output = partial(Variable, "output")
local = partial(Variable, "local")
positive = partial(output, unit="1", minimum=0.0, discrete=True)
fraction = partial(positive, maximum=1.0)


def array(
    kind: Callable[..., Variable],
    name: str,
    unit: str,
    description: str,
    start: float | Sequence[float] | None = None,
    limit: float | None = None,
    nominal: float | None = None,
    parts: Sequence[str] = "xyz",
) -> tuple[Variable, ...]:
    """Make the rows of an array whose elements are alike but for start values and the part that ends their descriptions.

    ``limit`` holds on both sides of zero.
    """
    starts = start if isinstance(start, Sequence) else [start] * len(parts)
    low = None if limit is None else -limit
    return tuple(
        kind(f"{name}[{k}]", unit, f"{description}, {part}", value, low, limit, nominal)
        for k, (part, value) in enumerate(zip(parts, starts, strict=True), 1)
    )


def by_name(variables: Iterable[Variable], column: ca.MX) -> Values:
    """Split a column, shape (n,), by the names of its variables; the elements of an array make one column."""
    places: dict[str, list[int]] = {}
    for i, variable in enumerate(variables):
        places.setdefault(_array(variable), []).append(i)
    return Values(**{name: column[where] for name, where in places.items()})


def in_order(variables: Iterable[Variable], values: Results) -> ca.MX:
    """Stack values by name, arrays as columns, in the order of their variables, shape (n,).

    Raises
    ------
    ParameterError
        A value is missing, is of no variable, or has another size than its array.
    """
    sizes = Counter(_array(variable) for variable in variables)
    given = Counter({name: ca.MX(value).numel() for name, value in values.items()})
    if sizes != given:
        msg = f"the table has results {dict(sizes)}, the step returns {dict(given)} (name: number of elements)"
        raise ParameterError(msg)
    return ca.vertcat(*(ca.MX(values[name]) for name in sizes))


def pack(state: Any) -> ca.MX:  # noqa: ANN401
    """Stack a state, shape (n,); a matrix column by column."""
    if is_dataclass(state):
        return ca.vertcat(*(pack(getattr(state, part.name)) for part in fields(state)))
    return ca.vec(state)


def results_of(state: Any) -> Results:  # noqa: ANN401
    """Return the fields of a state by name, as results."""
    return {part.name: getattr(state, part.name) for part in fields(state)}


def unpack(like: State, x: ca.MX) -> State:
    """Split a column, shape (n,), into a state with the fields and shapes of another one."""
    if is_dataclass(like) and not isinstance(like, type):
        parts = [getattr(like, part.name) for part in fields(like)]
        ends = accumulate((pack(part).numel() for part in parts), initial=0)
        return type(like)(*(unpack(*pair) for pair in zip(parts, ca.vertsplit(x, list(ends)), strict=True)))
    column: State = ca.reshape(x, ca.MX(like).shape)
    return column


def select(condition: ca.MX, yes: State, no: State) -> State:
    """Return the first state where the condition holds, else the second, field by field."""
    if is_dataclass(yes) and not isinstance(yes, type):
        pairs = ((getattr(yes, part.name), getattr(no, part.name)) for part in fields(yes))
        return type(yes)(*(select(condition, *pair) for pair in pairs))
    column: State = ca.if_else(condition, yes, no)
    return column


def modulo(x: ca.MX, n: float) -> ca.MX:
    """Return what a whole number is above a multiple of n, from 0 to n - 1: exact, without the loop of ``fmod``."""
    return x - n * ca.floor(x / n)


def _array(variable: Variable) -> str:
    return variable.name.partition("[")[0]
