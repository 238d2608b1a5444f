r"""What places of strain gauges change: how the strain of a record changes along each gauge's direction and across it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Matrix, Vector
from ..membrane.gauges import moved_gauge
from .forward import MembraneForward
from .least_squares import require_finite
from .nuisances import SPARE, Nuisances
from .record import ResponseRecord, StaticRecord
from .unknowns import DamageUnknowns

MOVE = 1e-3  # [m], of a reading that is linear in it


class PlaceSlopes:
    """A membrane that is read by its gauges and by others, moved along and across.

    Parameters
    ----------
    forward : MembraneForward
        As its own gauges read it.
    """

    def __init__(self, forward: MembraneForward) -> None:
        structure, moves = forward.structure, [(0.0, 0.0), (MOVE, 0.0), (0.0, MOVE)]
        mesh, normals, sensors = structure.mesh, structure.normals, structure.setup.sensors
        gauges = tuple(moved_gauge(mesh, normals, sensor, move) for move in moves for sensor in sensors)
        read = replace(structure, setup=replace(structure.setup, sensors=len(moves) * sensors), gauges=gauges)
        self._forward = MembraneForward(read, {**forward.parameters, **forward.inputs}, faults=forward.faults)

    def at(self, nuisances: Nuisances, record: ResponseRecord, x: Vector | None = None) -> Matrix:
        """Return the slopes [1/m] at unknowns, 0 for None, shape (2, s, n), as long as what is simulated of a record."""
        unknowns = DamageUnknowns(self._forward, nuisances)
        x = np.zeros(unknowns.size) if x is None else x
        if isinstance(record, StaticRecord):
            y = unknowns.histories(x[None], record.states, 0.0)[:, :, record.state]
        else:
            y = unknowns.histories(x[None], record.samples + SPARE, record.step)
        own, *moved = require_finite(y).reshape(3, -1, y.shape[2])
        return np.stack([each - own for each in moved]) / MOVE
