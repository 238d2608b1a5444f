r"""Fitted parameters in groups, with their starts, bounds and regularisation.

Symbols: wave numbers :math:`m_l, n_l` and amplitudes :math:`b_l` [1] of the modal densities, see ``weights.py``;
:math:`\log\tau` and ``c`` of the kernels and their amplitudes ``g``, ``k``; ``v`` relaxation from before a record began;
``y0`` resistance at rest.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Matrix, Vector
from ...modes import StretchedKernels
from .regression import Regression, earlier_rates
from .settings import PreisachSettings

LEAST_REST = 0.01  # of the smallest fitted output: a resistance at rest is positive
LEAST_REST_OF_RANGE = 1e-6  # of the fitted range, for signals that begin with zero
REST_STIFFNESS = 1e-2  # pull of the resistance at rest towards the first one, relative to the range


def wave_numbers(count: int) -> tuple[Vector, Vector]:
    """Return the lowest pairs m >= n of wave numbers to start from, each of shape (count,)."""
    pairs = sorted(((m, n) for m in range(count) for n in range(m + 1)), key=lambda pair: (sum(pair), pair[0]))
    chosen = np.array(pairs[:count], dtype=float)
    return chosen[:, 0], chosen[:, 1]


def hat_functions(n_lines: int, n_knots: int) -> tuple[Matrix, Matrix]:
    """Return hat functions on all cells of the triangle.

    Parameters
    ----------
    n_lines, n_knots : int
        Lines of the tables, and knots of the hats along either axis.

    Returns
    -------
    hats : ndarray, shape (N (N + 1) / 2, n_knots (n_knots + 1) / 2)
        Values [1] at the cells' middles, zero on the elastic line 0.
    spring : ndarray, shape (N (N + 1) / 2, n_knots)
        The same along the elastic line, zero elsewhere.
    """
    line, k = np.triu_indices(n_lines)

    def along(x: Vector) -> Matrix:
        return np.maximum(0.0, 1.0 - np.abs(x[:, None] * (n_knots - 1) - np.arange(n_knots)))

    alpha, beta = along((k + 0.5) / n_lines), along((k - line + 0.5) / n_lines)
    columns = []
    for a in range(n_knots):
        for b in range(a + 1):
            column = alpha[:, a] * beta[:, b]
            if b == a and a + 1 < n_knots:  # the half hat above the diagonal belongs to its foot
                column = column + alpha[:, a] * beta[:, a + 1]
            columns.append(column)
    hysteretic = (line > 0)[:, None]
    return np.array(columns).T * hysteretic, alpha * ~hysteretic


@dataclass(frozen=True, slots=True)
class ParameterBlock:
    """One group of parameters.

    Attributes
    ----------
    name : str
        Name with one index per parameter, for instance ``b_mu``.
    start, lower, upper : ndarray, shape (n,)
        Start value and bounds [1].
    linear : bool
        Whether the resistance is linear in them, everything else held.
    spread : float
        How far other starts lie from this one [1].
    stiffness : float
        Weight of the pull towards the start value, relative to the range of resistance [1].
    """

    name: str
    start: Vector
    lower: Vector
    upper: Vector
    linear: bool = False
    spread: float = 0.0
    stiffness: float = 0.0

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.start.size


def block(
    name: str,
    start: Vector,
    lower: ArrayLike = -np.inf,
    upper: ArrayLike = np.inf,
    **rest: Any,  # noqa: ANN401
) -> ParameterBlock:
    """Make a block; bounds may be the same for all parameters."""
    start, lower, upper = np.broadcast_arrays(start, lower, upper)
    return ParameterBlock(name, start, lower, upper, **rest)


def parameter_blocks(
    settings: PreisachSettings, regression: Regression, rest_resistance: float | None
) -> tuple[ParameterBlock, ...]:
    """Return all parameters in order; the resistance at rest [ohm] is one of them where it is None."""
    blocks = [*_density_blocks(settings), *_kernel_blocks(settings, regression.kernels)]
    if settings.earlier:
        n_v, lowest = earlier_rates(regression.kernels).size, -np.inf if settings.signed else 0.0
        blocks += [block(f"v{r + 1}", np.zeros(n_v), lowest, linear=True, stiffness=1e-3) for r in regression.fitted]
    if rest_resistance is None:
        first = np.array([min(float(regression.stretches[k].y[0]) for k in regression.fitted)])
        lowest = least_rest(regression)
        blocks.append(block("y0", np.maximum(first, lowest), lowest, linear=True, stiffness=REST_STIFFNESS))
    else:
        rest = rest_resistance / regression.unit
        blocks.append(block("y0", np.array([rest]), rest, rest, linear=True))
    return tuple(blocks)


def least_rest(regression: Regression) -> float:
    """Return the least resistance at rest, over the fitted range [1]: none where an output is negative, a signal's."""
    smallest = min(float(s.y[s.train].min()) for s in regression.stretches if s.train.any())
    return max(LEAST_REST * smallest, LEAST_REST_OF_RANGE) if smallest >= 0.0 else -np.inf


