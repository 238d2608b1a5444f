r"""Weights of the columns of a regression as a CasADi function of the parameters: the modified Preisach model of a fit.

Symbols: ``x`` parameters of ``parameters.py``; ``mu``, ``eta`` densities on the cells, ``nu = eta*mu``; per kernel
:math:`\tau, c` and the amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; ``f`` coefficients, ``basis @ f`` the
weights of the columns of ``regression.py``; ``p`` the parameters by the names of their blocks; wave numbers :math:`m_l, n_l`
and amplitudes :math:`b_l` [1] of the modal densities ``mu(i, j)`` and ``eta(i, j)`` [1] on bins (i, j), ``i`` counting
:math:`\alpha` and ``j <= i`` counting :math:`\beta`, numbers 1 to N; ``line`` = i - j and ``k`` = i - 1 of the same cell in
the tables. The densities are those of Eqs. (4.14) and (4.15) of the thesis; all are linear in part of their parameters. All
are matrix expressions, so the function has a few dozen instructions and its
derivatives take milliseconds to build.
"""

from contextlib import suppress
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

from ...arrays import Matrix, Vector
from ...errors import ConvergenceError
from ...modes import exponential_sum
from ..artifact import MIN_SPRING_WEIGHT, SensorArtifact
from ..drives import RelaxationTerm
from ..law import ModeBank
from .parameters import ParameterBlock, hat_functions, parameter_blocks
from .regression import Regression, Weights, relaxed
from .settings import PreisachSettings

SHORTEST, LONGEST = 1e-2, 1e4  # [s]; kernels hold between these times at least
TOLERANCES = (1e-6, 1e-5, 1e-4)  # of a kernel [1]; tried in order, the loosest is rarely needed
SMALL = 1e-6  # amplitude [1] of a term that is left out


@dataclass(frozen=True, kw_only=True)
class WeightFunction:
    """Weights of the columns, constraints and regularisation as functions of the parameters.

    Attributes
    ----------
    evaluate : casadi.Function
        ``x -> (f, constraints, soft)``, shapes (n,) -> (K,), (G,), (S,): coefficients, constraints (not negative), and
        regularisation.
    basis : scipy.sparse.csr_array, shape (columns, K)
        Weights of cells and modes for every coefficient.
    blocks : tuple of ParameterBlock
        The parameters in order.
    ends : tuple of int
        Where the parts of ``Weights`` end among the columns.
    """

    evaluate: ca.Function
    basis: sparse.csr_array
    blocks: tuple[ParameterBlock, ...]
    ends: tuple[int, ...]

    def __call__(self, x: Vector) -> Weights:
        """Return the weights for parameters, shape (n,)."""
        return Weights(*np.split(self.basis @ self.evaluate(x)[0].full()[:, 0], self.ends))


def weight_function(
    settings: PreisachSettings, regression: Regression, rest_resistance: float | None = None
) -> WeightFunction:
    """Build the weights for some records; the resistance at rest [ohm] is fitted where it is None, see ``fit_preisach``."""
    blocks = parameter_blocks(settings, regression, rest_resistance)
    x = ca.MX.sym("x", sum(b.size for b in blocks))
    p = by_block(blocks, x)

    functions, amplitudes, eta = _density(settings, p, regression.seen)
    of_cells = ca.DM(sparse.csc_matrix(functions))
    mu, nu = (ca.mtimes(of_cells, a) for a in (amplitudes, eta * amplitudes))
    line = np.triu_indices(settings.n_lines)[0]
    floor = np.where(line == 0, settings.least_slope, settings.least_weight)
    floor[np.diff(functions.tocsr().indptr) == 0] = 0.0
    parts = []
    if settings.relaxations:
        kernels = regression.kernels.weights(p["log_tau"], p["c"])
        parts += [ca.mtimes(kernels, p[drive.symbol]) for drive in settings.drives]
    if settings.earlier:
        parts += [p[f"v{r + 1}"] for r in regression.fitted]
    others = ca.vertcat(*parts, p["y0"])
    constraints = [mu - ca.DM(floor)]
    if settings.density == "modal":
        constraints += [eta - settings.eta[0], settings.eta[1] - eta]
    if settings.relaxations and settings.invertible:
        constraints += _steep_enough(settings, p, nu)
    soft = [b.stiffness * (p[b.name] - b.start) for b in blocks if b.stiffness > 0.0]
    if settings.density == "modal":
        soft += [settings.smoothness * p["b_mu"] * (p["m_mu"] ** 2 + p["n_mu"] ** 2)]
        soft += [settings.smoothness * p["b_elastic"] * ca.DM(np.arange(settings.modes) ** 2.0)]
    f = ca.vertcat(amplitudes, eta * amplitudes, others)
    function = ca.Function("model", [x], [f, ca.vertcat(*constraints), np.sqrt(regression.samples) * ca.vertcat(*soft)])
    basis = sparse.block_diag([functions, functions, sparse.eye_array(others.numel())], format="csr")
    first = regression.stretches[0]
    ends = np.cumsum([part.shape[1] for part in (first.U, first.D, first.Z, first.V)])
    return WeightFunction(evaluate=function, basis=basis, blocks=blocks, ends=tuple(ends.tolist()))


