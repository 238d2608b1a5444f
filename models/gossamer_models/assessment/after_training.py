"""Errors of a detector after its training: on held-out cases of its campaign, or on the test cases of the thesis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Matrix
from ..detector import DetectorArtifact, PosteriorArtifact, detector_model
from ..detector.posterior_records import Sensing, Training, cut_windows
from ..detector.posterior_training import split
from ..detector.thesis_tables import GROUPS
from ..detector.thesis_training import SAMPLES, simulate_cases, with_noise
from .figures import figures
from .judges import AlwaysZero, DetectorJudge, PosteriorJudge, Verdicts

if TYPE_CHECKING:
    import xarray as xr

NOISES = {"clean": "no noise", "thesis": "the thesis' noise"}
SEED = 1  # of the noise of the test cases of the thesis


def held_out_verdicts(
    artifact: PosteriorArtifact, data: xr.Dataset, training: Training
) -> dict[str, tuple[Matrix, Verdicts]]:
    """Judge the last cases of the campaign of a posterior network, which were neither trained nor calibrated on.

    Returns
    -------
    dict
        By kind of record (window, damage and noise; and for the answer "always 0"): true damage, shape (n, 16) [1], and
        verdicts.
    """
    sensing, random = Sensing.of(data), np.random.default_rng(training.seed)
    damage = data["damage"].to_numpy()
    damage = damage[damage.max(axis=1) > 0.0]
    found = {AlwaysZero.name: (damage, Verdicts(damage=0.0 * damage, valid=np.ones(len(damage), dtype=bool)))}
    for number in range(len(artifact.windows)):
        cut = cut_windows(data, number, training.samples, number == training.windows - 1, training.seed)
        test = split(cut, training)[2]
        damaged = test.damage.max(axis=1) > 0.0
        for kind, noise in NOISES.items():
            verdicts = PosteriorJudge(artifact).window(number, sensing.samples(test.records, random, kind))
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
    damage : ndarray, shape (n, 16)
        True damage [1].
    verdicts : Verdicts
        Of the same n records.

    Returns
    -------
    dict
        ``all zones`` and ``damaged zones``, mean absolute errors [% damage]; ``in 95 % band``, share of the damaged zones of
        valid records; ``valid``, ``false calls`` and ``wrong``, shares of the records; ``wrong and valid``, share of the
        wrong ones.
    """
    f = figures(damage, verdicts)
    found = {
        "all zones": f.error_all,
        "damaged zones": f.error_damaged,
        "in 95 % band": f.damaged_within_95,
        "valid": f.valid.value,
        "false calls": f.false_calls.value,
        "wrong": f.wrong.value,
        "wrong and valid": 1.0 - f.wrong_and_invalid.value,
    }
    return {name: value for name, value in found.items() if math.isfinite(value)}
