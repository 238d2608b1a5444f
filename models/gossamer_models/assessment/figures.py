"""Figures of merit of verdicts beside the truth.

Symbols: ``n`` records, ``z`` error in units of the stated deviation [1].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from ..arrays import Matrix, Rows, Vector
from ..detector import DetectorArtifact, PosteriorArtifact, detector_model
from ..detector.posterior_records import EXACT, Sensing, Training, cut_windows
from ..detector.posterior_training import split
from ..detector.thesis_tables import GROUPS
from ..detector.thesis_training import SAMPLES, simulate_cases, with_noise
from ..twin.answer import DETERMINED
from .judges import AlwaysZero, DetectorJudge, PosteriorJudge, Verdicts
from .pod import Share, share

if TYPE_CHECKING:
    import xarray as xr

CALL = 0.05  # [1] damage that counts as a call
OFF = 0.05  # [1] error of a zone that misleads
WRONG = 0.10  # [1] error of a zone of a wrong record
MARKED, CALLED = 3.0, 2.0  # stated deviations within which an error is marked, and by which a call is above 0
NOMINAL = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)  # central intervals of the reliability diagram
NOISES = {"clean": "no noise", "stated": "noise"}  # that of the campaign
SENSORS_OFF = "noise, sensors off"
SEED = 1  # of the noise of the test cases of the thesis


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of one judge under one condition. Not a number where they have no meaning.

    Attributes
    ----------
    records : int
        Records judged.
    error_all, error_damaged : float
        Mean absolute error over all zones and over damaged zones [% damage], invalid answers included.
    valid : Share
        Valid records.
    determined : Share
        Zones of valid records that have a value: their stated deviation is 2 points or less.
    hits : Share
        Calls among zones damaged by ``CALL`` or more, of all records; a call is a valid estimate above ``CALL`` and above
        ``CALLED`` stated deviations.
    false_calls : Share
        Records with a call in an undamaged zone.
    wrong, wrong_and_marked : Share
        Records with an error above ``WRONG`` in some zone, and those of them that say so: they are not valid, or no such
        error is above ``MARKED`` stated deviations.
    wrong_and_valid : Share
        Valid records with a zone that is determined and off by more than ``OFF`` and ``MARKED`` stated deviations.
    worst_healthy : float
        Largest error in an undamaged zone [% damage], invalid answers included.
    z_rms, damaged_z_rms : float
        Root mean square of z over all zones and over damaged zones of valid records [1].
    within_95, damaged_within_95 : float
        Share of true values in the stated 95 % interval, over all zones and over damaged zones of valid records [1].
    brier : float
        Mean square of P(damaged) minus truth, over all zones [1].
    """

    records: int
    error_all: float
    error_damaged: float
    valid: Share
    determined: Share
    hits: Share
    false_calls: Share
    wrong: Share
    wrong_and_marked: Share
    wrong_and_valid: Share
    worst_healthy: float
    z_rms: float
    damaged_z_rms: float
    within_95: float
    damaged_within_95: float
    brier: float


def figures(damage: Matrix, verdicts: Verdicts) -> Figures:
    """Compare verdicts with the truth.

    Parameters
    ----------
    damage : ndarray, shape (n, zones)
        True damage [1].
    verdicts : Verdicts
        Of the same n records.
    """
    error = np.abs(verdicts.damage - damage)
    damaged = damage > 0.0
    called = verdicts.valid[:, None] & (verdicts.damage > np.maximum(CALL, CALLED * _stated(verdicts)))
    wrong = (error > WRONG).any(axis=1)
    unmarked = np.asarray(_unmarked(damage, verdicts, WRONG).any(axis=1))
    z = np.abs(scaled_errors(damage, verdicts))
    damaged_z = z[damaged[verdicts.valid].ravel()] if z.size else z
    P = verdicts.probability
    return Figures(
        records=len(damage),
        error_all=100.0 * _mean(error),
        error_damaged=100.0 * _mean(error[damaged]),
        valid=share(verdicts.valid),
        determined=share(determined(verdicts)[verdicts.valid].ravel()),
        hits=share(called[damage >= CALL]),
        false_calls=share((called & ~damaged).any(axis=1)),
        wrong=share(wrong),
        wrong_and_marked=share(~unmarked[wrong]),
        wrong_and_valid=share((misleading(damage, verdicts)).any(axis=1)),
        worst_healthy=100.0 * float(error[~damaged].max(initial=0.0)),
        z_rms=math.sqrt(_mean(z**2)),
        damaged_z_rms=math.sqrt(_mean(damaged_z**2)),
        within_95=_mean(z <= ndtri(0.975)),
        damaged_within_95=_mean(damaged_z <= ndtri(0.975)),
        brier=math.nan if P is None else _mean((P - damaged) ** 2),
    )


