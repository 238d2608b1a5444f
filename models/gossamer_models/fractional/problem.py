r"""The least squares problem of a fractional model on some records: its settings, its columns, the meaning of its solution.

Symbols: :math:`\theta` = (orders :math:`a_k`, rates :math:`p_l`, exponents :math:`q_l`); ``s`` strain over full scale [1];
``Phi`` columns of unit coefficient in the order strain, terms on the strain, terms on its quadrature (models with phases),
fading integrals (model-1), one (where the resistance at rest is fitted); ``c`` coefficients of the columns; ``A``, ``B``
those of a term on the strain and on its quadrature.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError, require
from ..fitting.records import Record, check_rest, in_equal_steps, strain_range
from ..fitting.separable import Derivative, SeparableProblem
from ..modes import PowerLawKernels
from .artifact import MODELS, FadingTerm, FractionalArtifact, FractionalTerm, ModelName, check_model
from .model import check_covered, fading_integral, memory, quadrature


@dataclass(frozen=True, kw_only=True)
class FractionalSettings:
    """How to fit.

    Attributes
    ----------
    model : {"model-1", "sub-model-1", "sub-model-2"}
        See ``FractionalArtifact``.
    terms, fading : int
        Number of fractional terms, and of fading integrals (model-1 only): N and M - N, 5 and 3 in
        Table 3.2 of the thesis.
    starts, seed : int
        Number of random starts, and the seed of the generator that draws them.
    orders, rates, exponents : tuple of float
        Bounds of :math:`a_k` [1], :math:`p_l` [1/s] and :math:`q_l` [1].
    nonnegative : bool
        True: no coefficient is negative, which makes an integral model passive; False: as in the thesis.
    restraint : float
        Penalty [1] on terms that cancel each other: on how far their sizes, root mean squares, add up to more than the
        size of the measured change. Terms of nearby orders otherwise grow without end. A term that is split in two
        costs nothing, so more terms never fit worse; terms without use get a coefficient of zero.
    most_evaluations : int
        Largest number of evaluations of the columns per start.
    shortest, longest : float
        Range of times [s] of the memory.
    """

    OPTIONS: ClassVar[dict[str, tuple[str, ...]]] = {  # what a user may choose, and the models that have it
        **dict.fromkeys(("terms", "starts", "seed"), tuple(f"fractional-{name}" for name in MODELS)),
        "fading": ("fractional-model-1",),
    }

    model: ModelName
    terms: int = 5
    fading: int = 3
    starts: int = 12
    seed: int = 0

    orders: tuple[float, float] = (0.001, 0.999)
    rates: tuple[float, float] = (1e-4, 10.0)
    exponents: tuple[float, float] = (0.1, 4.0)
    nonnegative: bool = True
    restraint: float = 0.1
    most_evaluations: int = 60
    shortest: float = 1e-4
    longest: float = 1e5

    def __post_init__(self) -> None:
        check_model(self.model)
        for name, (low, high), least, most in (
            ("orders", self.orders, 0.0, 1.0),
            ("rates", self.rates, 0.0, np.inf),
            ("exponents", self.exponents, 0.0, np.inf),
        ):
            require(
                least < low < high < most,
                f"bounds of {name} are {low:g} to {high:g}; they must increase within {least:g} to {most:g}",
            )
        require(
            self.terms > 0 and self.fading >= 0 and self.starts > 0 and self.restraint >= 0.0,
            "need one or more terms and starts, no negative number of fading integrals, and no negative restraint",
        )

    @property
    def box(self) -> tuple[Vector, Vector]:
        """Bounds of orders, rates and exponents, shape (N + 2 L,) each."""
        bounds = [self.orders] * self.terms + [self.rates] * self.n_fading + [self.exponents] * self.n_fading
        return np.array([low for low, _ in bounds]), np.array([high for _, high in bounds])

    @property
    def n_fading(self) -> int:
        """Number of fading integrals of the model."""
        return self.fading if self.model == "model-1" else 0

    @property
    def first_fading(self) -> int:
        """Place of the first fading integral among the columns."""
        return 1 + self.terms * (1 if self.model == "sub-model-1" else 2)


class FractionalColumns:
    """Terms of one model on one record.

    Parameters
    ----------
    s : ndarray, shape (m,)
        Strain over full scale [1].
    h : float
        Sampling step [s].
    rows : ndarray of bool, shape (m,)
        Samples to return.
    settings : FractionalSettings
        Model, numbers of terms and times of the memory.
    rest_fitted : bool
        Whether a constant is among the columns.
    """

    def __init__(self, s: Vector, h: float, rows: Rows, settings: FractionalSettings, *, rest_fitted: bool) -> None:
        model, kernels = settings.model, PowerLawKernels(settings.shortest, settings.longest)
        check_covered(s, h, kernels)
        self._strain, self._step, self._rows, self._rest_fitted = s, h, rows, rest_fitted
        self._n_terms, self._n_fading, self._first_fading = settings.terms, settings.n_fading, settings.first_fading
        parts = (s,) if model == "sub-model-1" else (s, quadrature(s))
        self._memories = [memory(part, h, kernels.rates, of_slope=model == "model-1")[rows] for part in parts]
        a = ca.SX.sym("a")
        g = kernels.weights(1.0 - a if model == "model-1" else a)
        self._weights = ca.Function("weights", [a], [g, ca.jacobian(g, a)])

    @property
    def count(self) -> int:
        """Number of columns."""
        return self._first_fading + self._n_fading + self._rest_fitted

    def evaluate(self, theta: Vector) -> tuple[Matrix, list[Derivative]]:
        r"""Return the columns, shape (m, n), and their derivatives by each element of :math:`\theta`, shape (N + 2 L,)."""
        N, L = self._n_terms, self._n_fading
        Phi = np.zeros((int(self._rows.sum()), self.count))
        Phi[:, 0] = self._strain[self._rows]
        by_order: list[Derivative] = []
        by_rate: list[Derivative] = []
        by_exponent: list[Derivative] = []
        for k, a in enumerate(theta[:N]):
            g, dg = (np.array(each).ravel() for each in self._weights(a))
            columns = np.arange(1 + k, self._first_fading, N)
            Phi[:, columns] = np.column_stack([memory @ g for memory in self._memories])
            by_order.append((columns, np.column_stack([memory @ dg for memory in self._memories])))
        for k, (p, q) in enumerate(zip(theta[N : N + L], theta[N + L :], strict=True)):
            column = np.array([self._first_fading + k])
            value, dp, dq = (part[self._rows, None] for part in fading_integral(self._strain, self._step, p, q))
            Phi[:, column] = value
            by_rate.append((column, dp))
            by_exponent.append((column, dq))
        if self._rest_fitted:
            Phi[:, -1] = 1.0
        return Phi, [*by_order, *by_rate, *by_exponent]


@dataclass(frozen=True)
class FractionalProblem:
    r"""A problem to solve.

    Attributes
    ----------
    settings : FractionalSettings
        Model and bounds; the range of times of the memory covers the records.
    separable : SeparableProblem
        Residuals over :math:`\theta`, with the coefficients eliminated.
    full_scale : float
        Strain [1] that the model's strain is measured in.
    scale : float
        Range [ohm] that residuals are measured in.
    rest_resistance : float
        Resistance [ohm] that changes are counted from.
    rest_fitted : bool
        Whether a constant among the columns corrects it.
    """

    settings: FractionalSettings
    separable: SeparableProblem
    full_scale: float
    scale: float
    rest_resistance: float
    rest_fitted: bool

    def artifact(self, theta: Vector) -> FractionalArtifact:
        """Return the model of a point with its best coefficients."""
        c, s = self.separable.coefficients(theta), self.settings
        return FractionalArtifact(
            model=s.model,
            direct=float(c[0]),
            terms=_terms(theta, c, s),
            fading=_fading_terms(theta, c[s.first_fading :], s),
            full_scale_strain=self.full_scale,
            resistance_change=self.scale,
            rest_resistance=self.rest_resistance + (self.scale * float(c[-1]) if self.rest_fitted else 0.0),
            shortest=s.shortest,
            longest=s.longest,
        )


def prepare(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    settings: FractionalSettings,
    full_scale: float | None,
    rest_resistance: float | None,
) -> FractionalProblem:
    """Make records ready to be fitted; arguments as of ``fit_fractional``.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    check_rest(rest_resistance)
    full_scale = strain_range(records, full_scale)
    even, rows = zip(*(in_equal_steps(*pair) for pair in zip(records, train, strict=True)), strict=True)
    steps = [float(r.time[1] - r.time[0]) for r in even]
    settings = replace(
        settings,
        shortest=min(settings.shortest, *steps),
        longest=max(settings.longest, *(h * r.time.size for h, r in zip(steps, even, strict=True))),
    )
    for record, kept in zip(even, rows, strict=True):
        _check(record, kept, settings)
    fitted = rest_resistance is None
    rest = float(even[0].resistance[0]) if rest_resistance is None else rest_resistance
    changes = [(r.resistance - rest)[kept] for r, kept in zip(even, rows, strict=True)]
    scale = max(float(np.ptp(change)) for change in changes)
    columns = [
        FractionalColumns(r.strain / full_scale, h, kept, settings, rest_fitted=fitted)
        for r, h, kept in zip(even, steps, rows, strict=True)
    ]
    weights = np.concatenate([np.full(part.size, r.weight) for part, r in zip(changes, records, strict=True)])
    separable = _separable(columns, np.concatenate(changes) / scale, weights, settings, rest_fitted=fitted)
    return FractionalProblem(settings, separable, full_scale, scale, rest, fitted)