def by_block(blocks: tuple[ParameterBlock, ...], x: ca.MX | ca.DM) -> dict[str, ca.MX | ca.DM]:
    """Split parameters, shape (n,), by the names of their blocks."""
    ends = np.cumsum([0, *(b.size for b in blocks)]).tolist()
    return dict(zip((b.name for b in blocks), ca.vertsplit(x, ends), strict=True))


def _density(settings: PreisachSettings, p: dict[str, ca.MX], seen: float) -> tuple[sparse.sparray, ca.MX, ca.MX]:
    """Return functions on the cells, their amplitudes for mu, and eta: of each of them, or one for all."""
    N, places = settings.n_lines, bin_places(settings.n_lines, seen)
    if settings.density == "modal":
        mu, eta = (modal_field(p[f"b_{name}"], p[f"m_{name}"], p[f"n_{name}"], places) for name in ("mu", "eta"))
        mu += ca.vertcat(N * elastic_field(p["b_elastic"], places), ca.DM(mu.numel() - N, 1))
        return reversible_beyond(N, seen), mu, eta
    functions = sparse.csr_array(np.hstack(hat_functions(N, settings.knots)))
    return functions, ca.vertcat(p["b_mu"], p["b_elastic"]), p["eta"]


def modal_field(amplitudes: ca.MX, m: ca.MX, n: ca.MX, places: Vector) -> ca.MX:
    r"""Return a sum of modal functions on all cells, Eqs. (4.14) to (4.17) of the thesis.

    Parameters
    ----------
    amplitudes, m, n : casadi.MX, shape (M,)
        :math:`b_l` and the wave numbers :math:`m_l, n_l` [1].
    places : ndarray, shape (N,)
        Middles of the bins over the range of the modes [1], see ``bin_places``.

    Returns
    -------
    casadi.MX, shape (N (N + 1) / 2,)
        :math:`\sum_l b_l [\cos(\pi m_l i/N)\cos(\pi n_l j/N) + \cos(\pi n_l i/N)\cos(\pi m_l j/N)]` in the order of
        ``numpy.triu_indices``.

    Notes
    -----
    The diagonal of bin (i, j) is the cell of line i - j at :math:`\alpha` bin i, so bins and cells correspond one to one.
    Places i/N are taken at the middle of the bins. With the cosines as matrices :math:`C_m, C_n` of shape (N, M) the whole
    plane is :math:`S + S^T`, :math:`S = C_m\,\mathrm{diag}(b)\,C_n^T`: few operations, hence quickly differentiated ones.
    """
    line, k = np.triu_indices(places.size)
    axis = ca.DM(np.pi * places)
    cos_m, cos_n = ca.cos(ca.mtimes(axis, m.T)), ca.cos(ca.mtimes(axis, n.T))
    S = ca.mtimes(ca.mtimes(cos_m, ca.diag(amplitudes)), cos_n.T)
    return ca.vec(S + S.T)[(k + places.size * (k - line)).tolist()]


def bin_places(n_lines: int, seen: float) -> Vector:
    """Return the middles of the bins over the fitted range of strain [1], shape (N,).

    Beyond that range the result is 1, so densities keep their value at its end: the data determine nothing there.
    """
    return np.minimum((np.arange(n_lines) + 0.5) / n_lines / seen, 1.0)


def reversible_beyond(n_lines: int, seen: float) -> sparse.csr_array:
    """Return a matrix that moves the weight of lines wider than the fitted range of strain to the elastic line.

    No record within that range switches such operators down, so their hysteresis is unknown. The first loading follows
    the density, and hysteresis appears only if the data require it.

    Parameters
    ----------
    n_lines : int
        Lines of the tables.
    seen : float
        Largest strain that is fitted, over full scale [1].

    Returns
    -------
    scipy.sparse.csr_array, shape (N (N + 1) / 2, N (N + 1) / 2)
        The identity on narrower lines; wider ones are added to the cell of line 0 at the same alpha.
    """
    line, k = np.triu_indices(n_lines)
    target = np.where(line / n_lines < seen, np.arange(line.size), k)
    return sparse.csr_array((np.ones(line.size), (target, np.arange(line.size))), shape=(line.size, line.size))