def misleading(damage: Matrix, verdicts: Verdicts) -> Rows:
    """Return which zones of valid records are determined and wrong, shape (n, zones)."""
    return _unmarked(damage, verdicts, OFF) & determined(verdicts)


def _unmarked(damage: Matrix, verdicts: Verdicts, least: float) -> Rows:
    """Return which zones of valid records err by more than some damage [1] and ``MARKED`` deviations, shape (n, zones)."""
    error = np.abs(verdicts.damage - damage)
    return np.asarray(verdicts.valid[:, None] & (error > np.maximum(least, MARKED * _stated(verdicts))))


def _stated(verdicts: Verdicts) -> Matrix:
    """Return the stated deviations [1], shape (n, zones): 0, if the judge states none."""
    return np.zeros(verdicts.damage.shape) if verdicts.deviation is None else verdicts.deviation


def determined(verdicts: Verdicts) -> Rows:
    """Return which zones have a value, shape (n, zones): all, if the judge states no deviation."""
    if verdicts.deviation is None:
        return np.ones(verdicts.damage.shape, dtype=bool)
    return verdicts.deviation <= DETERMINED if verdicts.determined is None else verdicts.determined


def scores(verdicts: Verdicts) -> Matrix:
    """Return what a call is decided by, shape (n, zones): P(damaged) where it is stated, else the estimate; 0 if not valid.

    An estimate is 0 below P = 1/2, where P still tells a small damage from none.
    """
    stated = verdicts.damage if verdicts.probability is None else verdicts.probability
    return np.asarray(np.where(verdicts.valid[:, None], stated, 0.0))


def scaled_errors(damage: Matrix, verdicts: Verdicts) -> Vector:
    """Return z of all zones of valid records, in a row; empty if no deviation is stated.

    A deviation of 0 gives 0 for the right value and infinity for a wrong one.
    """
    if verdicts.deviation is None:
        return np.empty(0)
    error, deviation = (a[verdicts.valid].ravel() for a in (verdicts.damage - damage, verdicts.deviation))
    return np.divide(error, deviation, out=np.where(error == 0.0, 0.0, np.inf), where=deviation > 0.0)


def reliability(damage: Matrix, verdicts: Verdicts) -> Vector:
    """Return how many damages of valid records lie in the stated central intervals of ``NOMINAL``, shape (11,) [1].

    Undamaged zones do not count: an estimate of 0 with next to no deviation is right in every interval.
    """
    z = np.abs(scaled_errors(damage, verdicts))
    z = z[(damage > 0.0)[verdicts.valid].ravel()] if z.size else z
    return np.array([_mean(z <= ndtri(0.5 + nominal / 2.0)) for nominal in NOMINAL])


def confusion(damage: Matrix, verdicts: Verdicts, threshold: float) -> Matrix:
    """Count which zone is called first where one zone is damaged.

    Parameters
    ----------
    damage : ndarray, shape (n, zones)
        True damage [1]; records with none or several damaged zones do not count.
    verdicts : Verdicts
        Of the same n records.
    threshold : float
        Of a call, in ``scores`` [1].

    Returns
    -------
    ndarray, shape (zones, zones + 1)
        Records by damaged zone (row) and zone with the largest score (column); the last column counts those without a
        call.
    """
    single, zones = (damage > 0.0).sum(axis=1) == 1, damage.shape[1]
    score = scores(verdicts)
    found = np.where(score.max(axis=1) > threshold, score.argmax(axis=1), zones)
    counts = np.zeros((zones, zones + 1))
    np.add.at(counts, (damage[single].argmax(axis=1), found[single]), 1.0)
    return counts


