r"""From damages to what gauges read, in lanes.

Symbols: ``x`` unknowns, first the Z damages [1], then the nuisances in units of their priors' deviations; ``m`` cases, ``n``
samples, ``G`` gauges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
from gossamer_files.options import option

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..errors import ConvergenceError, ParameterError
from ..membrane import Structure, membrane_model
from ..step_model import StepModel
from ..twin.least_squares import DAMAGE_STEP, MOST_DAMAGE, neighbours
from ..twin.nuisances import BEYOND, LOAD
from ..twin.problem import NUISANCE_STEP
from .candidates import Gauges

LANES = 8
_MEMORY = 2**24  # numbers of one recording
Report = Callable[[str, int, int], None]  # what is done, how many of how many


def quiet(what: str, done: int, total: int) -> None:
    """Report nothing."""


class GaugeSimulation:
    """A membrane on a mesh with damages and nuisances as unknowns.

    Parameters
    ----------
    structure : Structure
        The membrane, with zones.
    load : mapping of str to float
        Parameters and inputs that differ from their start values, for instance ``pressure_amplitude``.
    step : float
        Time between samples [s].
    samples : int
        Samples of each history, from the moment that the load sets in.

    Attributes
    ----------
    zones : int
        Z.
    nuisances : tuple of str
        ``amplitude`` of the built-in pressure and ``damping``, where they are not zero.
    low, high : ndarray, shape (Z + nuisances,)
        Bounds of the unknowns.
    simulations : int
        Cases that were simulated.

    Raises
    ------
    ParameterError
        The setup has no zones, or the model has no such parameter.
    """

    def __init__(self, structure: Structure, load: Mapping[str, float], step: float, samples: int) -> None:
        if not structure.n_zones:
            msg = "the setup has no zones, so there is no damage to find. Write [[zones]] with groups of faces."
            raise ParameterError(msg)
        bare = replace(structure, setup=replace(structure.setup, sensors=(), expose=True), gauges=())
        self._model = membrane_model(bare)
        self._reference = structure.mesh.nodes
        self.h, self.samples, self.simulations = step, samples, 0
        self._start = self._known(load)
        self.zones = structure.n_zones
        self.nuisances = tuple(name for name in ("amplitude", "damping") if self._start[LOAD[name][0]] > 0.0)
        unknown = len(self.nuisances)
        self.low = np.r_[np.zeros(self.zones), np.full(unknown, -BEYOND)]
        self.high = np.r_[np.full(self.zones, MOST_DAMAGE), np.full(unknown, BEYOND)]
        nodes = tuple(f"node[{k + 1}]" for k in range(self._reference.size))
        self._batch = Batch(_without_init(self._model), nodes)

    def histories(self, x: Matrix, gauges: Gauges, report: Report = quiet) -> Matrix:
        """Simulate the strain [1] of gauges for rows of unknowns, shape (m, G, n).

        Raises
        ------
        ConvergenceError
            A case fails.
        """
        found = []
        for first in range(0, len(x), LANES):
            found.append(self._some(x[first : first + LANES], gauges))
            report("simulations", min(first + LANES, len(x)), len(x))
        return np.concatenate(found)

    def derivatives(self, x: Vector, gauges: Gauges, report: Report = quiet) -> tuple[Matrix, Matrix]:
        """Return the strain [1] at unknowns, shape (G, n), and its forward differences by them, shape (unknowns, G, n)."""
        steps = np.where(np.arange(len(x)) < self.zones, DAMAGE_STEP, NUISANCE_STEP)
        rows, steps = neighbours(x, np.arange(len(x)), steps, self.high)
        found = self.histories(np.vstack([x, rows]), gauges, report)
        return found[0], (found[1:] - found[0]) / steps[:, None, None]

    def _known(self, load: Mapping[str, float]) -> dict[str, float]:
        variables = {v.name: v for v in self._model.variables if v.causality in ("parameter", "input")}
        for name in load:
            if name not in variables:
                msg = f"this membrane has no parameter or input {name!r}. It has {', '.join(list(variables)[:12])}, ..."
                raise ParameterError(msg)
        return {name: load.get(name, variable.start or 0.0) for name, variable in variables.items()}

    def _some(self, x: Matrix, gauges: Gauges) -> Matrix:
        """Simulate cases that fit into the lanes."""
        start = self._values(x)
        empty = self._batch.run(0, self.h, start).state  # knows the order of the values and has checked them
        rest = [self._rest(row) for row in empty.values]
        state = replace(empty, x=np.array([q for q, _ in rest]), values=empty.values.copy())
        state.values[:, -1] = [limit for _, limit in rest]
        strain, done = np.empty((len(x), len(gauges.sensors), self.samples)), 0
        piece = max(1, _MEMORY // (len(x) * self._reference.size))
        while done < self.samples:
            steps = min(piece, self.samples - done)
            run = self._batch.run(steps, self.h, state=state)
            state = run.state
            for case, moved in enumerate(run.results):
                at = self._reference[:, :, None] + moved.reshape(*self._reference.shape, steps)
                strain[case, :, done : done + steps] = gauges.strain(at)
            done += steps
        self.simulations += len(x)
        if not np.isfinite(strain).all():
            advice = f"Check supports and prestress, or lower the load with {option('set')}."
            msg = f"the membrane fails while it is simulated. {advice}"
            raise ConvergenceError(msg)
        return strain

    def _values(self, x: Matrix) -> dict[str, Vector]:
        start = {name: np.full(len(x), value) for name, value in self._start.items()}
        start |= {f"damage[{k + 1}]": x[:, k] for k in range(self.zones)}
        for i, name in enumerate(self.nuisances):
            parameter, deviation = LOAD[name]
            start[parameter] = start[parameter] * np.exp(deviation * x[:, self.zones + i])
        return start

    def _rest(self, values: Vector) -> tuple[Vector, float]:
        """Return the state in equilibrium and the largest step there, for the values of one case."""
        p, u, y = self._model.slices()
        state, results = self._model.init(values[u], values[p])
        limit = float(results[self._model.names.index("max_step") - y.start])
        return np.asarray(state).ravel(), limit


def _without_init(model: StepModel) -> StepModel:
    """Leave out the relaxation, whose many steps are too much code for lanes."""
    u, p = model.init.mx_in()
    _, _, y = model.slices()
    nothing = [ca.MX.zeros(model.n_states), ca.MX.zeros(len(model.names) - y.start)]
    return replace(model, init=ca.Function("init", [u, p], nothing))
