r"""The modified Preisach model as a CasADi function of its parameters.

Symbols: ``x`` parameters of ``parameters.py``; ``mu``, ``eta`` densities on the cells, ``nu = eta*mu``; per kernel
:math:`\tau, c` and the amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; ``f`` coefficients, ``basis @ f`` the
weights of the columns of ``stretches.py``. All are matrix expressions, so the function has a few dozen instructions and its
derivatives take milliseconds to build.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .densities import Spectrum, bin_places, elastic_field, hat_functions, modal_field, reversible_beyond
from .parameters import Block, amplitude_name, fitted_numbers, parameter_blocks
from .settings import FitSettings
from .stretches import Stretch

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PreisachModel:
    """The model of a fit.

    Attributes
    ----------
    function : casadi.Function
        ``x -> (f, g, p)``, shapes (n,) -> (K,), (G,), (S,): coefficients, what must not be negative, and what is preferred
        to be small.
    basis : scipy.sparse.csr_array, shape (columns, K)
        Weights of cells and modes for every coefficient.
    blocks : tuple of Block
        The parameters in order.
    """

    function: ca.Function
    basis: sparse.csr_array
    blocks: tuple[Block, ...]

    def weights(self, x: Vector) -> Vector:
        """Return the weights of cells and modes in the order of the columns."""
        return np.asarray(self.basis @ self.function(x)[0].full()[:, 0], dtype=float)


def preisach_model(
    settings: FitSettings, spectrum: Spectrum, stretches: tuple[Stretch, ...], rest: float | None = None
) -> PreisachModel:
    """Build the model of some stretches; ``rest`` is the offset over the output's range where it is known."""
    blocks = parameter_blocks(settings, spectrum, stretches, rest)
    ends = np.cumsum([0, *(b.size for b in blocks)]).tolist()
    x = ca.MX.sym("x", ends[-1])
    p = dict(zip((b.name for b in blocks), ca.vertsplit(x, ends), strict=True))

    seen = max(float(s.strain[s.train].max()) for s in stretches if s.train.any())
    functions, amplitudes, eta = _density(settings, p, seen)
    mu, nu = (ca.mtimes(_constant(functions), a) for a in (amplitudes, eta * amplitudes))
    line = np.triu_indices(settings.n_lines)[0]
    floor = np.where(line == 0, settings.least_spring, settings.least_weight)
    floor[np.diff(functions.tocsr().indptr) == 0] = 0.0
    parts = []
    if settings.relaxations:
        kernels = spectrum.kernels(p["log_tau"], p["c"])
        parts += [ca.mtimes(kernels, p[amplitude_name(drive)]) for drive in settings.drives]
    parts += [p[f"v{r + 1}"] for r in fitted_numbers(settings, stretches)]
    others = ca.vertcat(*parts, p["y0"])
    constraints = [mu - ca.DM(floor)]
    if settings.density == "modal":
        constraints += [eta - settings.eta[0], settings.eta[1] - eta]
    if settings.relaxations and settings.invertible:
        constraints += _steep_enough(settings, p, nu)
    soft = [b.stiffness * (p[b.name] - b.start) for b in blocks if b.stiffness > 0.0]
    if settings.density == "modal":
        soft += [settings.smoothness * p["b_mu"] * (p["m_mu"] ** 2 + p["n_mu"] ** 2)]
        if settings.elastic:
            soft += [settings.smoothness * p["b_elastic"] * ca.DM(np.arange(settings.modes) ** 2.0)]
    count = sum(int(s.train.sum()) for s in stretches)
    f = ca.vertcat(amplitudes, eta * amplitudes, others)
    function = ca.Function("model", [x], [f, ca.vertcat(*constraints), np.sqrt(count) * ca.vertcat(*soft)])
    basis = sparse.block_diag([functions, functions, sparse.eye_array(others.numel())], format="csr")
    return PreisachModel(function=function, basis=basis, blocks=blocks)


def _density(settings: FitSettings, p: dict[str, ca.MX], seen: float) -> tuple[sparse.sparray, ca.MX, ca.MX]:
    """Return functions on the cells, their amplitudes for mu, and eta: of each of them, or one for all."""
    N, places = settings.n_lines, bin_places(settings.n_lines, seen)
    if settings.density == "modal":
        mu, eta = (modal_field(p[f"b_{name}"], p[f"m_{name}"], p[f"n_{name}"], places) for name in ("mu", "eta"))
        if settings.elastic:
            mu += ca.vertcat(N * elastic_field(p["b_elastic"], places), ca.DM(mu.numel() - N, 1))
        return reversible_beyond(N, seen), mu, eta
    functions = sparse.csr_array(np.hstack(hat_functions(N, settings.n_knots)))
    return functions, ca.vertcat(p["b_mu"], p["b_elastic"]), p["eta"]


def _steep_enough(settings: FitSettings, p: dict[str, ca.MX], nu: ca.MX) -> list[ca.MX]:
    """Return by how much the elastic line falls faster than relaxation can rise, in a step of any size."""
    falling = [d for d in settings.drives if d.startswith("falling")]
    if not falling:
        return []
    N = settings.n_lines
    highest = ca.DM((np.arange(N) + 1.0) / N)
    jump = sum(ca.sum1(p[amplitude_name(d)]) * (highest if "linear" in d else ca.DM.ones(N)) for d in falling)
    return [nu[:N] - settings.least_spring - jump]


def _constant(matrix: sparse.sparray) -> ca.DM:
    return ca.DM(sparse.csc_matrix(matrix))
