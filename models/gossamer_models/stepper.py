"""Run a ``StepModel``: set inputs, step, read results; and run one over records of its inputs.

Symbols: ``x`` state, ``values`` all variables in table order (parameters, inputs, outputs, locals), ``h`` step [s].
CasADi's virtual machine evaluates the model in buffers that are prepared once, so memory does not grow with the number of
steps. A method that raises leaves the state as it was.
"""

import logging
import math
import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ConvergenceError, InputError, StateError, require
from .step_model import StepModel
from .variables import Variable, finite_limits, meant

logger = logging.getLogger(__name__)

MAX_INTERNAL_STEPS = 100_000
_STATE_MAGIC = b"GOSSAMER"


class Stepper:
    """One running instance of a model.

    Parameters
    ----------
    model : StepModel
        What to run.
    **start : float
        Start values of parameters and inputs that differ from the table's. Names that are no Python identifiers go
        through ``set``.

    Attributes
    ----------
    model : StepModel
        The model.
    initialized : bool
        Whether ``initialize`` has been called.
    values : ndarray, shape (number of variables,)
        Current values in table order: a read-only view that every call updates in place.
    x : ndarray, shape (n_states,)
        Current state: another such view.
    warn : callable
        Receives a sentence when a result first leaves its range, once per result until ``reset``; by default the log.

    Examples
    --------
    >>> from gossamer_models.sensor import sensor_model
    >>> sensor = Stepper(sensor_model(), rest_strain=0.02)
    >>> sensor.initialize()
    >>> sensor.set("strain", 0.05)
    >>> sensor.step(3e-4)
    >>> resistance = sensor.get("resistance")
    """

    def __init__(self, model: StepModel, **start: float) -> None:
        self.model = model
        self._index = {name: i for i, name in enumerate(model.names)}
        self._p, self._u, self._y = model.slices()
        self._limit = None if model.step_limit is None else self._index[model.step_limit]
        self._lower, self._upper = finite_limits(model.variables)
        n_x = model.n_states
        self._values = np.zeros(len(model.variables))
        self._x = np.zeros(n_x)
        self._x_work = np.zeros(n_x)
        self._next = np.zeros(n_x + self._values[self._y].size)
        self._x_next, self._y_next = self._next[:n_x], self._next[n_x:]
        self._h = np.zeros(1)
        self.warn: Callable[[str], None] = logger.warning
        self.values, self.x = _read_only(self._values), _read_only(self._x)
        u, p = self._values[self._u], self._values[self._p]
        self._run_init = bind(model.init, (u, p), (self._x_next, self._y_next))
        self._run_step = bind(model.step, (self._x_work, u, p, self._h), (self._x_next, self._y_next))
        self.reset()
        for name, value in start.items():
            self.set(name, value)

    def reset(self) -> None:
        """Return to the state right after construction: start values, not initialized."""
        self._values[:] = [v.start or 0.0 for v in self.model.variables]
        self._x[:] = 0.0
        self.initialized = False
        self._checked = False
        self._valid = self._lower[self._y].copy(), self._upper[self._y].copy()

    def index(self, name: str) -> int:
        """Return the place of a variable in the table; raise ``InputError`` with a suggestion if there is none."""
        try:
            return self._index[name]
        except KeyError:
            msg = f"model {self.model.name!r} has no variable {name!r}. {meant(name, self.model.names)}"
            raise InputError(msg) from None

    def set(self, name: str, value: float) -> None:
        """Set one parameter (before ``initialize``) or input by name."""
        self.set_values([self.index(name)], [value])

    def set_values(self, indices: Iterable[int], values: Iterable[float]) -> None:
        """Set parameters or inputs by table index.

        A value that is not finite or out of range is stored; the ``initialize`` or ``step`` that would use it raises, so
        the caller can still correct it.

        Raises
        ------
        InputError
            An index is unknown or that of a result, or a value is not a number; nothing is set.
        StateError
            A parameter is set after initialization; nothing is set.
        """
        pairs = []
        try:
            given = list(zip(indices, values, strict=True))
        except (TypeError, ValueError):
            msg = f"model {self.model.name!r} needs one value per table index"
            raise InputError(msg) from None
        settable = range(self._u.start if self.initialized else 0, self._u.stop)
        for index, value in given:
            if type(index) is int and index in settable and type(value) is float:
                pairs.append((index, value))
            else:
                pairs.append((index, self._convert(index, value)))
        for index, number in pairs:
            self._values[index] = number
        self._checked = False

    def get(self, name: str) -> float:
        """Read one variable by name."""
        return float(self._values[self.index(name)])

    def get_values(self, indices: Iterable[int]) -> list[float]:
        """Read variables by table index."""
        return [float(self._values[i]) for i in indices if self._variable(i)]

    def initialize(self) -> None:
        """Compute the initial state and results from parameters and inputs.

        Raises
        ------
        StateError
            Already initialized.
        ParameterError, InputError
            A parameter or an input is not finite or out of range.
        ConvergenceError
            The initial state is not finite.
        """
        require(not self.initialized, f"model {self.model.name!r} is initialized already. Reset it first.", StateError)
        self._check(self._p)
        self._check(self._u)
        self._run_init()
        self._require_finite("initialization")
        self._x[:] = self._x_next
        self._values[self._y] = self._y_next
        self.initialized = True
        self._warn_of_results()

    def step(self, h: float) -> None:
        """Advance by ``h`` seconds with the inputs as set; a step beyond the model's own limit is divided.

        Raises
        ------
        StateError
            Not initialized.
        InputError
            ``h`` is not a positive finite number or needs too many internal steps, or an input is not finite or out of
            range.
        ConvergenceError
            The new state is not finite.
        """
        if not self.initialized:
            msg = f"model {self.model.name!r} must be initialized before it can step"
            raise StateError(msg)
        if not (isinstance(h, int | float | np.floating) and math.isfinite(h) and h > 0.0):
            msg = f"the step of model {self.model.name!r} must be a positive time [s], not {h!r}"
            raise InputError(msg)
        if not self._checked:
            self._check(self._u)
            self._checked = True
        limit = math.inf if self._limit is None else float(self._values[self._limit])
        self._x_work[:] = self._x
        self._x_work[self._x.size - self.model.restarted :] = 0.0
        remaining = self._divide(h, limit)
        part = h / remaining
        while True:
            self._h[0] = part
            self._run_step()
            self._require_finite("a step")
            self._x_work[:] = self._x_next
            remaining -= 1
            if remaining == 0:
                break
            if self._limit is not None and self._limit >= self._y.start:
                limit = float(self._y_next[self._limit - self._y.start])
                if part > limit:
                    rest = part * remaining
                    remaining = self._divide(rest, limit)
                    part = rest / remaining
        self._x[:] = self._x_next
        self._values[self._y] = self._y_next
        self._warn_of_results()

    @property
    def state(self) -> bytes:
        """Everything the instance remembers, as bytes; assign it to go back, in this or another instance."""
        body = bytes([self.initialized]) + self._values.tobytes() + self._x.tobytes()
        head = _STATE_MAGIC + bytes.fromhex(self.model.digest)[:16]
        return head + struct.pack("<I", zlib.crc32(body)) + body

    @state.setter
    def state(self, content: bytes) -> None:
        head = _STATE_MAGIC + bytes.fromhex(self.model.digest)[:16]
        size = len(head) + 4 + 1 + 8 * (self._values.size + self._x.size)
        if not isinstance(content, bytes) or len(content) != size or not content.startswith(head):
            msg = f"this is no saved state of model {self.model.name!r}, which is {size} bytes and begins with its digest"
            raise StateError(msg)
        body = content[len(head) + 4 :]
        if struct.pack("<I", zlib.crc32(body)) != content[len(head) : len(head) + 4]:
            msg = f"this saved state of model {self.model.name!r} is damaged: its checksum does not fit"
            raise StateError(msg)
        numbers = np.frombuffer(body, dtype=np.float64, offset=1)
        self.resume(numbers[: self._values.size], numbers[self._values.size :])
        self.initialized = bool(body[0])

    def resume(self, values: NDArray[np.float64], x: NDArray[np.float64]) -> None:
        """Go on from values in table order and a state, as if it had stepped there."""
        self._values[:], self._x[:] = values, x
        self.initialized, self._checked = True, False

    def _convert(self, index: int, value: float) -> float:
        """Return a value to set as a float; raise if it is none or the variable cannot be set now."""
        variable = self._variable(index)
        if variable.causality in ("output", "local"):
            msg = f"{variable.name!r} is a result of model {self.model.name!r} and cannot be set"
            raise InputError(msg)
        if self.initialized and variable.causality == "parameter":
            msg = f"parameter {variable.name!r} is fixed once model {self.model.name!r} runs. Reset it, then set it."
            raise StateError(msg)
        try:
            return float(value)
        except (TypeError, ValueError, OverflowError):
            msg = f"{variable.name!r} needs a number [{variable.unit}], not {value!r}"
            raise InputError(msg) from None

    def _variable(self, index: int) -> Variable:
        if not (isinstance(index, int | np.integer) and 0 <= index < len(self.model.variables)):
            msg = f"model {self.model.name!r} has no variable number {index}; it has 0 to {len(self.model.variables) - 1}"
            raise InputError(msg)
        return self.model.variables[index]

    def _divide(self, h: float, limit: float) -> int:
        """Count the equal internal steps, none longer than ``limit`` [s], that make up ``h`` [s]."""
        ratio = h / limit * (1.0 - 1e-12)
        if ratio > MAX_INTERNAL_STEPS:
            msg = (
                f"a step of {h:g} s needs {ratio:.3g} internal steps of {limit:.3e} s of model {self.model.name!r}, "
                f"more than {MAX_INTERNAL_STEPS}. Use shorter communication steps."
            )
            raise InputError(msg)
        return max(math.ceil(ratio), 1)

    def _check(self, part: slice) -> None:
        """Raise if a given value of this part of the table is not finite or out of its range."""
        given = self._values[part]
        within = (given >= self._lower[part]) & (given <= self._upper[part])
        if within.all():
            return
        wrong = int(np.argmin(within))
        self.model.variables[part][wrong].refuse(given[wrong], self.model.name)

    def _warn_of_results(self) -> None:
        """Warn of every result that is out of its range for the first time."""
        lower, upper = self._valid
        within = (self._y_next >= lower) & (self._y_next <= upper)
        if within.all():
            return
        for i in np.flatnonzero(~within):
            lower[i], upper[i] = -math.inf, math.inf
            variable = self.model.variables[self._y.start + i]
            low, high = variable.limits
            self.warn(
                f"{variable.name!r} of model {self.model.name!r} is {self._y_next[i]:g}{variable.after}; "
                f"the model is valid from {low:g} to {high:g}.{variable.advice and ' '}{variable.advice} "
                "The run goes on; this is logged once."
            )

    def _require_finite(self, what: str) -> None:
        if not np.isfinite(self._next).all():
            left = math.nan if self.model.residual is None else self._x_next[self.model.residual]
            stopped = f" It stopped where forces are {left:.3g} times those that are accepted." if left > 1.0 else ""
            msg = f"{what} of model {self.model.name!r} gave a result that is not finite.{stopped} {self.model.advice}"
            raise ConvergenceError(msg)


