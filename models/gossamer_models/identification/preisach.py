r"""Fit the modified Preisach model to records.

Symbols: ``y`` output over its range [1], ``mu``, ``eta`` densities, ``nu = eta*mu``; per kernel :math:`\tau, c` and the
amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; :math:`y_0` offset; :math:`v` what still relaxed when it began.

.. math:: y = U\mu - D\nu + Z w + e^{-\lambda t} v + y_0

with the matrices of ``regressors.py``. The output is linear in the amplitudes of mu, in g, k, v and y_0; wave numbers, eta,
:math:`\tau` and c are found by the constrained Gauss-Newton method of ``least_squares.py``. The error is that of Eq. (4.18).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, DataError, ParameterError
from ..sensor.artifact import MIN_SPRING_WEIGHT, DirectInverse, RelaxationTerm, SensorArtifact
from ..sensor.exponentials import exponential_sum
from .densities import Block, Spectrum, bin_places, block, elastic_field, hat_functions, modal_field, wave_numbers
from .least_squares import GaussNewton, Problem, Solution
from .records import Record
from .regressors import DRIVES, relaxed, switched

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Watch = Callable[[str, int, float], None]

LEAST_SAMPLES = 50
EARLIER_PER_DECADE = 2.0
REST_STIFFNESS = 1e-2  # pull of the offset towards the first output, relative to the range
INVERSE_SHORTEST, INVERSE_LONGEST = (
    0.15,
    0.25,
)  # of a sample and of the record: times of the kernels of a direct inverse
INVERSE_RELAXATIONS, INVERSE_KNOTS, INVERSE_RIDGE = 7, 6, 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    r"""How to fit.

    Attributes
    ----------
    density : {"modal", "hats"}
        Modal functions of Eqs. (4.16) and (4.17), or hat functions on a coarse grid of the triangle with an elastic line
        :math:`\alpha = \beta` of their own and one eta.
    modes, relaxations : int
        M modal functions each for mu and eta, and P kernels.
    n_lines, n_knots : int
        Lines and bins along a line of the finished tables; knots of the hat functions along each axis.
    elastic : bool
        Whether an elastic line with modes of its own is added to the modal density: operators of no width, which a smooth
        density cannot hold. The thesis' equations have none.
    drives : tuple of str
        What excites the relaxation: the thesis' rising strain, with amplitudes constant and proportional to strain, or
        falling strain too.
    signed : bool
        Whether amplitudes of relaxation may be negative.
    invertible : bool
        Whether the output must fall with falling strain in a step of any size, so that the exact inverse exists.
    direct_inverse : bool
        Whether to fit the way from output to strain too, which then replaces the exact inverse.
    earlier : bool
        Whether relaxation from before a record may still be under way when it begins.
    eta : tuple of float
        Least and largest eta [1].
    fit_kernels : bool
        False fixes all kernels: exponentials with times evenly spaced in the logarithm from a sample to the record.
    least_spring, least_weight : float
        Lower bounds of mu on the elastic line and on all others, in units of the output's range.
    smoothness, ridge, eta_stiffness, kernel_stiffness, relaxation_ridge : float
        Pulls towards a flat and a small density mu, eta = 1, the first kernels and small relaxation, relative to noise of
        the size of the output's range. A density of the elastic line is free: hysteresis has to be earned, and so does
        drift.
    tau : tuple of float or None
        Times [s] of the kernels; None to fit them.
    exponents : tuple of float or None
        Exponents c [1] of the kernels, in (0, 1]; None to fit them.
    starts, seed : int
        How many starts, and the seed of all but the first.
    most_iterations : int
        Most iterations per start.
    """

    density: Literal["modal", "hats"] = "modal"
    modes: int = 7
    relaxations: int = 7
    n_lines: int = 32
    n_knots: int = 6
    elastic: bool = True
    drives: tuple[str, ...] = DRIVES[:2]
    signed: bool = False
    invertible: bool = True
    direct_inverse: bool = False
    earlier: bool = True
    eta: tuple[float, float] = (0.5, 1.2)
    least_spring: float = 0.02
    least_weight: float = 1e-4
    smoothness: float = 3e-2
    ridge: float = 0.1
    eta_stiffness: float = 1.0
    kernel_stiffness: float = 1e-3
    relaxation_ridge: float = 1e-3
    tau: tuple[float, ...] | None = None
    exponents: tuple[float, ...] | None = None
    fit_kernels: bool = True
    starts: int = 2
    seed: int = 0
    most_iterations: int = 60

    def __post_init__(self) -> None:
        if self.modes < 1 or self.relaxations < 0 or self.starts < 1 or self.n_lines < 4:
            msg = (
                f"cannot fit {self.modes} modes, {self.relaxations} relaxations, {self.n_lines} lines from {self.starts} "
                "starts: take at least 1 mode, 0 relaxations, 4 lines and 1 start"
            )
            raise ParameterError(msg)
        for name in ("tau", "exponents"):
            values = getattr(self, name)
            if values is not None and len(values) != self.relaxations:
                msg = f"need one of {name} per relaxation: {len(values)} != {self.relaxations}"
                raise ParameterError(msg)


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A record made ready: normalised, with its matrix and the samples to fit.

    Attributes
    ----------
    record : Record
        As read.
    strain, output : ndarray, shape (m,)
        Strain over full scale [1]; output over the range of what is fitted [1].
    A : ndarray, shape (m, K)
        Matrix of ``f``.
    train : ndarray of bool, shape (m,)
        Samples to fit.
    """

    record: Record
    strain: Vector
    output: Vector
    A: Matrix
    train: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Result of a fit.

    Attributes
    ----------
    artifact : SensorArtifact
        Normalised sensor, ready to build from.
    settings : FitSettings
        How it was fitted.
    full_scale : float
        Strain [1] of the end of the range.
    offset, scale : float
        Output of a record = offset + scale * normalised output, in the record's unit.
    names : tuple of str, length n
        Names of the parameters.
    x : ndarray, shape (n,)
        Their values.
    predicted : tuple of ndarray
        Output of every record in its unit, with what was relaxing before it began.
    train : tuple of ndarray of bool
        Samples of every record that were fitted.
    solutions : tuple of Solution
        One per start; the first is the best.
    solver : GaussNewton
        For derivatives at the solution.
    blocks : tuple of Block
        Parameters by group.
    """

    artifact: SensorArtifact
    settings: FitSettings
    full_scale: float
    offset: float
    scale: float
    names: tuple[str, ...]
    x: Vector
    predicted: tuple[Vector, ...]
    train: tuple[NDArray[np.bool_], ...]
    solutions: tuple[Solution, ...]
    solver: GaussNewton
    blocks: tuple[Block, ...] = field(repr=False)


def fit_preisach(
    records: tuple[Record, ...],
    train: tuple[NDArray[np.bool_], ...],
    settings: FitSettings | None = None,
    *,
    full_scale: float | None = None,
    rest_output: float | None = None,
    watch: Watch | None = None,
) -> Fit:
    """Fit one sensor to one or several records.

    Parameters
    ----------
    records : tuple of Record
        All start at rest but for what ``settings.earlier`` allows.
    train : tuple of ndarray of bool
        Samples of each record to fit.
    settings : FitSettings or None
        None for the thesis' model.
    full_scale : float or None
        Strain [1] at the end of the range; None for the largest in the records.
    rest_output : float or None
        Output of the unstrained sensor at rest, where it is known; None to fit it.
    watch : callable, optional
        Called with the name of the start, the iteration and the root mean square error [% of range].

    Returns
    -------
    Fit
        Sensor, parameters and predictions.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    settings = settings or FitSettings()
    if rest_output is not None:
        settings = replace(settings, earlier=False)  # a sensor known to be at rest
    scale = _full_scale(records, full_scale)
    unit, spectrum, stretches = _prepare(records, train, settings, scale)
    model, blocks = preisach_model(settings, spectrum, stretches, None if rest_output is None else rest_output / unit)
    problem = _problem(model, blocks, stretches)
    solver = GaussNewton(problem)
    rows = sum(int(s.train.sum()) for s in stretches)
    rng = np.random.default_rng(settings.seed)
    solutions = []
    for k in range(settings.starts):
        start = np.concatenate([b.start + (k > 0) * b.spread * rng.normal(size=b.size) for b in blocks])
        report = None
        if watch is not None:
            name = f"start {k + 1} of {settings.starts}"
            report = lambda i, cost, name=name: watch(name, i, 100.0 * np.sqrt(2.0 * cost / rows))  # noqa: E731
        solutions.append(
            solver.minimize(np.clip(start, problem.lower, problem.upper), most=settings.most_iterations, watch=report)
        )
    solutions.sort(key=lambda s: s.cost)
    x = solutions[0].x
    artifact, y0, rise = _artifact(settings, blocks, model, x)
    if settings.direct_inverse or not settings.invertible:
        artifact = replace(artifact, inverse=_direct_inverse(stretches, y0, rise))
    coefficients = model(x)[0].full()[:, 0]
    return Fit(
        artifact=artifact,
        settings=settings,
        full_scale=scale,
        offset=y0 * unit,
        scale=rise * unit,
        names=tuple(f"{b.name}[{i + 1}]" for b in blocks for i in range(b.size)),
        x=x,
        predicted=tuple(s.A @ coefficients * unit for s in stretches),
        train=tuple(s.train for s in stretches),
        solutions=tuple(solutions),
        solver=solver,
        blocks=blocks,
    )


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
    blocks = [*_density_blocks(settings), *_kernel_blocks(settings, spectrum)]
    n_v = _earlier_rates(spectrum).size if settings.earlier else 0
    lowest = -np.inf if settings.signed else 0.0
    fitted = [k for k, s in enumerate(stretches) if s.train.any() and n_v]
    blocks += [block(f"v{r + 1}", np.zeros(n_v), lowest, np.inf, linear=True, stiffness=1e-3) for r in fitted]
    if rest is None:
        first = np.array([min(float(s.output[0]) for s in stretches if s.train.any())])
        blocks.append(block("y0", first, -np.inf, np.inf, linear=True, stiffness=REST_STIFFNESS))
    else:
        blocks.append(block("y0", np.array([rest]), rest, rest, linear=True))
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
        parts += [ca.mtimes(kernels, p[_amplitude(drive)]) for drive in settings.drives]
    parts += [p[f"v{r + 1}"] for r in fitted]
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
    return ca.Function("model", [x], [f, ca.vertcat(*constraints), np.sqrt(count) * ca.vertcat(*soft)]), tuple(blocks)