def elastic_field(amplitudes: ca.MX, places: Vector) -> ca.MX:
    r"""Return :math:`\sum_l b_l \cos(\pi l \alpha)`, l = 0, 1, ..., on the bins of the elastic line, shape (N,)."""
    return ca.mtimes(ca.DM(np.cos(np.pi * np.outer(places, np.arange(amplitudes.numel())))), amplitudes)


def _steep_enough(settings: PreisachSettings, p: dict[str, ca.MX], nu: ca.MX) -> list[ca.MX]:
    """Return by how much the elastic line falls faster than relaxation can rise, in a step of any size."""
    falling = [drive for drive in settings.drives if drive.strain == "falling"]
    if not falling:
        return []
    N = settings.n_lines
    highest = ca.DM((np.arange(N) + 1.0) / N)
    jump = sum(ca.sum1(p[drive.symbol]) * highest**drive.power for drive in falling)
    return [nu[:N] - settings.least_slope - jump]


def normalised_sensor(
    settings: PreisachSettings, function: WeightFunction, x: Vector, regression: Regression
) -> tuple[SensorArtifact, float, float]:
    """Normalise the fitted weights.

    Parameters
    ----------
    settings : PreisachSettings
        How they were fitted.
    function : WeightFunction
        Weights of the fit.
    x : ndarray, shape (n,)
        Its parameters.
    regression : Regression
        The records.

    Returns
    -------
    sensor : SensorArtifact
        Normalised sensor without provenance.
    y0, rise : float
        Resistance in units of its fitted range [1] = y0 + rise * normalised output.
    """
    N = settings.n_lines
    fitted = function(x)
    tables = np.zeros((2, N, N))
    for table, part in zip(tables, (fitted.mu, fitted.nu), strict=True):
        table[np.triu_indices(N)] = np.maximum(part, 0.0)
    rise = float(tables[0].sum()) / N
    tables /= rise
    for table in tables:
        table[0] = np.maximum(table[0], MIN_SPRING_WEIGHT)
    p = {name: part.full()[:, 0] for name, part in by_block(function.blocks, ca.DM(x)).items()}
    shortest = min(SHORTEST, float(regression.kernels.times[1]))
    longest = max(LONGEST, *(2.0 * float(s.record.time[-1]) for s in regression.stretches))
    terms = []
    for j in range(settings.relaxations):
        tau, c = float(np.exp(p["log_tau"][j])), float(p["c"][j])
        used = {drive: float(p[drive.symbol][j]) / rise for drive in settings.drives}
        used = {drive: amplitude for drive, amplitude in used.items() if abs(amplitude) > SMALL}
        if not used:
            continue
        b = tau**-c
        decay_rates, weights = _exponentials(b, c, shortest, longest)
        terms += [
            RelaxationTerm(
                amplitude=amplitude,
                power=drive.power,
                rate=b,
                exponent=c,
                decay_rates=tuple(decay_rates.tolist()),
                weights=tuple(weights.tolist()),
                drive=drive.strain,
                signed=amplitude < 0.0,
                gain=drive.gain,
            )
            for drive, amplitude in used.items()
        ]
    mu, nu = (tuple(map(tuple, table.tolist())) for table in tables)
    return SensorArtifact(mu=mu, nu=nu, relaxation=tuple(terms), fading=regression.fading), float(p["y0"][0]), rise


def normalised_output(sensor: SensorArtifact, time: Vector, strain: Vector, U: Matrix, D: Matrix) -> Vector:
    """Return the normalised output [1] of a sensor over a strain that has switched U and D, shape (m,), from rest."""
    mu, nu = (table[np.triu_indices(sensor.n_lines)] for table in sensor.tables())
    output = U @ mu - D @ nu
    bank = ModeBank.of(sensor.relaxation)
    Z = relaxed(time, strain, bank.decay_rates, tuple(bank.amplitudes), sensor.fading)
    return np.asarray(output + Z @ np.concatenate([np.empty(0), *bank.amplitudes.values()]))


def _exponentials(b: float, c: float, shortest: float, longest: float) -> tuple[Vector, Vector]:
    """Return the exponentials of a kernel that meet the narrowest tolerance within reach."""
    for tolerance in TOLERANCES[:-1]:
        with suppress(ConvergenceError):
            return exponential_sum(b, c, shortest=shortest, longest=longest, tolerance=tolerance)
    return exponential_sum(b, c, shortest=shortest, longest=longest, tolerance=TOLERANCES[-1])
