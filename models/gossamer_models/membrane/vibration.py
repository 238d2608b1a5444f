r"""Small vibrations about an equilibrium: the forces that step the membrane, linearised exactly.

Symbols: ``q`` displacements of the M nodes that move [m], ``f`` forces [N], ``K`` = -df/dq tangent [N/m], ``M`` masses [kg];
``phi`` shape of a mode [kg^-1/2], ``omega`` its angular frequency [1/s]; ``R`` motion of the nodes with the frame, three
columns along x, y, z [1] and three about them through the membrane's own origin [m]; ``V`` volume of gas [m3].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import casadi as ca
import numpy as np
import scipy.linalg
import scipy.sparse
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import ArpackError, LinearOperator, SuperLU, eigsh, splu

from ..arrays import Matrix, Vector
from ..errors import ConvergenceError, require
from ..step_model import StepModel
from ..variables import by_name
from .assembly import MembraneEquations
from .equilibrium import pulled
from .model import membrane_model
from .newton import factored
from .statics import Equilibrium
from .structure import Structure

AXES = ("along x", "along y", "along z", "about x", "about y", "about z")  # of the frame
SHIFT = 1e-13  # of the largest stiffness over mass: a stiffness below it is one of rounding
TRIALS = 5  # of finding all modes
FURTHER = 3  # modes that are found beyond those whose changes are wanted
ALIKE = 1e-5  # relative distance of squared frequencies below which modes are of one frequency
FOLLOWING = 1e-3  # share of the stiffness that loads which follow the surface may take from its symmetry, unnoticed


class Linearised:
    """A membrane about the equilibrium of some inputs and parameters.

    Parameters
    ----------
    structure : Structure
        The membrane.
    given : mapping of str to array_like, optional
        Parameters and inputs that differ from their start values, as ``Equilibrium.solve`` takes them.

    Attributes
    ----------
    u, p, q : ndarray
        Inputs, parameters, and displacements of equilibrium [m], in the order of the model.
    free : ndarray of int
        Places in q of what is not held, F of them.
    K, M : sparse matrix, shape (F, F)
        Tangent without what the gas adds [N/m], its symmetric part, and masses [kg].
    asymmetry : float
        Largest part of the tangent that is not symmetric, over its largest [1].
    gas : ndarray, shape (F,)
        The gas adds the product of this with itself to the tangent [(N/m)^1/2]; zero without gas.
    nodal_mass : ndarray, shape (3 M,)
        Mass of the node of each displacement [kg].
    R : ndarray, shape (3 M, 6)
        Motion with the frame.

    Raises
    ------
    ConvergenceError
        There is no equilibrium.
    ParameterError, InputError
        As from ``Equilibrium.solve``.
    """

    def __init__(self, structure: Structure, given: Mapping[str, ArrayLike] | None = None) -> None:
        self.structure, model = structure, membrane_model(structure)
        equilibrium, first = Equilibrium(structure, model), model.variables[0]
        found = equilibrium.solve({first.name: first.start or 0.0} | dict(given or {}))
        if found.failed[0]:
            msg = "there is no equilibrium to vibrate about. Check supports, prestress, loads and damage of the setup."
            raise ConvergenceError(msg)
        self.u, self.p, self.q = found.u[0], found.p[0], found.q[0]
        self.displacement = found.displacement[0]
        self._newton = equilibrium.newton
        self.free, self.variables, equations = equilibrium.free, model.variables, MembraneEquations(structure)
        _, u_rows, y_rows = model.slices()
        self.inputs, results = model.variables[u_rows], model.variables[y_rows]
        smooth = ("strain", *structure.probes)
        wanted = ((i, v.name.partition("[")[0]) for i, v in enumerate(results) if v.causality == "output")
        self._rows = [i for i, name in wanted if name in smooth]
        self.outputs = tuple(results[i] for i in self._rows)
        self._functions(equations, model, equilibrium.begin)
        K = equilibrium.tangent(found, 0)
        self.K = scipy.sparse.csc_matrix((K + K.T) / 2.0)
        self.asymmetry = float(abs(K - K.T).max() / abs(K).max()) / 2.0
        self.volume = np.asarray(self._volume(self.u, self.p, self.q)).ravel()
        mass, at, stiffness = (np.asarray(part).ravel() for part in self._known(*self.at))
        self.nodal_mass = np.repeat(mass, 3)[: self.q.size]
        self.held_mass, self.at_rest = mass[self.q.size // 3 :], at.reshape(-1, 3)
        self.M = scipy.sparse.diags(self.nodal_mass[self.free], format="csc")
        n = self.q.size
        X = self.at_rest[: n // 3]
        turned = np.stack([np.cross(e, X) for e in np.eye(3)], axis=-1)
        self.R = np.concatenate([np.tile(np.eye(3), (len(X), 1, 1)), turned], axis=2).reshape(n, 6)
        self.gas = np.zeros(len(self.free))
        if structure.setup.gas is not None:
            self.gas = np.sqrt(stiffness) * np.asarray(self._area(*self.at)).ravel()[self.free]

    @property
    def at(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Arguments of the functions below."""
        return self.u, self.p, self.q, self.volume

    def _functions(self, equations: MembraneEquations, model: StepModel, begin: ca.Function) -> None:
        p_rows, u_rows, _ = model.slices()
        n, structure = self.q.size, self.structure
        sizes = {"u": self.u.size, "p": self.p.size, "q": n, "V": 1}
        u, p, q, V = arguments = [ca.MX.sym(name, size) for name, size in sizes.items()]
        inputs, parameters = by_name(model.variables[u_rows], u), by_name(model.variables[p_rows], p)
        x = equations.positions(q, inputs, parameters)
        found, f, gas = pulled(equations, V, ca.MX(0.0), x, inputs, parameters)
        y = begin.call([u, p, q], True, False)[1][self._rows]
        nodes = x.numel() // 3
        away = ca.reshape(x - equations.arrays["nodes"], 3, nodes)[:, np.argsort(structure.order).tolist()]
        r, W = ca.reshape(x, 3, nodes), []
        for load in (ca.reshape(found.f, 3, nodes), ca.reshape(f - found.f, 3, nodes)):
            about = [r[i - 2, :] * load[i - 1, :] - r[i - 1, :] * load[i - 2, :] for i in range(3)]
            W.append(ca.sum2(ca.vertcat(load, *about)))
        seen = ca.vertcat(f[:n], ca.vec(away), y, *W)
        self._ends = np.cumsum([n, 3 * nodes, y.numel(), 12]).tolist()
        self._seen = ca.Function("seen", arguments, [ca.densify(seen)])
        self._slopes = ca.Function("slopes", arguments, [ca.jacobian(y, q)])
        z = ca.vertcat(u, q, V)
        moved = [ca.MX.sym(f"d{a.name()}", a.numel()) for a in (u, q, V)]
        first = ca.jtimes(seen, z, ca.vertcat(*moved))
        self._moved = ca.Function("moved", [*arguments, *moved], [ca.densify(first)])
        along = [ca.MX.sym(f"e{a.name()}", a.numel()) for a in (u, q, V)]
        second = ca.jtimes(first, z, ca.vertcat(*along))
        self._bent = ca.Function("bent", [*arguments, *moved, *along], [ca.densify(second)])
        mass, stiffness, bounded = equations.mass(parameters), ca.MX(0.0), ca.MX(0.0)
        if structure.setup.gas is not None:
            bounded, ambient = equations.volume(x), structure.setup.gas.ambient
            stiffness = structure.setup.gas.exponent * (gas + ambient) / equations.filled_volume(bounded, V)
        self._volume = ca.Function("volume", [u, p, q], [bounded])
        self._area = ca.Function("area", arguments, [ca.densify(ca.gradient(bounded, q))])
        self._known = ca.Function("known", arguments, [mass, x, stiffness])

    def moved(self, du: Matrix | None = None, dq: Matrix | None = None, dV: Matrix | None = None) -> Seen:
        """Return how forces and results change, to first order, with columns of changes."""
        count = next(each.shape[1] for each in (du, dq, dV) if each is not None)
        return self._parted(self._moved, [self._change(count, du, dq, dV)], count)

    def bent(self, one: tuple[Matrix | None, ...], other: tuple[Matrix | None, ...]) -> Seen:
        """Return how ``moved`` of some changes changes itself with others, column by column."""
        count = next(each.shape[1] for each in one if each is not None)
        return self._parted(self._bent, [self._change(count, *one), self._change(count, *other)], count)

    def _change(self, count: int, *parts: Matrix | None) -> list[Matrix]:
        sizes = self.u.size, self.q.size, self.volume.size
        return [np.zeros((size, count)) if part is None else part for size, part in zip(sizes, parts, strict=True)]

    def _parted(self, function: ca.Function, changes: list[list[Matrix]], count: int) -> Seen:
        at = [np.tile(each[:, None], count) for each in self.at]
        return self._split(np.asarray(function(*at, *(part for change in changes for part in change))), count)

    def _split(self, found: Matrix, count: int) -> Seen:
        f, away, y, W = np.split(found, self._ends[:-1])
        return Seen(f=f[self.free], away=away.T.reshape(count, -1, 3), y=y, W=W)

    def slopes(self) -> scipy.sparse.csc_matrix:
        """Return the derivative of the results by free displacements, shape (y, F)."""
        return scipy.sparse.csc_matrix(self._slopes(*self.at).sparse())[:, self.free]

    def swelling(self, dq: Matrix) -> Matrix:
        """Return how the volume of the gas changes with columns of displacements [m3], shape (1, k)."""
        return np.asarray(self._area(*self.at)).reshape(1, -1) @ dq

    def seen(self, u: Vector, q: Vector) -> Seen:
        """Return forces and results at some inputs and displacements, of one column; gas keeps its amount."""
        return self._split(np.asarray(self._seen(u, self.p, q, self.volume)), 1)

    def embedded(self, columns: Matrix) -> Matrix:
        """Return columns of the free displacements, shape (F, k), among all of q, shape (3 M, k)."""
        found = np.zeros((self.q.size, columns.shape[1]))
        found[self.free] = columns
        return found

    def _factored(self, square: float) -> tuple[SuperLU, int]:
        """Factor K less a squared frequency times M; return how many modes are below it too, by Sylvester's law."""
        options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        try:
            factors = splu(scipy.sparse.csc_matrix(self.K - square * self.M), **options)
        except RuntimeError as error:  # exactly singular
            msg = "the membrane has no stiffness in some direction. Hold it by more, or raise the prestress."
            raise ConvergenceError(msg) from error
        below = int(np.sum(factors.U.diagonal() < 0.0))
        return factors, below - int(self.gas @ factors.solve(self.gas) < -1.0)  # the gas may lift one

    @cached_property
    def _shift(self) -> float:
        return SHIFT * float(np.max(np.abs(self.K.diagonal()) / self.M.diagonal()))

    @cached_property
    def _at_zero(self) -> tuple[SuperLU, int]:
        return self._factored(-self._shift)

    def solve_refilled(self, columns: Matrix) -> Matrix:
        r"""Return :math:`K^{-1}` of columns of forces on what is free [N], where gas keeps its pressure."""
        return np.asarray(self._at_zero[0].solve(np.ascontiguousarray(columns)))

    def solve(self, columns: Matrix) -> Matrix:
        r"""Return :math:`K^{-1}` of columns of forces on what is free [N], where gas keeps its amount."""
        return self._with_gas(self._at_zero[0], columns)

    def solver(self, u: Vector, q: Vector) -> Callable[[Matrix], Matrix]:
        """Return what does nearly so with the tangent of other inputs and displacements."""
        return partial(self._with_gas, factored(self._newton.stiffened(u, self.p, q)))

    def _with_gas(self, factors: SuperLU, columns: Matrix) -> Matrix:
        found = np.asarray(factors.solve(np.ascontiguousarray(columns)))
        if not self.gas.any():
            return found
        soft = factors.solve(self.gas)
        return np.asarray(found - np.outer(soft, self.gas @ found) / (1.0 + self.gas @ soft))

    def modes(self, count: int) -> Modes:
        r"""Find the slowest modes.

        Parameters
        ----------
        count : int
            How many.

        Raises
        ------
        ParameterError
            More than there are degrees of freedom.
        ConvergenceError
            The equilibrium is unstable, or has directions without stiffness.

        Notes
        -----
        :math:`K \varphi = \omega^2 M \varphi` with the true masses, whatever ``inplane_mass``, and the gas, whose amount
        stays. Factors of K tell by Sylvester's law how many of its values are negative. Where
        loads follow the surface at an edge that is free, K is not symmetric; the frequencies are those of its symmetric
        part, which they differ from in second order only.
        """
        n = len(self.free)
        require(1 <= count <= n, f"{count} modes of {n} degrees of freedom: ask for 1 to {n}, or refine the mesh.")
        if negative := self._at_zero[1]:
            msg = (
                f"the equilibrium is unstable: {negative} of its modes have negative stiffness, so it has no frequencies "
                'there. It is wrinkled or buckled: raise the prestress, lower the load, or write law = "relaxed".'
            )
            raise ConvergenceError(msg)
        squares, shapes = self._slowest(count)
        if squares[0] <= 10.0 * self._shift:
            soft = int(np.sum(squares <= 10.0 * self._shift))
            msg = f"{soft} of the modes have no stiffness: the film is slack. Raise the prestress, or hold it."
            raise ConvergenceError(msg)
        shapes *= np.sign(shapes[np.argmax(np.abs(shapes), axis=0), np.arange(count)])
        return Modes(linearised=self, squares=squares, phi=shapes)

    def _slowest(self, count: int) -> tuple[Vector, Matrix]:
        """Return squared frequencies and shapes; of equal ones ARPACK may miss one, so they are counted."""
        n = len(self.free)
        if 2 * count >= n:
            K = self.K.toarray() + np.outer(self.gas, self.gas)
            return scipy.linalg.eigh(K, self.M.toarray(), subset_by_index=(0, count - 1))  # type: ignore[no-any-return]
        operator = LinearOperator((n, n), lambda v: self.K @ v + self.gas * (self.gas @ v), dtype=float)
        inverse = LinearOperator((n, n), lambda v: self.solve(v.reshape(n, 1)).ravel(), dtype=float)
        for trial in range(TRIALS):
            start, wide = np.random.default_rng(trial).normal(size=n), min(n - 1, (2 + trial) * count + 20)
            known = {"sigma": -self._shift, "OPinv": inverse, "v0": start, "tol": 1e-12, "ncv": wide}
            try:
                squares, shapes = eigsh(operator, count, M=self.M, **known)
            except ArpackError:  # not converged; the next trial has more room
                continue
            order = np.argsort(squares)
            squares, shapes = squares[order], shapes[:, order]
            if self._factored((1.0 - ALIKE) * squares[-1])[1] <= np.sum(squares < (1.0 - ALIKE) * squares[-1]):
                return squares, shapes
        msg = f"the slowest {count} modes were not all found in {TRIALS} trials. Ask for a few more or less."
        raise ConvergenceError(msg)


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """Columns of forces and results.

    Attributes
    ----------
    f : ndarray, shape (F, k)
        Forces on free displacements [N].
    away : ndarray, shape (k, N, 3)
        Displacements of all nodes from the mesh, in its order [m].
    y : ndarray, shape (y, k)
        Results ``Linearised.outputs``.
    W : ndarray, shape (12, k)
        Force [N] and torque about the membrane's own origin [N m]: of the loads on elements, then of those that keep their
        direction. Elements' stresses add up to nothing.
    """

    f: Matrix
    away: NDArray[np.float64]
    y: Matrix
    W: Matrix