def _steep_enough(settings: FitSettings, p: dict[str, ca.SX], nu: ca.SX) -> list[ca.SX]:
    """Return by how much the elastic line falls faster than relaxation can rise, in a step of any size."""
    falling = [d for d in settings.drives if d.startswith("falling")]
    if not falling:
        return []
    N = settings.n_lines
    highest = ca.DM((np.arange(N) + 1.0) / N)
    jump = sum(ca.sum1(p[_amplitude(d)]) * (highest if "linear" in d else ca.DM.ones(N)) for d in falling)
    return [nu[:N] - settings.least_spring - jump]


def _amplitude(drive: str) -> str:
    return {"rising": "g", "rising linear": "k", "falling": "g_falling", "falling linear": "k_falling"}[drive]


def _density_blocks(settings: FitSettings) -> list[Block]:
    flat = min(max(1.0, settings.eta[0]), settings.eta[1])
    if settings.density == "modal":
        M = settings.modes
        m, n = wave_numbers(M)
        first = np.zeros(M)
        first[0] = flat / 2.0
        return [
            block("b_mu", np.zeros(M), -np.inf, np.inf, linear=True, stiffness=settings.ridge),
            _waves("m_mu", m),
            _waves("n_mu", n),
            block("b_eta", first, -2.0, 2.0, spread=0.01, stiffness=settings.eta_stiffness),
            _waves("m_eta", m),
            _waves("n_eta", n),
            *([block("b_elastic", np.zeros(M), -np.inf, np.inf, linear=True)] if settings.elastic else []),
        ]
    hats, spring = hat_functions(settings.n_lines, settings.n_knots)
    return [
        block("b_mu", np.zeros(hats.shape[1]), -np.inf, np.inf, linear=True, stiffness=settings.ridge),
        block("b_elastic", np.zeros(spring.shape[1]), -np.inf, np.inf, linear=True, stiffness=0.1 * settings.ridge),
        block("eta", np.array([flat]), *settings.eta, spread=0.02, stiffness=settings.eta_stiffness),
    ]


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
    lowest = -np.inf if settings.signed else 0.0
    ridge = settings.relaxation_ridge
    return blocks + [
        block(_amplitude(drive), np.zeros(P), lowest, np.inf, linear=True, stiffness=ridge) for drive in settings.drives
    ]


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