def simulate(
    stepper: Stepper, steps: ArrayLike, inputs: Mapping[str, ArrayLike], results: Sequence[str]
) -> dict[str, NDArray[np.float64]]:
    """Advance an initialized model step by step.

    Parameters
    ----------
    stepper : Stepper
        Instance to advance; afterwards it is at the end of the last step.
    steps : array_like, shape (n,)
        Length of every step [s].
    inputs : mapping of str to array_like, shape (n,)
        Inputs at the end of every step by name; others stay as they are.
    results : sequence of str
        Variables to record.

    Returns
    -------
    dict of ndarray, shape (n,)
        The variables after every step, by name.

    Raises
    ------
    GossamerError
        What ``Stepper.set_values`` and ``Stepper.step`` raise.
    """
    lengths = np.asarray(steps, dtype=float).tolist()
    places = [stepper.index(name) for name in inputs]
    recorded = [stepper.index(name) for name in results]
    rows = np.column_stack([np.asarray(column, dtype=float) for column in inputs.values()]) if inputs else None
    table = np.empty((len(lengths), len(recorded)))
    for k, h in enumerate(lengths):
        if rows is not None:
            stepper.set_values(places, rows[k].tolist())
        stepper.step(h)
        table[k] = stepper.get_values(recorded)
    return dict(zip(results, table.T.copy(), strict=True))


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    view = array.view()
    view.flags.writeable = False
    return view


def bind(
    function: ca.Function, arguments: Iterable[NDArray[np.float64]], results: Iterable[NDArray[np.float64]]
) -> ca.FunctionBuffer:
    """Bind arrays to a CasADi function; the returned object evaluates it when called."""
    buffer, run = function.buffer()
    for i, array in enumerate(arguments):
        buffer.set_arg(i, array.data)
    for i, array in enumerate(results):
        buffer.set_res(i, array.data)
    run.keep_alive = buffer
    return run


class Evaluator:
    """A CasADi function of dense vectors that is called without making CasADi's matrices.

    Not to be shared by threads; it can be pickled.

    Parameters
    ----------
    function : casadi.Function
        Its arguments and results are vectors or numbers.
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        self._arguments = [np.empty(function.numel_in(i)) for i in range(function.n_in())]
        self._results = [np.empty(function.numel_out(i)) for i in range(function.n_out())]
        self._run = bind(function, self._arguments, self._results)

    def __call__(self, *arguments: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return the results, each a vector of its own."""
        for own, given in zip(self._arguments, arguments, strict=True):
            own[:] = given
        self._run()
        return [result.copy() for result in self._results]

    def __reduce__(self) -> tuple[type, tuple[ca.Function]]:
        return Evaluator, (self._function,)
