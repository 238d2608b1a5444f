"""Run many cases with ``Stepper``, one after the other: where there is no compiler."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np

from ..arrays import Vector
from ..errors import GossamerError
from ..step_model import StepModel
from ..stepper import Stepper
from .kernel import Task


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
            stepper.state = _saved(stepper, values, task.x[case])
            return bool(np.isfinite(values).all() and np.isfinite(task.x[case]).all())
        stepper.set_values(range(u.stop), [*task.p[case].tolist(), *task.u[case].tolist()])
        try:
            stepper.initialize()
        except GossamerError:
            return False
        return True


def _saved(stepper: Stepper, values: Vector, x: Vector) -> bytes:
    """Write the state of a running stepper as ``Stepper.state`` does."""
    head = stepper.state[: -(1 + 8 * (values.size + x.size)) - 4]
    body = bytes([True]) + values.tobytes() + x.tobytes()
    return head + struct.pack("<I", zlib.crc32(body)) + body
