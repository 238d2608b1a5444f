r"""A sensor beside what any model must beat, with intervals of confidence from blocks of the test stretch.

That is a static cubic, and a ridge regression on lags. Symbols: ``u`` input and ``y`` output of the map, resistance and
strain in either order; ``X`` features of the regression: u, :math:`u^2`, :math:`u^3`, u at earlier samples, low-passes of u,
and the low-passes times u.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..fitting.errors import nrmse
from ..fitting.records import Record
from .trials import cut

LAGS = 20  # [samples]
LOW_PASSES = 8
RIDGES = (1e-6, 1e-4, 1e-2)
BLOCKS = 10  # of the test stretch of a record
DRAWS = 1000
CONFIDENCE = 0.9
LESS = 0.9  # of another error: below, an error is said to be less also where the intervals of confidence overlap
HERE = "this sensor"
RIVALS = ("static cubic", "regression on lags")
DOES = {"forward": "predicts the output", "strain": "recovers the strain"}  # by the quantity of a ``Standing``
Interval = tuple[float, float, float]  # value, low end, high end


def cubic(inputs: Sequence[Vector], outputs: Sequence[Vector], train: Sequence[Rows]) -> tuple[Vector, ...]:
    """Return what a cubic fitted to the training samples gives, of the shape of ``outputs``; beyond them it is held."""
    u, y = (np.concatenate([v[rows] for v, rows in zip(values, train, strict=True)]) for values in (inputs, outputs))
    low, high = float(u.min()), float(u.max())
    if not high > low:
        return tuple(np.full(v.size, float(np.mean(y))) for v in inputs)
    fitted = np.polynomial.Polynomial.fit(u, y, 3)
    return tuple(np.asarray(fitted(np.clip(v, low, high))) for v in inputs)


def regression(
    records: Sequence[Record], inputs: Sequence[Vector], outputs: Sequence[Vector], train: Sequence[Rows]
) -> tuple[Vector, ...]:
    """Return what a ridge regression fitted to the training samples gives; the later ones of them choose its ridge."""
    shortest = min(float(np.median(np.diff(r.time))) for r in records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(records, train, strict=True))
    times = np.geomspace(3.0 * shortest, 0.25 * longest, LOW_PASSES)
    X = [features_of(r.time, u, times) for r, u in zip(records, inputs, strict=True)]
    early, late = cut(train)
    errors = []
    for ridge in RIDGES:
        predicted = _ridge(X, outputs, early, ridge)
        squares = [((p - y)[rows]) ** 2 for p, y, rows in zip(predicted, outputs, late, strict=True)]
        errors.append(float(np.mean(np.concatenate(squares))))
    return _ridge(X, outputs, train, RIDGES[int(np.argmin(errors))])


def features_of(time: Vector, u: Vector, times: Vector) -> Matrix:
    """Return the features, shape (m, f), of an input at some times [s]."""
    past = np.maximum(np.arange(u.size)[:, None] - np.arange(1, LAGS + 1), 0)
    low = np.empty((u.size, times.size))
    low[0] = state = np.full(times.size, u[0])
    for k, h in enumerate(np.diff(time)):
        left = np.exp(-h / times)
        low[k + 1] = state = left * state + (1.0 - left) * u[k + 1]
    return np.column_stack([u, u**2, u**3, u[past], low, low * u[:, None]])


def _ridge(X: Sequence[Matrix], y: Sequence[Vector], train: Sequence[Rows], ridge: float) -> tuple[Vector, ...]:
    fitted = np.vstack([x[rows] for x, rows in zip(X, train, strict=True)])
    wanted = np.concatenate([v[rows] for v, rows in zip(y, train, strict=True)])
    mean, size, level = fitted.mean(axis=0), fitted.std(axis=0) + 1e-12, float(wanted.mean())
    A = (fitted - mean) / size
    w = np.linalg.solve(A.T @ A + ridge * len(A) * np.eye(A.shape[1]), A.T @ (wanted - level))
    return tuple(level + ((x - mean) / size) @ w for x in X)


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Errors of one model on the test stretch of one record.

    Attributes
    ----------
    record, model : str
        Which record, and which model: ``HERE`` or one of ``RIVALS``.
    forward, strain : tuple of float, or None
        NRMSE [% of range] of the output and of the recovered strain: the value and the ends of its interval of 90 %
        confidence; None where there is none.
    """

    record: str
    model: str
    forward: Interval | None
    strain: Interval | None


