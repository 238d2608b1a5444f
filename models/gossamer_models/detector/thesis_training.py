"""Train the detector of the thesis as the thesis did: on single or on multiple damage, without noise or with it.

Symbols: ``U`` packet energies, ``I`` logarithms of the damage feature indices.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Vector
from ..campaign import CampaignPlan, Damage, draw_cases
from ..campaign.chunk import build_kernels, run_chunk
from ..campaign.symmetry import mirrors
from ..errors import DataError
from .artifact import DetectorArtifact
from .features import packet_energies
from .networks import triangular_memberships
from .thesis_tables import NOISE, TABLE_7_3, ZONES, as_array

PEAKS = (0.0, 0.2, 0.4)
SCALES = np.logspace(-3.0, 1.0, 13)
BIASES = (-4.0, -2.0, 0.0, 2.0, 4.0)
RIDGES = (1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1)
SAMPLING_STEP = 3e-4
SAMPLES = 844  # two periods of the thesis' pressure: energies of a periodic response do not depend on where it starts
WINDOWS = 3  # the transient, its tail, and the periodic response
LEVELS = tuple(round(0.04 * k, 2) for k in range(1, 11))
MORE = 384  # random multiple damages of the second training, beside Table 7.3


class Networks(NamedTuple):
    """The sixteen networks of one window.

    Attributes
    ----------
    weights : ndarray, shape (n, 16)
        Distance weights W1_ij.
    bias : float
        Bias of the similarity.
    rules : ndarray, shape (k, n, 16)
        Rule weights W2.
    leave_one_out : float
        Root mean square error of the memberships [1] of each case from networks that are trained on all others.
    """

    weights: Vector
    bias: float
    rules: Vector
    leave_one_out: float


def train_networks(I: Vector, damages: Vector, levels: int, peaks: ArrayLike = PEAKS) -> Networks:
    """Train the sixteen networks of one window; the training cases are the references.

    Parameters
    ----------
    I : ndarray, shape (n, 16)
        Logarithms of the damage feature indices of the training cases: the undamaged one, some levels of damage in each
        zone alone, zone by zone, then any others.
    damages : ndarray, shape (n, 16)
        Their damages [1].
    levels : int
        Levels in each zone.
    peaks : array_like, shape (k,)
        Peaks of the fuzzy sets [1].

    Returns
    -------
    Networks
        With the least leave-one-out error.

    Notes
    -----
    W1_ij = scale / (r_j^2 d_i): r_j is how far index j strays from linear between neighbouring cases of the same zone, so
    that rough indices count less; d_i is the distance of reference i from its two nearest neighbours, so that every
    reference reaches just its surroundings. The output layer, Section 6.3 of the thesis, is a ridge regression on the
    triangular memberships. Scale, bias and ridge minimize the leave-one-out error: a residual over one minus the diagonal
    of the hat matrix, which one singular value decomposition of S gives for every ridge. The sixteen networks share the
    similarity layer; each has its own output layer.

    Raises
    ------
    DataError
        Fewer than two levels per zone, or indices without any roughness.
    """
    n, zones = damages.shape
    alone = 1 + levels * zones
    if levels < 2 or n < alone:
        msg = (
            f"there are {n} training cases; training needs the undamaged one and two or more levels in each of {zones} zones"
        )
        raise DataError(msg)
    paths = np.concatenate([np.repeat(I[None, :1], zones, axis=0), I[1:alone].reshape(zones, levels, -1)], axis=1)
    roughness = np.sqrt(np.mean((paths[:, 1:-1] - 0.5 * (paths[:, :-2] + paths[:, 2:])) ** 2, axis=(0, 1)))
    if roughness.min() <= 0.0 or not np.isfinite(roughness).all():
        advice = "Check the strains it comes from."
        msg = f"index {int(roughness.argmin()) + 1} is not finite, or linear in damage to the last bit. {advice}"
        raise DataError(msg)
    D = ((I[:, None] - I[None]) ** 2) @ roughness**-2
    reach = np.sort(D + np.diag(np.full(n, np.inf)), axis=0)[:2].mean(axis=0)
    T = triangular_memberships(damages, peaks)
    targets = T.transpose(0, 2, 1).reshape(n, -1)

    best = (np.inf, np.float64(0.0), 0.0, np.empty(0))
    with threadpool_limits(1):  # small matrices: waking other threads for them costs many times their work
        for scale, bias in itertools.product(SCALES, BIASES):
            S = 1.0 / (1.0 + np.exp(np.minimum(D * scale / reach - bias, 700.0)))
            Q, singular, Vt = np.linalg.svd(S)
            projected = Q.T @ targets
            for ridge in RIDGES:
                inverse = singular / (singular**2 + ridge**2)
                leverage = 1.0 - Q**2 @ (singular * inverse)
                if leverage.min() < 1e-9:
                    continue
                residual = targets - Q @ ((singular * inverse)[:, None] * projected)
                error = float(np.sqrt(np.mean((residual / leverage[:, None]) ** 2)))
                if error < best[0]:
                    best = (error, scale, bias, Vt.T @ (inverse[:, None] * projected))
    error, scale, bias, W2 = best
    rules = W2.reshape(n, T.shape[-1], zones).transpose(1, 0, 2)
    return Networks(scale / (roughness**2 * reach[:, None]), bias, rules, error)


@dataclass(frozen=True, kw_only=True)
class ThesisTraining:
    """One of the trainings of Section 7.7.

    Attributes
    ----------
    multiple : bool
        Whether several zones are damaged in some of the cases: the second training.
    noisy : bool
        Whether the strain has the thesis' noise.
    """

    multiple: bool = False
    noisy: bool = False


TRAININGS = {
    "single": ThesisTraining(),
    "single_noisy": ThesisTraining(noisy=True),
    "multiple": ThesisTraining(multiple=True),
    "multiple_noisy": ThesisTraining(multiple=True, noisy=True),
}


def training_cases(training: ThesisTraining) -> Vector:
    """List the cases of a training, shape (n, 16) [1].

    Returns
    -------
    ndarray
        The undamaged membrane, every one of ``LEVELS`` in every zone alone, zone by zone, and for multiple damage the cases
        of Table 7.3 with their mirror images and random ones of two to four zones.
    """
    single = np.vstack([np.zeros(ZONES), *(level * np.eye(ZONES)[zone] for zone in range(ZONES) for level in LEVELS)])
    if not training.multiple:
        return single
    listed = as_array(TABLE_7_3)
    listed = listed[(listed > 0.0).sum(axis=1) > 1]
    random = CampaignPlan(cases=MORE, seed=7, damage=Damage(zones=(2, 4), depth=(LEVELS[0], LEVELS[-1]), healthy=0.0))
    images = np.concatenate([listed[:, order] for order in next(mirrors(random.membrane.structure)).zones])
    return np.vstack([single, images, draw_cases(random, range(MORE)).damage])


def simulate_cases(damages: ArrayLike, samples: int) -> Matrix:
    """Simulate the strain histories of the default membrane from the start of its load.

    Parameters
    ----------
    damages : array_like, shape (n, 16)
        Damage of each zone [1].
    samples : int
        Number of samples; the first is taken one step after the start.

    Returns
    -------
    ndarray, shape (n, 4, samples)
        Strain along y [1].
    """
    cases = tuple({zone: float(d) for zone, d in enumerate(case, start=1)} for case in np.asarray(damages, dtype=float))
    stop = samples * SAMPLING_STEP
    campaign = CampaignPlan(step=SAMPLING_STEP, stop=stop, chunk=len(cases), damage=Damage(cases=cases))
    return np.asarray(run_chunk(campaign, build_kernels(campaign), 0)["strain"], dtype=float)


def with_noise(strains: Matrix, seed: int) -> Matrix:
    """Add the noise of the thesis to strain histories [1]."""
    return np.asarray(strains + np.random.default_rng(seed).uniform(*NOISE, strains.shape))


def window_energies(strains: ArrayLike, samples: int) -> Vector:
    """Return the packet energies of successive windows.

    Parameters
    ----------
    strains : array_like, shape (4, n)
        Strain histories [1].
    samples : int
        Samples in a window.

    Returns
    -------
    ndarray, shape (n // samples, 16)
        Energies of sensor 1 (AA, AD, DA, DD), sensor 2, ...
    """
    record = np.asarray(strains, dtype=float)
    count = record.shape[1] // samples
    windows = record[:, : count * samples].reshape(len(record), count, samples)
    return packet_energies(windows).transpose(1, 0, 2).reshape(count, -1)


def train_detector(training: ThesisTraining = TRAININGS["single"]) -> DetectorArtifact:
    """Simulate the cases of a training and train the networks of every window on them.

    Parameters
    ----------
    training : ThesisTraining
        Which one. All have more levels of damage than the thesis, 0.2 and 0.4, which is too coarse alone: the best networks
        by leave-one-out then answer about 2 % always (error 24 % over damaged zones), since between levels so far apart the
        indices are not near any reference.

    Returns
    -------
    DetectorArtifact
        The training cases are its references, as in the thesis.
    """
    damages = training_cases(training)
    strains = simulate_cases(damages, WINDOWS * SAMPLES)
    if training.noisy:
        strains = with_noise(strains, 0)
    U = np.array([window_energies(record, SAMPLES) for record in strains])
    I = np.log(U / U[0])
    trained = [train_networks(I[:, c], damages, len(LEVELS)) for c in range(WINDOWS)]
    weights, bias, rules, errors = (np.array(part) for part in zip(*trained, strict=True))
    more = f", and {len(damages) - 1 - ZONES * len(LEVELS)} cases of several zones" if training.multiple else ""
    return DetectorArtifact(
        start_time=0.0,
        sampling_step=SAMPLING_STEP,
        samples=SAMPLES,
        peaks=np.array(PEAKS),
        baseline=U[0],
        references=I.transpose(1, 0, 2),
        weights=weights,
        bias=bias,
        rules=rules,
        provenance={
            "command": "gossamer train --kind thesis",
            "cases": f"undamaged and {', '.join(f'{level:g}' for level in LEVELS)} in each of {ZONES} zones alone{more}",
            "noise": f"uniform, {NOISE[0]:g} to {NOISE[1]:g}" if training.noisy else "none",
            "leave_one_out": f"rms of memberships in windows 1 to {WINDOWS}: {', '.join(map('{:.4f}'.format, errors))}",
        },
    )