def _separable(
    columns: list[FractionalColumns], y: Vector, weights: Vector, settings: FractionalSettings, *, rest_fitted: bool
) -> SeparableProblem:
    def evaluate(theta: Vector) -> tuple[Matrix, Callable[[], list[Derivative]]]:
        parts = [each.evaluate(theta) for each in columns]

        def derive() -> list[Derivative]:
            of_all = zip(*(derivatives for _, derivatives in parts), strict=True)
            return [(of_each[0][0], np.vstack([slope for _, slope in of_each])) for of_each in of_all]

        return np.vstack([Phi for Phi, _ in parts]), derive

    # with C_k >= 0, b_k in -1..1 leaves the sine parts free, and b_k in -2..0 the cosine parts
    nonnegative = np.full(columns[0].count, settings.nonnegative)
    if settings.model != "sub-model-1":
        first = 1 if settings.model == "model-1" else 1 + settings.terms
        nonnegative[first : first + settings.terms] = False
    restrained = np.ones(nonnegative.size, dtype=bool)
    if rest_fitted:
        nonnegative[-1] = restrained[-1] = False
    return SeparableProblem(
        evaluate, y, weights=weights, nonnegative=nonnegative, restraint=settings.restraint, restrained=restrained
    )


def _terms(theta: Vector, c: Vector, settings: FractionalSettings) -> tuple[FractionalTerm, ...]:
    """Return coefficients and phases, the phases within the bounds of the model."""
    N = settings.terms
    A, B = c[1 : 1 + N], np.zeros(N) if settings.model == "sub-model-1" else c[1 + N : 1 + 2 * N]
    sign = np.where((B if settings.model == "model-1" else A) < 0.0, -1.0, 1.0)
    phases = 2.0 / np.pi * np.arctan2(-sign * B, sign * A) + 0.0  # no negative zero
    return tuple(
        FractionalTerm(coefficient=float(C), order=float(a), phase=float(b))
        for C, a, b in zip(sign * np.hypot(A, B), theta, phases, strict=False)
    )


def _fading_terms(theta: Vector, c: Vector, settings: FractionalSettings) -> tuple[FadingTerm, ...]:
    p, q = np.split(theta[settings.terms :], 2)
    return tuple(
        FadingTerm(coefficient=float(C), rate=float(rate), exponent=float(exponent))
        for C, rate, exponent in zip(c, p, q, strict=False)
    )


def _check(record: Record, rows: Rows, settings: FractionalSettings) -> None:
    strain, resistance = record.strain[rows], record.resistance[rows]
    n_parameters = 1 + 3 * (settings.terms + settings.n_fading)
    problem = None
    if strain.size < 2 * n_parameters:
        problem = f"{strain.size} samples are too few for up to {n_parameters} parameters: give twice as many"
    elif not (np.ptp(strain) > 0.0 and np.ptp(resistance) > 0.0):
        problem = "strain or resistance is constant in the training stretch"
    require(problem is None, f"cannot fit {record.name!r}: {problem}.", DataError)