def standings(
    records: Sequence[Record], train: Sequence[Rows], predicted: Sequence[Vector], recovered: Sequence[Vector] | None
) -> tuple[Standing, ...]:
    """Return the errors of a sensor and of its rivals on every test stretch.

    Parameters
    ----------
    records : sequence of Record
        The records.
    train : sequence of ndarray of bool
        Their training samples; the rivals are fitted to the same ones.
    predicted, recovered : sequence of ndarray
        Resistance [ohm] and strain [1] that the sensor gives; recovered None if it has no compensator.
    """
    R, strain = [r.resistance for r in records], [r.strain for r in records]
    own = [k for k, rows in enumerate(train) if rows.any()]

    def fitted(u: list[Vector], y: list[Vector]) -> dict[str, dict[int, Vector]]:
        parts = [records[k] for k in own], [u[k] for k in own], [y[k] for k in own], [train[k] for k in own]
        answers = cubic(*parts[1:]), regression(*parts)
        return {name: dict(zip(own, answer, strict=True)) for name, answer in zip(RIVALS, answers, strict=True)}

    forward = {HERE: dict(enumerate(predicted))} | fitted(strain, R)
    back: dict[str, dict[int, Vector]] = {HERE: dict(enumerate(recovered or ()))} | fitted(R, strain)

    def interval(measured: Vector, given: Vector | None, rows: Rows) -> Interval | None:
        return None if given is None else error_interval(measured, given, rows)

    return tuple(
        Standing(
            record=record.name,
            model=model,
            forward=interval(R[k], forward[model].get(k), ~train[k]),
            strain=interval(strain[k], back[model].get(k), ~train[k]),
        )
        for k, record in enumerate(records)
        if not train[k].all()
        for model in (HERE, *RIVALS)
    )


def clearly_less(error: Interval, other: Interval) -> bool:
    """Whether an error is smaller than another one, and their intervals of confidence do not overlap."""
    return error[0] < other[0] and error[2] < other[1]


def beside(error: Interval, name: str, other: Interval) -> str:
    """Say how much smaller an error is than that of something by its name; nothing if it is not smaller."""
    if not error[0] < other[0]:
        return ""
    numbers = f"{error[0]:.2f} against {other[0]:.2f} % of range"
    if clearly_less(error, other):
        return f"better than {name}, {numbers}"
    if error[0] < LESS * other[0]:
        return f"with less error than {name}, {numbers}, though the intervals of confidence overlap"
    return f"as well as {name}, {numbers}: the intervals of confidence overlap"


def defeats(table: Sequence[Standing], quantities: Sequence[str] = tuple(DOES)) -> tuple[str, ...]:
    """Return a sentence for every record and quantity (keys of ``DOES``) in which the sensor is no better than a rival."""
    found = []
    for here in table:
        if here.model != HERE:
            continue
        for quantity in quantities:
            own = getattr(here, quantity)
            for other in table:
                its = getattr(other, quantity)
                if other.record == here.record and other.model in RIVALS and own and its:
                    words = beside(its, HERE, own)
                    sentence = f"{here.record}: a {other.model} {DOES[quantity]} of the test stretch {words}."
                    found += [f"{sentence} More or richer training data may change that."] * bool(words)
    return tuple(found)


def error_interval(measured: Vector, predicted: Vector, rows: Rows) -> Interval:
    """Return the NRMSE of some samples and the ends of its interval of 90 % confidence, in % of the measured range.

    Blocks of samples are drawn whole, because errors of neighbours are alike.
    """
    size = float(np.ptp(measured))
    blocks = np.array_split((predicted - measured)[rows] ** 2, BLOCKS)
    squares = np.array([block.sum() for block in blocks]), np.array([block.size for block in blocks])
    drawn = np.random.default_rng(0).integers(BLOCKS, size=(DRAWS, BLOCKS))
    errors = 100.0 * np.sqrt(squares[0][drawn].sum(axis=1) / np.maximum(squares[1][drawn].sum(axis=1), 1)) / size
    low, high = np.quantile(errors, (0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE))
    return nrmse(measured[rows], predicted[rows], size), float(low), float(high)
