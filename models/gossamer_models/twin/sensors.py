"""The four sensors behind a twin's membrane: strain in, resistance out, in lanes.

Symbols: ``m`` cases, ``n`` samples.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..batch.cases import BatchState
from ..errors import ParameterError
from ..membrane import MembraneParams
from ..membrane.params import stretch
from ..sensor import SensorArtifact, sensor_model
from .record import N_SENSORS


class Sensors:
    """Four sensors of one artifact, each with its parameters.

    Parameters
    ----------
    artifact : SensorArtifact
        What they are.
    params : MembraneParams
        Membrane that they are on; they rest at its prestrain.
    parameters : mapping of str to float or array_like of shape (4,)
        Parameters that differ from their start values.

    Raises
    ------
    ParameterError
        A parameter has another shape.

    Attributes
    ----------
    parameters : dict of ndarray, shape (4,)
        All parameters.
    """

    def __init__(
        self, artifact: SensorArtifact, params: MembraneParams, parameters: Mapping[str, ArrayLike] | None = None
    ) -> None:
        model = sensor_model(artifact)
        starts = {v.name: v.start for v in model.variables if v.causality == "parameter" and v.start is not None}
        known: dict[str, ArrayLike] = {**starts, "rest_strain": stretch(params) - 1.0, **(parameters or {})}
        for name, value in known.items():
            if np.shape(value) not in ((), (1,), (N_SENSORS,)):
                msg = f"sensor parameter {name!r} has shape {np.shape(value)}. Give one value, or one for each of 4 sensors."
                raise ParameterError(msg)
        self.parameters = {name: np.broadcast_to(value, (N_SENSORS,)) for name, value in known.items()}
        self._batch = Batch(model, ("resistance",), ("strain",))

    def rest(self, strain: Vector, h: float) -> BatchState:
        """Return the state of sensors that have rested under a strain, shape (4,) [1]."""
        start = {**self.parameters, "strain": strain}
        return self._batch.run(0, h, start, {"strain": np.zeros(0)}).state

    def read(self, strain: Matrix, h: float, state: BatchState | None = None) -> tuple[Matrix, BatchState]:
        """Return the resistance of sensors under strain, and their state.

        Parameters
        ----------
        strain : ndarray, shape (m, 4, n)
            Strain [1]; not a number in cases that have failed.
        h : float
            Step [s].
        state : BatchState, optional
            Of the four sensors, where every case begins; by default they have rested.

        Returns
        -------
        ndarray, shape (m, 4, n)
            Resistance [ohm]; not a number in cases that have failed.
        BatchState
            Of all sensors of all cases.
        """
        m, _, n = strain.shape
        failed = np.asarray(~np.isfinite(strain).all(axis=(1, 2)))
        signal = np.where(failed[:, None, None], self.parameters["rest_strain"][:, None], strain).reshape(-1, n)
        start = {name: np.tile(value, m) for name, value in self.parameters.items()} if state is None else {}
        run = self._batch.run(n, h, start, {"strain": signal}, state=None if state is None else repeated(state, m))
        resistance = run.results.reshape(m, N_SENSORS, n)
        resistance[failed] = np.nan
        return resistance, run.state


def repeated(state: BatchState, times: int) -> BatchState:
    """Return the cases of a state several times."""
    return BatchState(x=np.tile(state.x, (times, 1)), values=np.tile(state.values, (times, 1)), model=state.model)