def _mean(values: Matrix | Vector | Rows) -> float:
    return float(np.mean(values)) if np.size(values) else math.nan


def held_out_verdicts(
    artifact: PosteriorArtifact, data: xr.Dataset, training: Training
) -> dict[str, tuple[Matrix, Verdicts]]:
    """Judge the last cases of the campaign of a posterior network, which were neither trained nor calibrated on.

    Returns
    -------
    dict
        By kind of record (window, damage and noise; and for the answer "always 0"): true damage, shape (n, zones) [1], and
        verdicts.
    """
    sensing, random = Sensing.of(data), np.random.default_rng(training.seed)
    exact = replace(sensing, error=EXACT)
    kinds = [(noise, kind, exact) for kind, noise in NOISES.items()]
    if sensing.error != EXACT:
        kinds.append((SENSORS_OFF, "stated", replace(sensing, error=replace(sensing.error, share=1.0))))
    damage = data["damage"].to_numpy()
    damage = damage[damage.max(axis=1) > 0.0]
    found = {AlwaysZero.name: (damage, Verdicts(damage=0.0 * damage, valid=np.ones(len(damage), dtype=bool)))}
    for number in range(len(artifact.windows)):
        cut = cut_windows(data, number, training.samples, number == training.windows - 1, training.seed)
        test = split(cut, training)[2]
        damaged = test.damage.max(axis=1) > 0.0
        for noise, kind, sensors in kinds:
            verdicts = PosteriorJudge(artifact).window(number, sensors.samples(test.records, random, kind))
            for some, what in ((damaged, "damaged"), (~damaged, "healthy")):
                if some.any():
                    found[f"window {number + 1}, {what}, {noise}"] = test.damage[some], verdicts[some]
    return found


def thesis_errors(artifact: DetectorArtifact, *, noisy: bool) -> dict[str, tuple[dict[str, float], dict[str, float]]]:
    """Assess a detector on the test cases of the thesis, in their first window.

    Parameters
    ----------
    artifact : DetectorArtifact
        Trained detector.
    noisy : bool
        Whether the strain has the noise of the thesis.

    Returns
    -------
    dict
        By group of cases: the figures of the detector, and those of what the thesis prints for its own.
    """
    judge = DetectorJudge(detector_model(artifact))
    found = {}
    for what, tables, rows in GROUPS:
        strains = simulate_cases(tables.damage[rows], SAMPLES)
        verdicts = judge(with_noise(strains, SEED) if noisy else strains, artifact.sampling_step)
        printed: Matrix = (tables.noisy if noisy else tables.clean)[rows] / 100.0
        thesis = Verdicts(damage=printed, valid=np.ones(len(printed), dtype=bool))
        found[what] = errors(tables.damage[rows], verdicts), errors(tables.damage[rows], thesis)
    return found


def errors(damage: Matrix, verdicts: Verdicts) -> dict[str, float]:
    """Return those of the figures of verdicts that there are.

    Parameters
    ----------
    damage : ndarray, shape (n, zones)
        True damage [1].
    verdicts : Verdicts
        Of the same n records.

    Returns
    -------
    dict
        ``all zones`` and ``damaged zones``, mean absolute errors [% damage]; ``in 95 % band``, share of the damaged zones of
        valid records; ``valid``, ``false calls``, ``wrong`` and ``wrong and valid``, shares of the records; ``determined``,
        share of the zones of valid ones.
    """
    f = figures(damage, verdicts)
    found = {
        "all zones": f.error_all,
        "damaged zones": f.error_damaged,
        "in 95 % band": f.damaged_within_95,
        "valid": f.valid.value,
        "determined": f.determined.value,
        "false calls": f.false_calls.value,
        "wrong": f.wrong.value,
        "wrong and valid": f.wrong_and_valid.value,
    }
    return {name: value for name, value in found.items() if math.isfinite(value)}