def _density_blocks(settings: PreisachSettings) -> list[ParameterBlock]:
    flat = min(max(1.0, settings.eta[0]), settings.eta[1])
    if settings.density == "modal":
        M = settings.modes
        m, n = wave_numbers(M)
        first = np.zeros(M)
        first[0] = flat / 2.0
        eta = (
            block("b_eta", first, -2.0, 2.0, spread=0.01, stiffness=settings.eta_stiffness),
            _waves("m_eta", m),
            _waves("n_eta", n),
        )
        return [
            block("b_mu", np.zeros(M), linear=True, stiffness=settings.density_ridge),
            _waves("m_mu", m),
            _waves("n_mu", n),
            *(replace(b, lower=b.start, upper=b.start) if settings.eta[0] == settings.eta[1] else b for b in eta),
            block("b_elastic", np.zeros(M), linear=True),
        ]
    hats, spring = hat_functions(settings.n_lines, settings.knots)
    return [
        block("b_mu", np.zeros(hats.shape[1]), linear=True, stiffness=settings.density_ridge),
        block("b_elastic", np.zeros(spring.shape[1]), linear=True, stiffness=0.1 * settings.density_ridge),
        block("eta", np.array([flat]), *settings.eta, spread=0.02, stiffness=settings.eta_stiffness),
    ]


def _waves(name: str, start: Vector) -> ParameterBlock:
    """Return wave numbers to fit; the first mode stays constant, so a positive density is always within reach."""
    return block(name, start, 0.0, np.where(np.arange(start.size) > 0, start.size, 0.0), spread=0.3, stiffness=1e-3)


def _kernel_blocks(settings: PreisachSettings, kernels: StretchedKernels) -> list[ParameterBlock]:
    P = settings.relaxations
    if not P:
        return []
    shortest, longest = np.log(0.2 / kernels.rates[-1] * 25.0), np.log(0.1 / kernels.rates[0])
    tau = np.linspace(shortest, longest, P + 2)[1:-1] if settings.tau is None else np.log(settings.tau)
    c = np.full(P, 0.8) if settings.exponents is None else np.array(settings.exponents)
    if not settings.fit_kernels:
        tau, c = np.linspace(shortest - np.log(2.0), longest - np.log(1.5), P), np.ones(P)
    bounds_tau = (shortest, longest) if settings.tau is None and settings.fit_kernels else (tau, tau)
    bounds_c = (0.25, 1.0) if settings.exponents is None and settings.fit_kernels else (c, c)
    blocks = [
        block("log_tau", tau, *bounds_tau, spread=0.5, stiffness=settings.kernel_stiffness),
        block("c", c, *bounds_c, spread=0.1, stiffness=settings.kernel_stiffness),
    ]
    for drive in settings.drives:
        lowest = -np.inf if settings.signed or drive.gain else 0.0
        blocks.append(block(drive.symbol, np.zeros(P), lowest, linear=True, stiffness=settings.relaxation_ridge))
    return blocks
