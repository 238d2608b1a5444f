r"""Sensors identified again in flight: the strain of a twin that explains a record is the reference that flight lacks.

Symbols: ``R`` measured resistance [ohm], ``c`` relative changes of the tables of a sensor's artifact [1], coefficients of
smooth fields on them; ``F`` what the fields change [ohm]; ``N`` lines of the tables, ``n`` samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear
from threadpoolctl import threadpool_limits

from ..arrays import Vector
from ..errors import DataError, ParameterError, require
from ..sensor import SensorArtifact, sensor_model
from ..sensor.artifact import Scales
from ..stepper import Stepper, simulate
from .answer import Answer
from .sensor_error import fields_of, table_features
from .simulation import SensorBank
from .weights import scale_evidence

KNOTS = 9  # of a field on a table, along its lines and across them
LEAST, MOST = -0.9, 9.0  # relative change
OFFSET = 10.0  # deviation of the offset, in units of the range of the record
TRIED = np.geomspace(1e-4, 3.0, 30)  # deviations of the relative changes
ROUNDS = 3  # of tables, about which relaxation is linear
STRETCHES = 10  # of a record, of which each is left out once
OPTIMISM = 1.4  # by which errors grow from the record to others


@dataclass(frozen=True, kw_only=True)
class Recalibrated:
    """One sensor, identified again.

    Attributes
    ----------
    artifact : SensorArtifact
        Its tables and scales; beyond the strain of the record the tables are the old ones.
    before, after : float
        How far the old and the new model are off what it reads, beside an offset, root mean square over its range [1].
    deviation : float
        Standard deviation [1] of the strain that the new one recovers: what it misses of the record, and noise, over the
        slope.
    strain : tuple of float
        Lowest and highest strain of the record [1].
    covered : float
        Share [1] of the range of the old one that the record covers.
    gain, offset : tuple of float
        What it reads over what the old one would, in changes of resistance [1], and beside that at rest [ohm]; each with its
        standard deviation, from stretches of the record that are left out.
    felt, measured, by_old, by_new : ndarray, shape (n,)
        Strain of the twin [1], resistance as measured and by the models, the new one with its offset [ohm].
    """

    artifact: SensorArtifact
    before: float
    after: float
    deviation: float
    strain: tuple[float, float]
    covered: float
    gain: tuple[float, float]
    offset: tuple[float, float]
    felt: Vector
    measured: Vector
    by_old: Vector
    by_new: Vector


def recalibrate(answer: Answer, bank: SensorBank, origin: str = "") -> dict[int, Recalibrated]:
    """Identify each sensor of a record again, from its own resistance and the strain of the twin that explains the record.

    Parameters
    ----------
    answer : Answer
        Of a record of resistance.
    bank : SensorBank
        The sensors as they were taken to be.
    origin : str
        Where the record comes from, for the provenance.

    Returns
    -------
    dict of int to Recalibrated
        By sensor, from 1; those without values are left out.

    Raises
    ------
    DataError
        The answer is not valid: a twin that does not explain the record does not know its strain.
    ParameterError
        The record holds strain.

    Notes
    -----
    Least squares of the resistance beside what the old sensor would read: an offset, and relative changes of its tables, a
    field of hat functions on each. What a field changes is linear in it; the relaxation that follows the tables is renewed
    three times. Their deviation beforehand is that of the largest evidence. Cells of the tables that the record does not
    reach stay as they were.
    """
    require(
        answer.valid, "the twin does not explain the record, so its strain is no reference. Find out why first.", DataError
    )
    require(answer.record.kind == "resistance", "a record of strain has no sensor to identify.", ParameterError)
    present = np.isfinite(answer.record.values).sum(axis=1) > answer.record.samples // 2
    found = {}
    for k in np.flatnonzero(present):
        alone = SensorBank(bank.artifact, 1, 0.0, {name: value[k] for name, value in bank.parameters.items()})
        noise = float(np.broadcast_to(answer.record.noise if answer.record.noise is not None else np.nan, present.shape)[k])
        with threadpool_limits(1):  # the same bits with any number of threads
            found[int(k) + 1] = _again(alone, answer.strain[k], answer.record.values[k], noise, answer.record.step, origin)
    return found


def _again(bank: SensorBank, strain: Vector, R: Vector, noise: float, h: float, origin: str) -> Recalibrated:
    artifact, there = bank.artifact, np.isfinite(R)
    known = _read(artifact, bank, strain, h)
    span = max(float(np.ptp(known)), np.finfo(float).tiny)
    sigma = noise if noise > 0.0 else float(np.std(np.diff(R[there]))) / np.sqrt(2.0)
    F = float(bank.parameters["full_scale_resistance_change"][0]) * table_features(bank, strain[None], KNOTS)[:, 0, there]
    A = np.vstack([F, np.full((1, there.sum()), span)]) / sigma
    free = A[:-1] - A[:-1].mean(axis=1, keepdims=True)
    bounds = np.append(np.full(len(F), LEAST), -np.inf), np.append(np.full(len(F), MOST), np.inf)
    c, model, offset = np.zeros(len(F)), artifact, 0.0
    for _ in range(ROUNDS):
        r = (R - _read(model, bank, strain, h))[there] + c @ F
        deviation = TRIED[int(np.argmax(scale_evidence(free @ free.T, free @ r / sigma, TRIED)))]
        prior = np.append(np.full(len(F), 1.0 / deviation), 1.0 / OFFSET)
        H = A @ A.T + np.diag(prior**2)  # a record has more samples than there are fields
        L = np.linalg.cholesky(H)
        solved = lsq_linear(L.T, np.linalg.solve(L, A @ r / sigma), bounds, method="bvls").x
        c, offset = solved[:-1], float(solved[-1] * span)
        model = _changed(artifact, c)
    fitted = _read(model, bank, strain, h) + offset
    before, after = ((R - each)[there] for each in (known, fitted))
    slope = np.abs(np.polyfit(strain[there], fitted[there], 1)[0])
    missed = float(np.sqrt(max(float(np.mean(after**2)), sigma**2)))
    full, rest = (float(bank.parameters[name][0]) for name in ("full_scale_strain", "rest_strain"))
    low, high = min(rest, float(strain.min())), float(strain.max())
    old = bank.parameters
    scales = Scales(
        rest_resistance=float(old["rest_resistance"][0]) + offset,
        full_scale_resistance_change=float(old["full_scale_resistance_change"][0]),
        full_scale_strain=full,
    )
    text = f"strain {low:.4g} to {high:.4g} of {full:.4g}; beyond it the tables are those of the old sensor"
    again = replace(
        model,
        scales=scales,
        inverse=None,
        compensator="inverse" if model.exactly_invertible else "filter",
        noise=sigma / scales.full_scale_resistance_change,
        error=OPTIMISM * missed / span,
        provenance={
            **artifact.provenance,
            "identified again": f"in flight, from the strain of a twin{f' of {origin}' * bool(origin)}",
            "covered": text,
            "old sensor off": f"{100.0 * before.std() / span:.3g} % of its range",
            "new sensor off": f"{100.0 * after.std() / span:.3g} % of its range",
        },
    )
    gain, displaced = _aged(known[there] - float(old["rest_resistance"][0]), (R - known)[there])
    return Recalibrated(
        artifact=again,
        before=float(before.std()) / span,
        after=float(after.std()) / span,
        deviation=OPTIMISM * missed / float(slope),
        strain=(low, high),
        covered=(high - low) / full,
        gain=gain,
        offset=displaced,
        felt=strain,
        measured=R,
        by_old=known,
        by_new=fitted,
    )


def _aged(change: Vector, beyond: Vector) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return gain and offset with deviations from what the old sensor changes by [ohm] and what is read beyond it [ohm]."""
    A, every = np.column_stack([change, np.ones(change.size)]), np.arange(change.size)
    best = np.linalg.lstsq(A, beyond, rcond=None)[0]
    kept = [np.delete(every, part) for part in np.array_split(every, STRETCHES)]
    others = [np.linalg.lstsq(A[rows], beyond[rows], rcond=None)[0] for rows in kept]
    spread = np.sqrt((STRETCHES - 1.0) * np.mean((np.array(others) - best) ** 2, axis=0))
    return (1.0 + float(best[0]), float(spread[0])), (float(best[1]), float(spread[1]))


def _changed(artifact: SensorArtifact, c: Vector) -> SensorArtifact:
    """Return a sensor whose tables have relative changes."""
    N = artifact.n_lines
    fields, (i, k) = fields_of(N, KNOTS), np.triu_indices(N)
    mu, nu = artifact.tables()
    for table, each in ((mu, c[: len(c) // 2]), (nu, c[len(c) // 2 :])):
        table[i, k] *= 1.0 + fields @ each
    return replace(artifact, mu=tuple(map(tuple, mu.tolist())), nu=tuple(map(tuple, nu.tolist())), scales=None)


def _read(artifact: SensorArtifact, bank: SensorBank, strain: Vector, h: float) -> Vector:
    """Return the resistance of one sensor [ohm], shape (n,): without compiling, which takes longer than a record."""
    sensor = Stepper(sensor_model(artifact), **{name: float(value[0]) for name, value in bank.parameters.items()})
    sensor.set("strain", float(bank.parameters["rest_strain"][0]))
    sensor.initialize()
    return simulate(sensor, np.full(strain.size, h), {"strain": strain}, ["resistance"])["resistance"]
