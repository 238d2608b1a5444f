r"""What is fitted: groups of parameters with their starts, bounds and pulls.

Symbols: wave numbers ``m``, ``n`` and amplitudes ``b`` of the modal densities mu and eta; :math:`\log\tau` and ``c`` of the
kernels and their amplitudes ``g``, ``k``; ``v`` what still relaxed when a record began; ``y0`` offset.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .densities import Spectrum, hat_functions, wave_numbers
from .regressors import GAIN
from .settings import FitSettings
from .stretches import Stretch, earlier_rates

Vector = NDArray[np.float64]

REST_STIFFNESS = 1e-2  # pull of the offset towards the first output, relative to the range


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One group of parameters.

    Attributes
    ----------
    name : str
        Name with one index per parameter, for instance ``b_mu``.
    start, lower, upper : ndarray, shape (n,)
        Start value and bounds [1].
    linear : bool
        Whether the output is linear in them, everything else held.
    spread : float
        How far other starts lie from this one [1].
    stiffness : float
        Weight of the pull towards the start value, relative to the output's range [1].
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
    lower: float,
    upper: float,
    *,
    linear: bool = False,
    spread: float = 0.0,
    stiffness: float = 0.0,
) -> Block:
    """Make a block with the same bounds for every parameter."""
    n = start.size
    return Block(
        name=name,
        start=start,
        lower=np.full(n, lower),
        upper=np.full(n, upper),
        linear=linear,
        spread=spread,
        stiffness=stiffness,
    )


def parameter_blocks(
    settings: FitSettings, spectrum: Spectrum, stretches: tuple[Stretch, ...], rest: float | None = None
) -> tuple[Block, ...]:
    """Return all parameters in order; ``rest`` is the offset over the output's range where it is known."""
    blocks = [*_density_blocks(settings), *_kernel_blocks(settings, spectrum)]
    n_v = earlier_rates(spectrum).size if settings.earlier else 0
    lowest = -np.inf if settings.signed else 0.0
    fitted = fitted_numbers(settings, stretches)
    blocks += [block(f"v{r + 1}", np.zeros(n_v), lowest, np.inf, linear=True, stiffness=1e-3) for r in fitted]
    if rest is None:
        first = np.array([min(float(s.output[0]) for s in stretches if s.train.any())])
        blocks.append(block("y0", first, -np.inf, np.inf, linear=True, stiffness=REST_STIFFNESS))
    else:
        blocks.append(block("y0", np.array([rest]), rest, rest, linear=True))
    return tuple(blocks)


def fitted_numbers(settings: FitSettings, stretches: tuple[Stretch, ...]) -> list[int]:
    """Return the numbers of the records for which earlier relaxation is fitted."""
    return [k for k, s in enumerate(stretches) if s.train.any() and settings.earlier]


def amplitude_name(drive: str) -> str:
    """Return the name of a drive's amplitudes."""
    return {"rising": "g", "rising linear": "k", "falling": "g_falling", "falling linear": "k_falling", GAIN: "gain"}[
        drive
    ]


def _density_blocks(settings: FitSettings) -> list[Block]:
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
            block("b_mu", np.zeros(M), -np.inf, np.inf, linear=True, stiffness=settings.ridge),
            _waves("m_mu", m),
            _waves("n_mu", n),
            *(_fixed(b) if settings.eta[0] == settings.eta[1] else b for b in eta),
            *([block("b_elastic", np.zeros(M), -np.inf, np.inf, linear=True)] if settings.elastic else []),
        ]
    hats, spring = hat_functions(settings.n_lines, settings.n_knots)
    return [
        block("b_mu", np.zeros(hats.shape[1]), -np.inf, np.inf, linear=True, stiffness=settings.ridge),
        block("b_elastic", np.zeros(spring.shape[1]), -np.inf, np.inf, linear=True, stiffness=0.1 * settings.ridge),
        block("eta", np.array([flat]), *settings.eta, spread=0.02, stiffness=settings.eta_stiffness),
    ]


def _fixed(b: Block) -> Block:
    """Return the block with its start values for bounds."""
    return replace(b, lower=b.start, upper=b.start)


def _waves(name: str, start: Vector) -> Block:
    """Return wave numbers to fit; the first mode stays constant, so a positive density is always within reach."""
    upper = np.full(start.size, float(start.size))
    upper[0] = 0.0
    return Block(name=name, start=start, lower=np.zeros(start.size), upper=upper, spread=0.3, stiffness=1e-3)


def _kernel_blocks(settings: FitSettings, spectrum: Spectrum) -> list[Block]:
    P = settings.relaxations
    if not P:
        return []
    shortest, longest = np.log(0.2 / spectrum.rates[-1] * 25.0), np.log(0.1 / spectrum.rates[0])
    tau = np.linspace(shortest, longest, P + 2)[1:-1] if settings.tau is None else np.log(settings.tau)
    c = np.full(P, 0.8) if settings.exponents is None else np.array(settings.exponents)
    if not settings.fit_kernels:
        tau, c = np.linspace(shortest - np.log(2.0), longest - np.log(1.5), P), np.ones(P)
    low_t, high_t = (shortest, longest) if settings.tau is None and settings.fit_kernels else (tau, tau)
    low_c, high_c = (0.25, 1.0) if settings.exponents is None and settings.fit_kernels else (c, c)
    stiffness = settings.kernel_stiffness
    blocks = [
        Block(
            name="log_tau", start=tau, lower=low_t + 0 * tau, upper=high_t + 0 * tau, spread=0.5, stiffness=stiffness
        ),
        Block(name="c", start=c, lower=low_c + 0 * c, upper=high_c + 0 * c, spread=0.1, stiffness=stiffness),
    ]
    ridge = settings.relaxation_ridge
    for drive in settings.drives:
        lowest = -np.inf if settings.signed or drive == GAIN else 0.0
        blocks.append(block(amplitude_name(drive), np.zeros(P), lowest, np.inf, linear=True, stiffness=ridge))
    return blocks
