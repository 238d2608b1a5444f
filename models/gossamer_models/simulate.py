"""Run a model over records of its inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Vector
from .stepper import Stepper


def simulate(
    stepper: Stepper, steps: ArrayLike, inputs: Mapping[str, ArrayLike], results: Sequence[str]
) -> dict[str, Vector]:
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
