"""Advance many cases of one model at once.

Symbols: ``x`` states, ``u`` inputs, ``p`` parameters, ``y`` recorded results and step limit, one row per case; ``h`` step
[s].
"""

import hashlib
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix
from ..compiler import PACKAGE, has_compiler
from ..errors import GossamerError, InputError, ParameterError, StateError
from ..step_model import StepModel
from ..stepper import Stepper
from . import code
from .cases import BatchRun, BatchState, CaseTable, count_cases
from .kernel import Kernel, Task, library

log = logging.getLogger(__name__)


class Batch:
    """A model that runs for many cases at once.

    Eight cases stand in the lanes of one vector, and the C code of the model's own ``init`` and ``step`` works on them with
    strict arithmetic: each case has the numbers that ``Stepper`` gives it up to the round-off of CasADi's own ways of
    writing an expression, and they do not depend on the other cases, their number or the number of workers. Sums over the
    elements of a mesh are loops there. Where a model finds its start by an iteration, the batch begins with what the model's
    own finder of rest returns. The code is compiled once for each model and set of results, in seconds, and kept in the
    user's cache folder.
    Without a compiler ``Stepper`` runs the cases one after the other; the log says so.

    Parameters
    ----------
    model : StepModel
        Model.
    results : sequence of str
        Outputs and locals to record.
    inputs : sequence of str
        Inputs that vary in time.

    Raises
    ------
    InputError
        A name is not that of a result or an input, or comes twice.
    ParameterError
        The model has loops over tables, has no other form, and there is no compiler or it does not know an operation.

    Notes
    -----
    An instance can be pickled into processes on the same machine: it carries the path of the compiled library, not the
    model.

    Examples
    --------
    >>> import numpy as np
    >>> from gossamer_models.sensor import sensor_model
    >>> batch = Batch(sensor_model(), ["resistance"], ["strain"])
    >>> strain = np.outer([1.0, 5.0], np.arange(100) / 1e4)
    >>> batch.run(100, 3e-4, inputs={"strain": strain}).results.shape
    (2, 1, 100)
    """

    def __init__(self, model: StepModel, results: Sequence[str], inputs: Sequence[str] = ()) -> None:
        p, u, y = model.slices()
        _require(model, results, model.names[y], "result")
        _require(model, inputs, model.names[u], "input")
        self.results, self.inputs = tuple(results), tuple(inputs)
        self._table = CaseTable(model=model.name, parameters=model.variables[p], inputs=model.variables[u])
        self._n_x, self._recorded = model.n_states, code.recorded(model, results)
        looped = model if model.compiled is None else model.compiled()
        self._identity = " ".join([looped.digest, *self._recorded])
        self._engine = _compiled(looped, self.results) or OneByOne(_without_tables(model), self._recorded)
        self._finder = looped.at_rest.finder if looped.at_rest and self.compiled else None
        self._find: Callable[[Matrix, Matrix], Matrix] | None = None

    @property
    def compiled(self) -> bool:
        """Whether compiled code runs the cases, eight at once."""
        return isinstance(self._engine, Kernel)

    def run(
        self,
        steps: int,
        h: float,
        start: Mapping[str, ArrayLike] | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        *,
        every: int = 1,
        state: BatchState | None = None,
        workers: int = 1,
    ) -> BatchRun:
        """Run all cases over ``steps`` steps.

        Parameters
        ----------
        steps : int
            Number of steps; 0 for the initial results alone.
        h : float
            Step [s]; divided as ``Stepper`` divides it where a case needs shorter steps.
        start : mapping of str to array_like
            Parameters and inputs that differ from the model's table: scalars, or shape (cases,). The name of an array,
            ``damage``, stands for all its elements: shape (size,), or (cases, size). A membrane begins in equilibrium with
            them; a case without one has failed.
        inputs : mapping of str to array_like, shape (steps,) or (cases, steps)
            Values at the end of each step of the inputs that vary in time. Until the first step they have the value of
            ``start`` or of the table.
        every : int
            Record every so many steps.
        state : BatchState or None
            Where to go on; ``start`` then holds inputs only. The state itself stays as it is.
        workers : int
            Number of threads.

        Raises
        ------
        InputError, ParameterError
            A value is not finite, is out of range or has another shape. The message names the variable and the case.
        StateError
            The saved state is of another model, or a parameter is given beside it.
        """
        _check_numbers(steps, h, every, workers)
        start, inputs = start or {}, inputs or {}
        table, n_p = self._table, len(self._table.parameters)
        if state is not None and state.model != self._identity:
            msg = f"this saved state is of another model than {table.model!r}, or of other recorded results"
            raise StateError(msg)
        cases = count_cases(table, start, inputs, None if state is None else len(state.x))
        n_given, n_y = len(table.variables), len(self._recorded)
        given = table.start(start, cases, None if state is None else state.values[:, :n_given])
        task = Task(
            steps=steps,
            every=every,
            h=float(h),
            records=[
                (table.places(name)[0] - n_p, values)
                for name, values in zip(self.inputs, table.records(inputs, self.inputs, steps, cases), strict=True)
            ],
            starts=state is None,
            p=given[:, :n_p].copy(),
            u=given[:, n_p:].copy(),
            x=np.zeros((cases, self._n_x)) if state is None else state.x.copy(),
            y=np.zeros((cases, n_y)) if state is None else state.values[:, n_given:].copy(),
            initial=np.empty((cases, n_y)),
            results=np.empty((cases, len(self.results), steps // every)),
        )
        if task.starts and self._finder is not None:
            self._find = self._find or self._finder()
            q = self._find(task.u, task.p)
            task.x[:, : q.shape[1]] = q
        self._engine.run(task, workers)
        values = np.concatenate([task.p, task.u, task.y], axis=1)
        return BatchRun(
            results=task.results,
            initial=task.initial[:, : len(self.results)],
            state=BatchState(x=task.x, values=values, model=self._identity),
        )


def _compiled(model: StepModel, results: Sequence[str]) -> Kernel | None:
    """Return the compiled kernel, or None and a warning where there is none."""
    slow = "the cases of model '%s' run one after the other, some tens of times as slow as compiled: %s"
    if not has_compiler():
        log.warning(slow, model.name, f"the compiler ziglang is missing. Install it with: pip install {PACKAGE}")
        return None
    parts = [model.digest, *results, Path(code.__file__).read_bytes(), *code.own_sources().values()]
    key = hashlib.sha256(repr(parts).encode()).hexdigest()
    try:
        return Kernel(library(key, lambda: code.sources(model, results), f"model '{model.name}'"))
    except RuntimeError as error:  # an operation that lanes.h does not know
        log.warning(slow, model.name, error)
        return None


def _without_tables(model: StepModel) -> StepModel:
    """Return the form of a model that CasADi's virtual machine runs."""
    if model.tables is None:
        return model
    if model.expression is None:
        advice = f"Make it without compiled=True, or install the compiler with: pip install {PACKAGE}"
        msg = f"model {model.name!r} has loops over tables, which only compiled code runs. {advice}"
        raise ParameterError(msg)
    return model.expression()


def _require(model: StepModel, names: Sequence[str], known: Sequence[str], what: str) -> None:
    for name in names:
        if name not in known or list(names).count(name) > 1:
            msg = f"model {model.name!r} has no {what} {name!r}, or it is named twice. It has {', '.join(known[:12])}."
            raise InputError(msg)


def _check_numbers(steps: int, h: float, every: int, workers: int) -> None:
    for name, number, least in (("steps", steps, 0), ("every", every, 1), ("workers", workers, 1)):
        if not isinstance(number, int | np.integer) or number < least:
            msg = f"{name} must be a whole number, {least} or more, not {number!r}"
            raise InputError(msg)
    if not (isinstance(h, int | float | np.floating) and math.isfinite(h) and h > 0.0):
        msg = f"the step h must be a positive time [s], not {h!r}"
        raise InputError(msg)


class OneByOne:
    """A model and the results to compute, in the place of a ``Kernel``.

    Parameters
    ----------
    model : StepModel
        Model.
    results : sequence of str
        Columns of ``Task.y``.
    """

    def __init__(self, model: StepModel, results: Sequence[str]) -> None:
        self._model = model
        self._rows = [model.names.index(name) for name in results]

    def run(self, task: Task, workers: int) -> None:  # noqa: ARG002 one thread
        """Fill the arrays of a run as a ``Kernel`` does."""
        for case in range(len(task.x)):
            self._run_case(task, case)

    def _run_case(self, task: Task, case: int) -> None:
        stepper = Stepper(self._model)
        u = self._model.slices()[1]
        failed = not self._begin(stepper, task, case)
        task.initial[case] = task.y[case] = np.nan if failed else stepper.values[self._rows]
        n_results = task.results.shape[1]
        for k in range(task.steps):
            for place, values in task.records:
                task.u[case, place] = values[case if len(values) > 1 else 0, k]
            if not failed:
                try:
                    stepper.set_values(range(u.start, u.stop), task.u[case].tolist())
                    stepper.step(task.h)
                    task.y[case] = stepper.values[self._rows]
                except (GossamerError, ValueError, ZeroDivisionError, OverflowError):  # the limit may be no number
                    failed = True
                    task.y[case] = np.nan
            if (k + 1) % task.every == 0:
                task.results[case, :, (k + 1) // task.every - 1] = task.y[case, :n_results]
        task.x[case] = np.nan if failed else stepper.x

    def _begin(self, stepper: Stepper, task: Task, case: int) -> bool:
        """Bring a stepper to the beginning of a case; return whether that is a number."""
        p, u, _ = self._model.slices()
        if not task.starts:
            values = np.zeros(len(self._model.variables))
            values[p], values[u], values[self._rows] = task.p[case], task.u[case], task.y[case]
            stepper.resume(values, task.x[case])
            return bool(np.isfinite(values).all() and np.isfinite(task.x[case]).all())
        stepper.set_values(range(u.stop), [*task.p[case].tolist(), *task.u[case].tolist()])
        try:
            stepper.initialize()
        except GossamerError:
            return False
        return True
