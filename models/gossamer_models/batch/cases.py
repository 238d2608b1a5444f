"""What many cases are given and what they give: tables of numbers, one row per case.

A *table* here holds the columns that a run works with: the parameters and inputs in the model's order, then the recorded
results and, last, the step limit where it is a result.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix
from ..errors import InputError, StateError
from ..variables import Variable, finite_limits, meant

Cube: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchState:
    """All that the cases of a batch remember.

    Attributes
    ----------
    x : ndarray, shape (cases, n_states)
        States; not a number where a case has failed.
    values : ndarray, shape (cases, number of parameters, inputs, recorded results and, where it is a result, step limit)
        Values in this order.
    model : str
        Digest of the model, and the recorded results.
    """

    x: Matrix
    values: Matrix
    model: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRun:
    """What ``Batch.run`` gives.

    Attributes
    ----------
    results : ndarray, shape (cases, number of results, steps // every)
        Recorded results; not a number from the step on in which a case fails.
    initial : ndarray, shape (cases, number of results)
        Recorded results before the first step.
    state : BatchState
        Where another run can go on.
    """

    results: Cube
    initial: Matrix
    state: BatchState

    @property
    def failed(self) -> Flags:
        """Cases whose state or results are not finite from some step on, or that need too many internal steps."""
        return np.asarray(np.isnan(self.state.x).any(axis=1) | np.isnan(self.state.values).any(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseTable:
    """Variables that the cases of a model are given, in the model's order.

    Attributes
    ----------
    model : str
        Name of the model, for messages.
    parameters, inputs : tuple of Variable
        Its parameters and inputs.
    """

    model: str
    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    _places: dict[str, list[int]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        for i, variable in enumerate(self.variables):
            self._places[variable.name] = [i]
        for i, variable in enumerate(self.variables):
            array, bracket, _ = variable.name.partition("[")
            if bracket:
                self._places.setdefault(array, []).append(i)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Parameters, then inputs."""
        return self.parameters + self.inputs

    def places(self, name: str) -> list[int]:
        """Return where a variable, or the elements of an array, stand; raise ``InputError`` if there is none."""
        if name in self._places:
            return self._places[name]
        msg = f"model {self.model!r} has no parameter or input {name!r}. {meant(name, self._places)}"
        raise InputError(msg)

    def start(self, given: Mapping[str, ArrayLike], cases: int, before: Matrix | None) -> Matrix:
        """Return the values of all cases at the beginning, shape (cases, number of variables).

        Parameters
        ----------
        given : mapping of str to array_like
            Scalars, or one value per case, shape (cases,); of arrays one row, shape (size,), or shape (cases, size).
        cases : int
            Number of cases.
        before : ndarray, shape (cases, number of variables), or None
            Values of a saved state, whose parameters stay as they are; None for the start values of the model.

        Raises
        ------
        ParameterError, InputError
            A value is not finite, is out of range, or has another shape.
        StateError
            A parameter is given beside a saved state.
        """
        default = [v.start or 0.0 for v in self.variables]
        values = np.tile(default, (cases, 1)) if before is None else before.copy()
        for name, value in given.items():
            places = self.places(name)
            if before is not None and places[0] < len(self.parameters):
                msg = f"parameter {name!r} is fixed once model {self.model!r} runs. Run it without a saved state."
                raise StateError(msg)
            array = _numbers(name, value)
            one = name == self.variables[places[0]].name
            shape = (cases,) if one else (cases, len(places))
            fits = array.ndim <= len(shape) and all(
                a in (1, b) for a, b in zip(array.shape[::-1], shape[::-1], strict=False)
            )
            if not fits:
                msg = f"{name!r} of model {self.model!r} has shape {array.shape}; it must fit {shape}, one row per case"
                raise InputError(msg)
            values[:, places] = np.broadcast_to(array, shape).reshape(cases, -1)
        low, high = finite_limits(self.variables)
        wrong = np.argwhere(~((values >= low) & (values <= high)).T)
        if wrong.size:
            i, case = wrong[0]
            self._refuse(self.variables[i], values[case, i], f"case {case}")
        return values

    def records(self, given: Mapping[str, ArrayLike], names: Sequence[str], steps: int, cases: int) -> list[Matrix]:
        """Return the values of inputs that vary in time, shape (1, steps) or (cases, steps), in the order of names.

        Raises
        ------
        InputError
            An input is missing, is given in excess, has another shape, is not finite or is out of range.
        """
        if set(given) != set(names):
            msg = f"model {self.model!r} runs with records of {list(names)}, but was given {list(given)}"
            raise InputError(msg)
        return [self._record(name, given[name], steps, cases) for name in names]

    def _record(self, name: str, given: ArrayLike, steps: int, cases: int) -> Matrix:
        array = np.ascontiguousarray(np.atleast_2d(_numbers(name, given)))
        if array.shape not in {(1, steps), (cases, steps)}:
            fit = f"{(steps,)} or {(cases, steps)}"
            msg = f"input {name!r} of model {self.model!r} has shape {np.shape(given)}; it must be {fit}, case by case"
            raise InputError(msg)
        variable = self.variables[self.places(name)[0]]
        low, high = finite_limits([variable])
        wrong = np.argwhere(~((array >= low) & (array <= high)))
        if wrong.size:
            case, step = wrong[0]
            who = f"all cases, step {step}" if array.shape[0] == 1 and cases > 1 else f"case {case}, step {step}"
            self._refuse(variable, array[case, step], who)
        return array

    def _refuse(self, variable: Variable, value: float, who: str) -> None:
        variable.refuse(value, self.model, f" in {who} (the first is 0)", "run")


def count_cases(
    table: CaseTable, start: Mapping[str, ArrayLike], inputs: Mapping[str, ArrayLike], before: int | None
) -> int:
    """Return how many cases are given: all that are not given for every case alike agree on it.

    Raises
    ------
    InputError
        They do not agree.
    """
    counts = {} if before is None else {"the saved state": before}
    for name, value in start.items():
        shape = np.shape(value)
        if len(shape) == (1 if name == table.variables[table.places(name)[0]].name else 2):
            counts[name] = shape[0]
    counts |= {name: np.shape(value)[0] for name, value in inputs.items() if np.ndim(value) == 2}
    different = {count for count in counts.values() if count != 1 or len(counts) == 1}
    if len(different) > 1 or 0 in different:
        msg = f"model {table.model!r} needs the same number of cases, at least 1, everywhere; it was given {counts}"
        raise InputError(msg)
    return different.pop() if different else 1


def _numbers(name: str, value: ArrayLike) -> Cube:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        msg = f"{name!r} needs numbers, not {value!r}"
        raise InputError(msg) from None