def _full_scale(records: tuple[Record, ...], full_scale: float | None) -> float:
    largest = max(float(r.strain.max()) for r in records)
    if full_scale is None:
        return largest
    for r in records:
        beyond = np.flatnonzero((r.strain > full_scale) | (r.strain < 0.0))
        if beyond.size:
            k = int(beyond[0])
            msg = (
                f"{r.name}, line {r.lines[k]}: strain {r.strain[k]:g} is outside 0 to full scale {full_scale:g}. Raise the "
                "full scale or leave the samples out."
            )
            raise DataError(msg)
    return full_scale


def _earlier_rates(spectrum: Spectrum) -> Vector:
    low, high = np.log10(spectrum.rates[[0, -1]])
    low, high = low + 1.2, high - 0.7
    return np.logspace(low, high, max(2, round((high - low) * EARLIER_PER_DECADE) + 1))


def _prepare(
    records: tuple[Record, ...], train: tuple[NDArray[np.bool_], ...], settings: FitSettings, full_scale: float
) -> tuple[float, Spectrum, tuple[Stretch, ...]]:
    fitted = [r.output[rows] for r, rows in zip(records, train, strict=True)]
    count = sum(part.size for part in fitted)
    unit = float(np.ptp(np.concatenate(fitted))) if count else 0.0
    if count < LEAST_SAMPLES or not unit > 0.0:
        msg = f"{count} samples to fit, output range {unit:g}: need {LEAST_SAMPLES} or more of a changing output"
        raise DataError(msg)
    shortest = min(float(np.median(np.diff(r.time))) for r in records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(records, train, strict=True) if rows.any())
    spectrum = Spectrum.over(shortest, longest)
    stretches = []
    for k, (r, rows) in enumerate(zip(records, train, strict=True)):
        s = np.clip(r.strain / full_scale, 0.0, 1.0)
        up, down = switched(s, settings.n_lines)
        columns = [up, -down]
        if settings.relaxations:
            columns.append(relaxed(r.time, s, spectrum.rates, settings.drives))
        if settings.earlier:
            decays = np.exp(-np.outer(r.time - r.time[0], _earlier_rates(spectrum)))
            columns += [decays * (k == j) for j in range(len(records)) if train[j].any()]
        columns.append(np.ones((s.size, 1)))
        stretches.append(Stretch(record=r, strain=s, output=r.output / unit, A=np.hstack(columns), train=rows))
    return unit, spectrum, tuple(stretches)


