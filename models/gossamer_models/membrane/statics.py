r"""Equilibria of a membrane under many loads and damages, by Newton's method from one that is known.

Symbols: ``q`` displacements of the moving nodes [m], M of them; ``f`` forces [N]; ``K`` = -df/dq tangent [N/m]; ``u`` inputs
and ``p`` parameters in the model's order; ``m`` cases, ``z`` zones, ``s`` sensors, ``k`` quantities, ``N`` nodes.
"""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix, Vector
from ..batch.cases import CaseTable, Cube, count_cases
from ..errors import ParameterError
from ..step_model import StepModel
from ..stepper import Evaluator
from ..variables import by_name
from .assembly import MembraneEquations
from .newton import STALLED, Known, Newton, column, factored
from .setup import LEFT
from .structure import Structure

KEPT = 64  # equilibria
ROUNDED, ROUGHLY, DAMAGES = 5, 2, 16.0  # binary digits of numbers, and shares of damage, of which equilibria are kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibria:
    """Cases in equilibrium.

    Attributes
    ----------
    u, p : ndarray, shape (m, inputs), (m, parameters)
        Their inputs and parameters, in the model's order.
    q : ndarray, shape (m, 3 M)
        Displacements of the moving nodes in the order of the model [m]; not a number where there is no equilibrium.
    x : ndarray, shape (m, n_states)
        State of the model, at rest.
    displacement : ndarray, shape (m, N, 3)
        Displacement of all nodes from the mesh, in its order, that of supports included [m].
    strain : ndarray, shape (m, s)
        What the gauges of the setup read [1].
    """

    u: Matrix
    p: Matrix
    q: Matrix
    x: Matrix
    displacement: Cube
    strain: Matrix

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Cases without an equilibrium."""
        return np.asarray(np.isnan(self.q).any(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class EquilibriumDerivatives:
    """How equilibria change with k quantities, per unit of each.

    Attributes
    ----------
    displacement : ndarray, shape (m, k, N, 3)
        Of all nodes [m], in the order of the mesh.
    strain : ndarray, shape (m, k, s)
        Of the gauges [1].
    """

    displacement: Cube
    strain: Cube


class Equilibrium:
    """What finds equilibria of a membrane.

    A case starts from the equilibrium of its rounded numbers, which cases beside it share, with the factors of its tangent
    as long as the forces fall to half in a step, then with its own. Where this fails, the relaxation of the model's own
    ``init`` takes over. That equilibrium is found alike from that of the undamaged membrane under the same loads, this one
    from that of roughly the same numbers, and this from that of the start values. So what a case gives does not depend on
    the others.

    Parameters
    ----------
    structure : Structure
        The membrane.
    model : StepModel
        Its model, as from ``membrane_model(structure)``.

    Raises
    ------
    ParameterError
        The model has loops over tables, or is no membrane.

    Notes
    -----
    The built-in pressure is left out and gas fills the volume of the equilibrium, as where the model starts. Threads that
    share it wait for each other; it can be pickled.

    Examples
    --------
    >>> from gossamer_models.membrane import membrane_model, square_structure
    >>> square = square_structure(4, 1)
    >>> equilibrium = Equilibrium(square, membrane_model(square))
    >>> found = equilibrium.solve({"damage": [[0.3] + [0.0] * 15, [0.0] * 16], "pressure": 100.0})
    >>> found.strain.shape
    (2, 4)
    """

    def __init__(self, structure: Structure, model: StepModel) -> None:
        if model.at_rest is None or model.tables is not None:
            msg = f"model {model.name!r} has no displacements at rest, or loops over tables. Give the membrane's own model."
            raise ParameterError(msg)
        equations, rest = MembraneEquations(structure), model.at_rest
        n, n_nodes = equations.n_q, len(structure.mesh.nodes)
        self._init, self.begin = model.init, rest.begin
        self.newton = Newton(equations, model.variables)
        self.free = self.newton.free
        p_rows, u_rows, y_rows = model.slices()
        self._table = CaseTable(model=model.name, parameters=model.variables[p_rows], inputs=model.variables[u_rows])
        self._damages = [i for i, name in enumerate(model.names[u_rows]) if name.startswith("damage[")]
        self._left = [i for i, name in enumerate(model.names[u_rows]) if name.partition("[")[0] in LEFT]
        self._limits = [np.array([v.limits for v in model.variables[rows]]).reshape(-1, 2).T for rows in (u_rows, p_rows)]

        u, p, q = arguments = [ca.MX.sym(name, rest.begin.size1_in(i)) for i, name in enumerate("upq")]
        inputs, parameters = by_name(model.variables[u_rows], u), by_name(model.variables[p_rows], p)
        x = equations.positions(q, inputs, parameters)
        f, _ = self.newton.balance.call(arguments, True, False)
        relevant = ca.which_depends(f, ca.vertcat(u, p), 1, False)
        self._relevant = np.array(relevant[: u.numel()]), np.array(relevant[u.numel() :])

        order = np.argsort(structure.order)
        away = ca.reshape(x - equations.arrays["nodes"], 3, n_nodes)[:, order.tolist()]
        rows = [model.names.index(name) - y_rows.start for name in model.elements("strain")]
        _, y = rest.begin.call(arguments, True, False)
        strain = y[rows[0] : rows[-1] + 1] if rows else ca.MX.zeros(0)
        seen = ca.vertcat(ca.vec(away), strain)
        self._seen = Evaluator(ca.Function("seen", arguments, [ca.densify(seen)]))
        du, dp, dq = directions = [ca.MX.sym(f"d{a.name()}", a.numel()) for a in arguments]
        given, moved = ca.vertcat(u, p), ca.vertcat(du, dp)
        self._pushed = ca.Function("pushed", [*arguments, du, dp], [ca.densify(ca.jtimes(f, given, moved))])
        change = ca.jtimes(seen, ca.vertcat(given, q), ca.vertcat(moved, dq))
        self._changed = ca.Function("changed", [*arguments, *directions], [ca.densify(change)])
        self._shape, self._n_q = (n_nodes, len(rows)), n
        self._kept: OrderedDict[bytes, Known | None] = OrderedDict()
        self._is_loaded_later = structure.starts_in_plane
        self._solving = Lock()  # it keeps what it has found

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_solving"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _solving=Lock())

    def __call__(self, u: Matrix, p: Matrix) -> Matrix:
        """Return the displacements of equilibrium [m], shape (m, 3 M), for inputs and parameters in the model's order."""
        with self._solving:
            return np.array([self._find(*row) for row in zip(u, p, strict=True)]).reshape(len(u), -1)

    def solve(self, given: Mapping[str, ArrayLike]) -> Equilibria:
        """Find equilibria.

        Parameters
        ----------
        given : mapping of str to array_like
            Parameters and inputs that differ from the model's table: scalars, or shape (m,). The name of an array, as
            ``damage``, stands for all its elements: shape (size,), or (m, size).

        Raises
        ------
        InputError, ParameterError
            A value is not finite, is out of range or has another shape. The message names the variable and the case.
        """
        values = self._table.start(given, count_cases(self._table, given, {}, None), None)
        n_p = len(self._table.parameters)
        p, u = values[:, :n_p], values[:, n_p:]
        q = self(u, p)
        rows = list(zip(u, p, q, strict=True))
        with self._solving:
            seen = np.array([self._seen(*row)[0] for row in rows])
        displacement, strain = self._split(seen)
        x = np.array([column(self.begin(*row)[0]) for row in rows])
        x[np.isnan(q).any(axis=1)] = np.nan
        return Equilibria(u=u, p=p, q=q, x=x, displacement=displacement, strain=strain)

    def derivatives(self, found: Equilibria, names: Sequence[str]) -> EquilibriumDerivatives:
        r"""Return how equilibria change with parameters and inputs.

        Parameters
        ----------
        found : Equilibria
            As from ``solve``.
        names : sequence of str
            Parameters and inputs; the name of an array stands for all its elements, one after another.

        Raises
        ------
        InputError
            There is no such parameter or input.

        Notes
        -----
        From :math:`f(q(v), v) = 0`: :math:`\mathrm{d}q/\mathrm{d}v = K^{-1}\,\partial f/\partial v`. Not a number where
        there is no equilibrium.
        """
        places = [place for name in names for place in self._table.places(name)]
        n_p, n_u = len(self._table.parameters), len(self._table.inputs)
        one = np.eye(n_p + n_u)[:, places]
        dp, du = one[:n_p], one[n_p:]
        changes = np.full((len(found.q), len(places), 3 * self._shape[0] + self._shape[1]), np.nan)
        for case in np.flatnonzero(~found.failed):
            at = found.u[case], found.p[case], found.q[case]
            with self._solving:
                K = self.newton.stiffened(*at)
            pushed = np.asarray(self._pushed(*(np.tile(a[:, None], len(places)) for a in at), du, dp))
            dq = np.zeros((found.q.shape[1], len(places)))
            dq[self.free] = factored(K).solve(np.ascontiguousarray(pushed[self.free]))
            at_all = (np.tile(a[:, None], len(places)) for a in at)
            changes[case] = np.asarray(self._changed(*at_all, du, dp, dq)).T
        displacement, strain = self._split(changes)
        return EquilibriumDerivatives(displacement=displacement, strain=strain)

    def tangent(self, found: Equilibria, case: int) -> scipy.sparse.csc_matrix:
        """Return K [N/m] of a case for the displacements ``free``, sparse, shape (free, free)."""
        with self._solving:
            return self.newton.tangent(found.u[case], found.p[case], found.q[case])

    def _split(self, seen: Cube) -> tuple[Cube, Cube]:
        n_nodes, _ = self._shape
        return seen[..., : 3 * n_nodes].reshape(*seen.shape[:-1], n_nodes, 3), seen[..., 3 * n_nodes :]

    def _find(self, u: Vector, p: Vector) -> Vector:
        """Return the displacements of one case."""
        known = self._near(u, p) or self._first
        q = None if known is None else self.newton.reach(u, p, known)
        return self._relaxed(u, p) if q is None else q

    def _near(self, u: Vector, p: Vector) -> Known | None:
        """Return the equilibrium of the rounded numbers of a case: 1/16 of damage, 1/32 to 1/16 of the size of all else."""
        u_near, p_near = self._rounded(u, p, ROUNDED)
        u_near[self._damages] = np.floor(DAMAGES * u[self._damages]) / DAMAGES
        u_near[self._left] = np.ceil(DAMAGES * u[self._left]) / DAMAGES  # shares of a stiffness
        return self._known(u_near, p_near)

    def _rounded(self, u: Vector, p: Vector, digits: int) -> list[Vector]:
        """Return inputs and parameters whose distance from the start values has so many binary digits of their size."""
        found = []
        for values, start, limits in zip((u, p), self.newton.given, self._limits, strict=True):
            unit = np.exp2(np.frexp(np.maximum(np.abs(values), np.abs(start)))[1] - digits)
            found.append(np.clip(start + np.round((values - start) / unit) * unit, *limits))
        return found

    def _known(self, u: Vector, p: Vector) -> Known | None:
        """Return an equilibrium, kept or found from that of the undamaged membrane, of rough numbers, or the first one."""
        key = np.concatenate([u[self._relevant[0]], p[self._relevant[1]]]).tobytes()
        if key not in self._kept:
            begin = self._before(u, p)
            q = None if begin is None else self.newton.reach(u, p, begin)
            q = self._relaxed(u, p) if q is None else q
            self._kept[key] = None if np.isnan(q).any() else Known(u.copy(), p.copy(), q)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]

    def _before(self, u: Vector, p: Vector) -> Known | None:
        """Return the equilibrium that one is found from."""
        healthy = u.copy()
        healthy[self._damages] = 0.0
        if not np.array_equal(healthy, u):
            return self._known(healthy, p)
        rough = self._rounded(u, p, ROUGHLY)
        rough[0][self._damages] = 0.0
        if np.array_equal(rough[0], u) and np.array_equal(rough[1], p):
            return self._first
        return self._known(*rough) or self._first

    @cached_property
    def _first(self) -> Known | None:
        """The equilibrium at the start values, if there is one."""
        u, p = (values.copy() for values in self.newton.given)
        u[self._damages] = 0.0
        q = self._relaxed(u, p)
        return None if np.isnan(q).any() else Known(u, p, q)

    def _relaxed(self, u: Vector, p: Vector) -> Vector:
        """Return the displacements that the model's own ``init`` finds, not a number where it leaves loads out."""
        q = column(self._init(u, p)[0])[: self._n_q]
        return np.full_like(q, np.nan) if self._is_loaded_later and self.newton.left(u, p, q)[1] > STALLED else q
