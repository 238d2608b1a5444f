r"""Static equilibrium at the start, as part of ``init``: dynamic relaxation, or Newton's method in the plane.

Symbols: ``q`` displacements [m], ``v`` velocities [m/s], ``f`` forces [N], ``m`` masses [kg], ``h`` step [s], ``c`` damping
[1/s], ``omega`` lowest frequency in play [1/s], ``z`` q, v and f of the step before; ``K`` tangent [N/m].

Each returns the displacements and the largest force that is left, over the largest that is accepted; where that is above
one, the displacements are not a number.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..variables import Values
from .assembly import Forces, MembraneEquations, Shared
from .element import sum_at
from .setup import Load

LEVELS = 5  # at most 10^5 steps
NEWTON_STEPS = 8
# Accepted are the forces that displacements of so many units in the last place of the positions cause, as sums over elements
# round. From some step on it is more with each, for some membranes come there too slowly to be waited for: but no more than
# moves the slowest mode in play by this share of the positions, which a soft film under a small load still lacks.
SETTLED = 1e-6
FLOOR = 4.0 * np.finfo(float).eps
BEYOND = 1e4  # of use: the squared stretch from which on forces that grow excuse nothing, as in a balloon that runs away
PATIENCE, GROWTH, MOST = 5000, 10.0 ** (6.0 / 5000), 1e6  # steps; factor after each further one; as much at most
# accepted of Newton's method, over modulus * thickness * size of an element * stretch^3; round-off is 1e-16
PLANE = 1e-11
BENT = 2.0  # times the stiffness of a straight beam: that of one bent by 50 degrees at a node
_STEP = 0.9  # of the stable step


def relax(
    balance: Callable[[ca.MX], tuple[ca.MX, ca.MX, ca.MX]], q: ca.MX, mass: ca.MX, given: list[tuple[ca.MX, ca.MX]]
) -> tuple[ca.MX, ca.MX]:
    r"""Write the equilibrium that damped motion reaches from ``q``.

    Parameters
    ----------
    balance : callable
        ``balance(q) -> (f, rate, accepted)``: forces [N], zero where held, the bound of the squared highest frequency
        [1/s2], and the largest f/m [m/s2] that is accepted.
    q : casadi.MX, shape (n,)
        Where to start; stays where it is held.
    mass : casadi.MX, shape (n,)
        Masses [kg].
    given : list of (casadi.MX, casadi.MX)
        Symbols that ``balance`` depends on beside its argument, with their values.

    Returns
    -------
    casadi.MX, shape (n,)
    casadi.MX, scalar

    Notes
    -----
    Central differences with the damping :math:`c = 2\omega`, critical for the lowest mode in play, whose frequency is the
    Rayleigh quotient of the velocity, :math:`\omega^2 = -v \cdot \Delta f/(h\,v \cdot m v)`, as in [1]_. Once the forces
    are small enough, all steps that are left are skipped, so that a membrane in equilibrium costs one evaluation.

    References
    ----------
    .. [1] P. Underwood, Dynamic relaxation, in: T. Belytschko, T. J. R. Hughes (eds.), Computational Methods for Transient
       Analysis, North-Holland, 1983, 245-265.
    """
    n, symbols, values = q.numel(), [symbol for symbol, _ in given], [value for _, value in given]
    at, v, f_before = z = [ca.MX.sym(name, n) for name in ("q", "v", "f")]
    h_before, left, slack = rest = [ca.MX.sym(name) for name in ("h", "left", "slack")]
    f, rate, accepted = balance(at)
    h = 2.0 * _STEP / ca.sqrt(rate)
    energy = ca.dot(v, mass * v)
    omega2 = -ca.dot(v, f - f_before) / ca.fmax(h_before * energy, 1e-300)
    drag = h * ca.sqrt(ca.fmin(ca.fmax(omega2, 0.0), rate))
    a = f / mass
    moved = (1.0 - drag) / (1.0 + drag) * v + h / (1.0 + drag) * a
    settled = SETTLED * ca.fmax(omega2, 0.0) * ca.norm_inf(at)
    left_now = ca.norm_inf(a) / ca.fmax(accepted, ca.fmin(slack * accepted, settled))
    slack_next = ca.fmin(slack * GROWTH, MOST)
    inputs, q_next = [*z, *rest, *symbols], at + ca.if_else(left_now <= 1.0, 0.0, h) * moved
    step = ca.Function("relaxation_0", inputs, [q_next, moved, f, h, left_now, slack_next])
    kept = ca.Function("relaxation_over", inputs, [*z, *rest])
    for level in range(LEVELS):
        end = [*z, *rest]
        for _ in range(10):
            end = step.call([*end, *symbols])
        ten = ca.Function(f"relaxation_ten_{level}", inputs, end)
        unless = ca.Function.if_else(f"relaxation_unless_{level}", kept, ten)
        step = ca.Function(f"relaxation_{level + 1}", inputs, unless.call([left <= 1.0, *inputs]))
    q, _, _, _, left, _ = step.call([q, ca.MX.zeros(n), ca.MX.zeros(n), 0.0, np.inf, GROWTH**-PATIENCE, *values])
    return ca.if_else(left <= 1.0, q, float("nan")), left


def relaxed(equations: MembraneEquations, u: Values, p: Values) -> tuple[ca.MX, ca.MX]:
    """Write the equilibrium that ``relax`` finds from where the equations have their rest; as ``in_plane``."""
    by_symbol, given = _symbols(equations, u, p)
    t = equations.arrays
    return relax(lambda q: balance(equations, q, by_symbol, by_symbol), t["rest"], t["stiffness"], given)


def _symbols(equations: MembraneEquations, u: Values, p: Values) -> tuple[Values, list[tuple[ca.MX, ca.MX]]]:
    """Return symbols for inputs and parameters by name; and each, and the table of compiled code, with its value."""
    given = [(ca.MX.sym(name, value.numel()), value) for name, value in [*vars(u).items(), *vars(p).items()]]
    by_symbol = Values(**{symbol.name(): symbol for symbol, _ in given})
    return by_symbol, given if equations.column is None else [*given, (equations.column, equations.column)]


def in_plane(equations: MembraneEquations, u: Values, p: Values) -> tuple[ca.MX, ca.MX]:
    r"""Write the equilibrium of a plane membrane of equal squares without loads, Section 7.2 of the thesis.

    Parameters
    ----------
    equations : MembraneEquations
        Forces and tangent.
    u, p : SimpleNamespace
        Inputs and parameters by name.

    Returns
    -------
    casadi.MX, shape (3 M,)
    casadi.MX, scalar

    Notes
    -----
    A fixed number of Newton steps from the place where the supports take all nodes, with sparse LDL factors of the symmetric
    in-plane tangent, so that the function has no iteration that could run away and can be generated as C.
    """
    n = equations.n_q
    plane = [3 * k + axis for k in range(n // 3) for axis in (0, 1)]
    by_symbol, given = _symbols(equations, u, p)
    q = ca.MX.sym("q", n)
    shared = equations.shared(by_symbol, by_symbol, ca.MX(0.0), ca.MX(0.0)) | {"pressure": ca.MX(0.0)}
    x = equations.positions(q, by_symbol, by_symbol)
    f = equations.forces(x, shared, by_symbol, by_symbol).f[:n]
    q_next = q + 0.0
    q_next[plane] += ca.solve(tangent(equations, x, shared, by_symbol, by_symbol, axes=2), f[plane], "ldl")
    newton = ca.Function("newton", [q, *(symbol for symbol, _ in given)], [q_next])

    q = ca.MX.zeros(n)
    for _ in range(NEWTON_STEPS):
        q = newton(q, *(value for _, value in given))
    shared = equations.shared(u, p, ca.MX(0.0), ca.MX(0.0)) | {"pressure": ca.MX(0.0)}
    found = equations.forces(equations.positions(q, u, p), shared, u, p)
    size = equations.structure.elements[0].geometry.side * equations.size(p)
    accepted = PLANE * size * ca.mmax(shared["D"]) * (1.0 + ca.fmax(found.strain, 0.0)) ** 1.5
    left = ca.norm_inf(found.f[:n]) / accepted
    return ca.if_else(left <= 1.0, q, float("nan")), left


def tangent(equations: MembraneEquations, x: ca.MX, shared: Shared, u: Values, p: Values, axes: int = 3) -> ca.MX:
    """Write ``-df/dx`` [N/m] of the moving nodes along the first axes, sparse, shape (axes M, axes M)."""
    blocks, size = equations.tangents(x, shared, u, p, axes), equations.n_q // 3 * axes
    structure = equations.structure
    places = [equations.places(kind.nodes, axes) for part in (structure.elements, structure.lines) for kind in part]
    K = -sum(_assembled(each, rows, size) for each, rows in zip(blocks, places, strict=True))
    if structure.setup.springs:
        K += ca.diag(equations.spring_stiffness(p))
    mass = equations.mass(p)[: equations.n_q // 3]
    return K - sum(getattr(u, load.name) ** 2 * ca.kron(ca.diag(mass), _across(load)) for load in structure.setup.spins)


def _assembled(blocks: ca.MX, rows: NDArray[np.int64], size: int) -> ca.MX:
    """Sum square matrices of all elements, side by side, into a sparse matrix, shape (size, size), without row ``size``."""
    n, m = rows.shape
    row = np.repeat(rows.reshape(n, 1, m), m, axis=1).reshape(-1)  # CasADi stores column by column
    column = np.repeat(rows.reshape(n, m, 1), m, axis=2).reshape(-1)
    held = (row == size) | (column == size)
    key, place = np.unique(np.where(held, size**2, column * size + row), return_inverse=True)
    known = key[key < size**2]
    pattern = ca.Sparsity.triplet(size, size, (known % size).tolist(), (known // size).tolist())
    return ca.MX(pattern, sum_at(place, ca.vec(blocks), len(known) + 1)[: len(known), :])


def with_nodal_loads(equations: MembraneEquations, f: ca.MX, at: ca.MX, u: Values, p: Values) -> ca.MX:
    r"""Add what acts on nodes ``at`` their places [N]: forces that keep their direction, and centrifugal ones.

    Notes
    -----
    These are :math:`m \Omega^2 (1 - e e^T) (x - x_0)` on what moves, with e along the axis through x_0: they grow with the
    distance from it, and soften what moves across it by as much. Coriolis forces, and those of a rate that changes, are
    left out.
    """
    t = equations.arrays
    if "edge_force" in t:
        f += equations.factor(p, "tension") * t["edge_force"]
    for name in equations.structure.unit_forces:
        f += getattr(u, name) * t[f"unit_{name}"]
    moving, held = equations.parted(at)
    for load in equations.structure.setup.spins:
        centre = equations.size(p) * (np.array(load.point or (0.0, 0.0, 0.0)) - equations.structure.origin)
        away = ca.mtimes(_across(load), ca.reshape(moving, 3, -1) - ca.DM(centre))
        rate, mass = getattr(u, load.name), equations.mass(p)[: equations.n_q // 3]
        f += ca.vertcat(rate**2 * ca.vec(ca.repmat(mass.T, 3, 1) * away), ca.MX.zeros(held.numel()))
    return f


def _across(spin: Load) -> ca.DM:
    """Return the projection across the axis of a centrifugal load, shape (3, 3)."""
    e = np.array(spin.direction) / np.linalg.norm(spin.direction)
    return ca.sparsify(ca.DM(np.eye(3) - np.outer(e, e)))


def pulled(
    equations: MembraneEquations, volume: ca.MX, built_in: ca.MX, at: ca.MX, u: Values, p: Values
) -> tuple[Forces, ca.MX, ca.MX]:
    """Write what pulls at nodes ``at`` their places: what elements give, that with nodal loads [N], the gas' pressure [Pa].

    ``volume`` is that which the faces bounded at the start [m3], ``built_in`` a pressure [Pa].
    """
    setup = equations.structure.setup
    if setup.gas is None:
        found = equations.forces(at, equations.shared(u, p, built_in, ca.MX(0.0)), u, p)
        return found, with_nodal_loads(equations, found.f, at, u, p), ca.MX(0.0)
    V = equations.filled_volume(equations.volume(at), volume)
    inside = equations.filled(u) * (equations.filled_volume(volume, volume) / V) ** setup.gas.exponent
    gas = inside - setup.gas.ambient
    found = equations.forces(at, equations.shared(u, p, built_in, gas), u, p)
    found = replace(found, rate=found.rate + setup.gas.exponent * inside / V * equations.gas_mobility())
    return found, with_nodal_loads(equations, found.f, at, u, p), gas


def of_base(equations: MembraneEquations, u: Values, factor: Any = 1.0) -> ca.MX:  # noqa: ANN401
    """Write the acceleration of the base [m/s2], times a factor, for the nodes that move, shape (3 M,)."""
    a = factor * u.base_acceleration
    return ca.vec(ca.repmat(ca.vertcat(0.0, 0.0, a) if a.is_scalar() else a, 1, equations.n_q // 3))


def balance(equations: MembraneEquations, q: ca.MX, u: Values, p: Values) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Write what ``relax`` balances, at rest without the built-in pressure.

    Masses are those of the stiffnesses, so that neither a small element nor a stiff region nor ``inplane_mass`` delays the
    others. On a frame that flies the base does not accelerate.
    """
    shared = equations.shared(u, p, ca.MX(0.0), equations.gas_of_start(u))
    stiffer = ca.mmax(p.youngs_modulus / ca.DM([r.youngs_modulus for r in equations.structure.setup.regions]))
    if springs := equations.structure.setup.springs:
        drawn = ca.DM([equations.structure.setup.supports[i].stiffness for i in springs])
        stiffer = ca.fmax(stiffer, ca.mmax(p.support_stiffness / drawn))
    if equations.structure.lines:
        stiffer = BENT * ca.fmax(stiffer, 1.0)
    parts = [ca.fabs(shared[name]) for name in ("along", "across", "shear") if name in shared]
    strained = ca.mmax(sum(parts)) if parts else 0.0
    x = equations.positions(q, u, p)
    found = equations.forces(x, shared, u, p)
    f = with_nodal_loads(equations, found.f, x, u, p)[: equations.n_q]
    if hasattr(u, "base_acceleration"):
        mass = ca.vec(ca.repmat(equations.mass(p)[: equations.n_q // 3].T, 3, 1))
        f -= mass * of_base(equations, u)
    strain = ca.fmax(found.strain, 0.0)
    rate = stiffer * (1.0 + 2.0 * strain + strained)  # rho c^2 over D is below what is in brackets
    # as forces grow, and their rounding
    return equations.arrays["free"] * f, rate, FLOOR * stiffer * (1.0 + ca.fmin(strain, BEYOND)) ** 1.5 * ca.norm_inf(x)