def _problem(model: ca.Function, blocks: tuple[Block, ...], stretches: tuple[Stretch, ...]) -> Problem:
    rows = [(s.A[s.train], s.output[s.train], np.sqrt(s.record.weight)) for s in stretches]
    return Problem(
        A=np.vstack([A * w for A, _, w in rows]),
        b=np.concatenate([b * w for _, b, w in rows]),
        model=model,
        linear=np.concatenate([np.full(b.size, b.linear) for b in blocks]),
        lower=np.concatenate([b.lower for b in blocks]),
        upper=np.concatenate([b.upper for b in blocks]),
    )


def _artifact(
    settings: FitSettings, blocks: tuple[Block, ...], model: ca.Function, x: Vector
) -> tuple[SensorArtifact, float, float]:
    """Normalise the fitted weights; return the sensor, the offset and the scale in units of the output's range."""
    N = settings.n_lines
    cells = N * (N + 1) // 2
    coefficients = model(x)[0].full()[:, 0]
    tables = np.zeros((2, N, N))
    for table, part in zip(tables, (coefficients[:cells], coefficients[cells : 2 * cells]), strict=True):
        table[np.triu_indices(N)] = np.maximum(part, 0.0)
    rise = float(tables[0].sum()) / N
    tables /= rise
    for table in tables:
        np.fill_diagonal(table, table.diagonal())
        table[0] = np.maximum(table[0], MIN_SPRING_WEIGHT)
    ends = np.cumsum([0, *(b.size for b in blocks)])
    p = {b.name: x[a : a + b.size] for b, a in zip(blocks, ends[:-1], strict=True)}
    terms = []
    for j in range(settings.relaxations):
        tau, c = float(np.exp(p["log_tau"][j])), float(p["c"][j])
        used = {d: float(p[_amplitude(d)][j]) / rise for d in settings.drives}
        if not any(abs(a) > 1e-6 for a in used.values()):
            continue
        b = tau**-c
        decay_rates, weights = _exponentials(b, c)
        terms += [
            RelaxationTerm(
                amplitude=amplitude,
                power=int("linear" in drive),
                rate=b,
                exponent=c,
                decay_rates=tuple(decay_rates.tolist()),
                weights=tuple(weights.tolist()),
                drive=drive.split()[0],
                signed=amplitude < 0.0,
            )
            for drive, amplitude in used.items()
            if abs(amplitude) > 1e-6
        ]
    mu, nu = (tuple(map(tuple, table.tolist())) for table in tables)
    return SensorArtifact(mu=mu, nu=nu, relaxation=tuple(terms)), float(p["y0"][0]), rise


