r"""A sensor beside what any model must beat, with intervals of confidence from blocks of the test stretch.

That is a static cubic, a ridge regression on lags and, of strain, a perceptron on the same and a recurrent network, each as
late as the sensor's compensator. Symbols: ``u`` input and ``y`` output of the map, resistance and
strain in either order; ``X`` features of the regression: u, :math:`u^2`, :math:`u^3`, u at earlier samples, low-passes of u,
and the low-passes times u.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..fitting.errors import nrmse
from ..fitting.records import Record, cut
from ..replay import Recovered
from .rivals import perceptron, recurrent

LAGS = 20  # [samples]
LOW_PASSES = 8
RIDGES = (1e-6, 1e-4, 1e-2)
BLOCKS = 10  # of the test stretch of a record
DRAWS = 1000
CONFIDENCE = 0.9
LESS = 0.9  # of another error: below, an error is said to be less also where the intervals of confidence overlap
HERE = "this sensor"
NOW = "this sensor, without delay"
RIVALS = ("static cubic", "regression on lags", "perceptron on lags", "recurrent network")
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


def networks(
    records: Sequence[Record], inputs: Sequence[Vector], outputs: Sequence[Vector], train: Sequence[Rows], late: int
) -> tuple[tuple[Vector, ...], tuple[Vector, ...]]:
    """Return what a perceptron on lags and a recurrent network give; see ``regression``."""
    u, y = (np.concatenate([v[rows] for v, rows in zip(values, train, strict=True)]) for values in (inputs, outputs))
    low, size = (float(u.min()), float(y.min())), (float(np.ptp(u)) or 1.0, float(np.ptp(y)) or 1.0)
    inputs = [(each - low[0]) / size[0] for each in inputs]
    wanted = [np.roll((each - low[1]) / size[1], late) for each in outputs]
    rows = [_known(each, late) for each in train]
    times = _times(records, train)
    X = [features_of(r.time, u, times, late) for r, u in zip(records, inputs, strict=True)]

    def trained(values: Sequence[Vector]) -> Vector:
        return np.concatenate([each[known] for each, known in zip(values, rows, strict=True)])

    static, moving = perceptron(trained(X), trained(wanted)), recurrent(trained(inputs), trained(wanted))
    return (
        tuple(low[1] + size[1] * _earlier(static(each), late) for each in X),
        tuple(low[1] + size[1] * _earlier(moving(each), late) for each in inputs),
    )


def regression(
    records: Sequence[Record], inputs: Sequence[Vector], outputs: Sequence[Vector], train: Sequence[Rows], late: int = 0
) -> tuple[Vector, ...]:
    """Return what a ridge regression fitted to the training samples gives; the later ones of them choose its ridge.

    It may give an output so many samples ``late``, knowing the inputs since; the delay is taken back.
    """
    times = _times(records, train)
    X = [features_of(r.time, u, times, late) for r, u in zip(records, inputs, strict=True)]
    outputs, train = [np.roll(each, late) for each in outputs], [_known(rows, late) for rows in train]
    early, held = cut(train)
    errors = []
    for ridge in RIDGES:
        predicted = _ridge(X, outputs, early, ridge)
        squares = [((p - y)[rows]) ** 2 for p, y, rows in zip(predicted, outputs, held, strict=True)]
        errors.append(float(np.mean(np.concatenate(squares))))
    return tuple(_earlier(each, late) for each in _ridge(X, outputs, train, RIDGES[int(np.argmin(errors))]))


def _times(records: Sequence[Record], train: Sequence[Rows]) -> Vector:
    """Return the times of low-passes [s]."""
    shortest = min(float(np.median(np.diff(r.time))) for r in records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(records, train, strict=True))
    return np.geomspace(3.0 * shortest, 0.25 * longest, LOW_PASSES)


def _known(rows: Rows, late: int) -> Rows:
    """Return the training samples at which an output that is so many samples old is one too."""
    return rows & np.roll(rows, late) & (np.arange(rows.size) >= late)


def _earlier(values: Vector, late: int) -> Vector:
    """Return values that are so many samples late at the samples that they are of; the last ones stay what they were."""
    return values[np.minimum(np.arange(values.size) + late, values.size - 1)]


def features_of(time: Vector, u: Vector, times: Vector, late: int = 0) -> Matrix:
    """Return the features, shape (m, f), of an input at some times [s], for an output that is so many samples old."""
    past = np.maximum(np.arange(u.size)[:, None] - np.arange(1, LAGS + late + 1), 0)
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
        Which record, and which model: ``HERE``, ``NOW`` or one of ``RIVALS``.
    forward, strain : tuple of float, or None
        NRMSE [% of range] of the output and of the recovered strain: the value and the ends of its interval of 90 %
        confidence; None where there is none.
    """

    record: str
    model: str
    forward: Interval | None
    strain: Interval | None


def standings(
    records: Sequence[Record], train: Sequence[Rows], predicted: Sequence[Vector], recovered: Sequence[Recovered]
) -> tuple[Standing, ...]:
    """Return the errors of a sensor and of its rivals on every test stretch.

    Parameters
    ----------
    records : sequence of Record
        The records.
    train : sequence of ndarray of bool
        Their training samples; the rivals are fitted to the same ones.
    predicted : sequence of ndarray
        Resistance [ohm] that the sensor gives.
    recovered : sequence of Recovered
        Strain that its compensator recovers; empty if it has none.
    """
    if all(rows.all() for rows in train):
        return ()
    R, strain = [r.resistance for r in records], [r.strain for r in records]
    own = [k for k, rows in enumerate(train) if rows.any()]
    late = max((found.late(record) for found, record in zip(recovered, records, strict=False)), default=0)

    def fitted(u: list[Vector], y: list[Vector], late: int) -> dict[str, dict[int, Vector]]:
        parts = [records[k] for k in own], [u[k] for k in own], [y[k] for k in own], [train[k] for k in own]
        answers = [cubic(*parts[1:]), regression(*parts, late)]
        if y is strain and recovered:
            answers += networks(*parts, late)
        return {name: dict(zip(own, answer, strict=True)) for name, answer in zip(RIVALS, answers, strict=False)}

    forward = {HERE: dict(enumerate(predicted))} | fitted(strain, R, 0)
    back = {HERE: dict(enumerate(each.strain for each in recovered))}
    back |= {NOW: dict(enumerate(each.present for each in recovered))} if late else {}
    back |= fitted(R, strain, late)

    def interval(measured: Vector, given: Vector | None, rows: Rows) -> Interval | None:
        return None if given is None else error_interval(measured, given, rows)

    return tuple(
        Standing(
            record=record.name,
            model=model,
            forward=interval(R[k], forward.get(model, {}).get(k), ~train[k]),
            strain=interval(strain[k], back[model].get(k), ~train[k] & (np.arange(train[k].size) < train[k].size - late)),
        )
        for k, record in enumerate(records)
        if not train[k].all()
        for model in (HERE, NOW, *RIVALS)
        if model in back
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
