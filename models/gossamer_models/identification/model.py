r"""The modified Preisach model as a CasADi function of its parameters.

Symbols: ``x`` parameters of ``parameters.py``; ``mu``, ``eta`` densities on the cells, ``nu = eta*mu``; per kernel
:math:`\tau, c` and the amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; ``f`` coefficients of the columns of
``stretches.py``.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .densities import Spectrum, bin_places, elastic_field, hat_functions, modal_field
from .parameters import Block, amplitude_name, fitted_numbers, parameter_blocks
from .settings import FitSettings
from .stretches import Stretch

Vector = NDArray[np.float64]


def preisach_model(
    settings: FitSettings, spectrum: Spectrum, stretches: tuple[Stretch, ...], rest: float | None = None
) -> tuple[ca.Function, tuple[Block, ...]]:
    """Build the coefficients of all operators and the constraints as a CasADi function of the parameters.

    Returns
    -------
    model : casadi.Function
        ``x -> (f, g)``: weights of cells and modes in the order of the matrix, and what must not be negative.
    blocks : tuple of Block
        The parameters in order.
    """
    blocks = parameter_blocks(settings, spectrum, stretches, rest)
    x = ca.SX.sym("x", sum(b.size for b in blocks))
    ends = np.cumsum([0, *(b.size for b in blocks)])
    p = {b.name: x[int(a) : int(a) + b.size] for b, a in zip(blocks, ends[:-1], strict=True)}

    seen = max(float(s.strain[s.train].max()) for s in stretches if s.train.any())
    mu, eta = _fields(settings, p, bin_places(settings.n_lines, seen))
    line = np.triu_indices(settings.n_lines)[0]
    floor = np.where(line == 0, settings.least_spring, settings.least_weight)
    parts = [mu, eta * mu]
    if settings.relaxations:
        kernels = ca.horzcat(*(spectrum.kernel(p["log_tau"][j], p["c"][j]) for j in range(settings.relaxations)))
        parts += [ca.mtimes(kernels, p[amplitude_name(drive)]) for drive in settings.drives]
    parts += [p[f"v{r + 1}"] for r in fitted_numbers(settings, stretches)]
    f = ca.vertcat(*parts, p["y0"])
    constraints = [mu - ca.DM(floor)]
    if settings.density == "modal":
        constraints += [eta - settings.eta[0], settings.eta[1] - eta]
    if settings.relaxations and settings.invertible:
        constraints += _steep_enough(settings, p, eta * mu)
    soft = [b.stiffness * (p[b.name] - b.start) for b in blocks if b.stiffness > 0.0]
    if settings.density == "modal":
        soft += [settings.smoothness * p["b_mu"] * (p["m_mu"] ** 2 + p["n_mu"] ** 2)]
        if settings.elastic:
            soft += [settings.smoothness * p["b_elastic"] * ca.DM(np.arange(settings.modes) ** 2.0)]
    count = sum(int(s.train.sum()) for s in stretches)
    return ca.Function("model", [x], [f, ca.vertcat(*constraints), np.sqrt(count) * ca.vertcat(*soft)]), blocks


def _fields(settings: FitSettings, p: dict[str, ca.SX], places: Vector) -> tuple[ca.SX, ca.SX]:
    N = settings.n_lines
    if settings.density == "modal":
        fields = (modal_field(p[f"b_{name}"], p[f"m_{name}"], p[f"n_{name}"], places) for name in ("mu", "eta"))
        mu, eta = fields
        if settings.elastic:
            mu[:N] += N * elastic_field(p["b_elastic"], places)
        return mu, eta
    hats, spring = hat_functions(N, settings.n_knots)
    mu = ca.mtimes(ca.sparsify(ca.DM(hats)), p["b_mu"]) + ca.mtimes(ca.sparsify(ca.DM(spring)), p["b_elastic"])
    return mu, ca.repmat(p["eta"], mu.numel(), 1)


def _steep_enough(settings: FitSettings, p: dict[str, ca.SX], nu: ca.SX) -> list[ca.SX]:
    """Return by how much the elastic line falls faster than relaxation can rise, in a step of any size."""
    falling = [d for d in settings.drives if d.startswith("falling")]
    if not falling:
        return []
    N = settings.n_lines
    highest = ca.DM((np.arange(N) + 1.0) / N)
    jump = sum(ca.sum1(p[amplitude_name(d)]) * (highest if "linear" in d else ca.DM.ones(N)) for d in falling)
    return [nu[:N] - settings.least_spring - jump]