def _direct_inverse(stretches: tuple[Stretch, ...], y0: float, rise: float) -> DirectInverse:
    """Fit the operators from output to strain, on the training stretches."""
    fitted = [s for s in stretches if s.train.any()]
    outputs = [(s.output - y0) / rise for s in fitted]
    lowest = min(float(v[s.train].min()) for v, s in zip(outputs, fitted, strict=True))
    highest = max(float(v[s.train].max()) for v, s in zip(outputs, fitted, strict=True))
    turned = tuple(
        replace(s.record, strain=np.clip((v - lowest) / (highest - lowest), 0.0, 1.0), output=s.strain)
        for v, s in zip(outputs, fitted, strict=True)
    )
    shortest = min(float(np.median(np.diff(r.time))) for r in turned)
    longest = max(float(np.ptp(r.time[s.train])) for r, s in zip(turned, fitted, strict=True))
    tau = np.geomspace(INVERSE_SHORTEST * shortest, INVERSE_LONGEST * longest, INVERSE_RELAXATIONS)
    settings = FitSettings(
        density="hats",
        n_knots=INVERSE_KNOTS,
        relaxations=tau.size,
        tau=tuple(tau.tolist()),
        exponents=(1.0,) * tau.size,
        drives=DRIVES,
        signed=True,
        earlier=False,
        eta=(1.0, 1.0),
        ridge=INVERSE_RIDGE,
        relaxation_ridge=INVERSE_RIDGE,
        least_spring=MIN_SPRING_WEIGHT,
        least_weight=0.0,
        starts=1,
    )
    found = fit_preisach(turned, tuple(s.train for s in fitted), settings, full_scale=1.0)
    law = found.artifact
    return DirectInverse(law=law, lowest=lowest, highest=highest, offset=found.offset, scale=found.scale)


def _exponentials(b: float, c: float) -> tuple[Vector, Vector]:
    """Return the exponentials of a kernel; close to c = 1 they meet a wider tolerance only."""
    try:
        return exponential_sum(b, c)
    except ConvergenceError:
        return exponential_sum(b, c, tolerance=1e-4)


def with_provenance(fit: Fit, provenance: dict[str, str]) -> Fit:
    """Return the fit with a provenance in its artifact."""
    return replace(fit, artifact=replace(fit.artifact, provenance=provenance))