@dataclass(frozen=True, kw_only=True)
class Sensitivities:
    """How n modes change with the damage of z zones, each alone, at first.

    Attributes
    ----------
    frequency : ndarray, shape (n, z)
        Relative change of the frequency per damage [1]. Modes of one frequency part: it is that of the parts, in order.
    strain : ndarray, shape (n, s, z)
        Change of what gauges read of the mode, ``Modes.strain``, per damage [kg^-1/2 m^-1]; not a number for modes of one
        frequency, whose shapes are not theirs alone.
    """

    frequency: Matrix
    strain: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The slowest n modes of small vibrations.

    Attributes
    ----------
    linearised : Linearised
        What vibrates, and about what.
    squares : ndarray, shape (n,)
        Squares of the angular frequencies [1/s2], increasing.
    phi : ndarray, shape (F, n)
        Shapes of what is free, of modal mass 1 kg [kg^-1/2].
    """

    linearised: Linearised
    squares: Vector
    phi: Matrix

    @property
    def frequencies(self) -> Vector:
        """Frequencies without damping [Hz], shape (n,)."""
        return np.asarray(np.sqrt(self.squares) / math.tau)

    @property
    def damping_ratios(self) -> Vector:
        """Damping over the critical one [1], shape (n,)."""
        names = [v.name for v in self.linearised.variables]
        return np.asarray(self.linearised.p[names.index("mass_damping")] / (2.0 * np.sqrt(self.squares)))

    @cached_property
    def _seen(self) -> Seen:
        return self.linearised.moved(dq=self.linearised.embedded(self.phi))

    @property
    def shapes(self) -> NDArray[np.float64]:
        """Displacements of all nodes, shape (n, N, 3), of modal mass 1 kg [kg^-1/2]."""
        return self._seen.away

    @property
    def strain(self) -> Matrix:
        """What gauges read of them, shape (n, s) [kg^-1/2 m^-1]."""
        return np.asarray(self._seen.y[: self.linearised.structure.n_sensors].T)

    @cached_property
    def participation(self) -> Matrix:
        r"""Factors :math:`\varphi^T m R`, shape (n, 6): [kg^1/2] along and [kg^1/2 m] about x, y and z."""
        known = self.linearised
        return np.asarray(self.phi.T @ (known.nodal_mass[:, None] * known.R)[known.free])

    @property
    def effective_masses(self) -> Matrix:
        """Squares of these, shape (n, 6) [kg], [kg m2]: of all modes they sum to that of what moves."""
        return self.participation**2

    @cached_property
    def moving(self) -> Matrix:
        """Mass matrix of what moves, as a rigid body about the membrane's own origin, shape (6, 6) [kg], [kg m], [kg m2]."""
        known = self.linearised
        return np.asarray(known.R.T @ (known.nodal_mass[:, None] * known.R))

    def sensitivities(self) -> Sensitivities:
        r"""Return how the modes change with damage of each zone.

        Notes
        -----
        With a prime for the derivative by the damage of one zone, that of the equilibrium included,
        :math:`(\omega^2)' = \varphi^T K' \varphi`, and the shape's from

        .. math:: (K - \omega^2 M)\,\varphi' = ((\omega^2)' M - K')\,\varphi, \qquad \varphi^T M \varphi' = 0

        after [1]_. Gas is filled anew at the pressure of the start, as where the membrane starts.

        References
        ----------
        .. [1] R. B. Nelson, AIAA Journal 14(9), 1201-1205, 1976, doi:10.2514/3.7211.
        """
        known, n = self.linearised, len(self.squares)
        zones, s = known.structure.n_zones, known.structure.n_sensors
        frequency, strain = np.zeros((n, zones)), np.full((n, s, zones), np.nan)
        if not zones:
            return Sensitivities(frequency=frequency, strain=strain)
        du = np.eye(known.u.size)[:, [i for i, v in enumerate(known.inputs) if v.name.startswith("damage[")]]
        dq = known.embedded(known.solve_refilled(known.moved(du=du).f))
        further = du, dq, known.swelling(dq)
        wide = known.modes(min(n + FURTHER, len(known.free)))  # so that no group ends before its last
        for group in np.split(
            np.arange(len(wide.squares)), np.flatnonzero(np.diff(wide.squares) > ALIKE * wide.squares[1:]) + 1
        ):
            if group[0] >= n:
                break
            phi = wide.phi[:, group]
            changed = [
                known.bent((None, np.repeat(known.embedded(v[:, None]), zones, axis=1), None), further) for v in phi.T
            ]
            parts = -np.stack([phi.T @ each.f for each in changed], axis=1).T  # of K', shape (z, group, group)
            values = np.linalg.eigvalsh((parts + np.swapaxes(parts, 1, 2)) / 2.0).T
            kept = group[group < n]
            frequency[kept] = values[: len(kept)] / (2.0 * wide.squares[kept, None])
            if len(group) == 1 and zones:
                shape = wide._turning(group[0], values * (known.M @ phi) + changed[0].f)
                strain[group[0]] = changed[0].y[:s] + known.moved(dq=known.embedded(shape)).y[:s]
        return Sensitivities(frequency=frequency, strain=strain)

    def _turning(self, i: int, forces: Matrix) -> Matrix:
        """Solve the equation of the derivatives of a shape, with the gas, shape (F, k)."""
        known = self.linearised
        border = np.column_stack([known.M @ self.phi[:, i], known.gas])
        A = scipy.sparse.bmat(
            [[known.K - self.squares[i] * known.M, border], [border.T, np.diag([0.0, -1.0])]], format="csc"
        )
        return np.asarray(splu(A).solve(np.vstack([forces, np.zeros((2, forces.shape[1]))]))[:-2])
