"""Conditions that judges are put to: what is simulated, and how the sensors read it.

Every condition is a campaign, so its cases are a function of seed and number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Literal

import numpy as np

from .. import campaign as campaigns
from ..arrays import Matrix
from ..detector.thesis_tables import NOISE, Damages

THESIS_NOISE = campaigns.MeasurementNoise(strain=campaigns.Distribution(uniform=NOISE))
CHAIN_NOISE = campaigns.MeasurementNoise(
    resistance=campaigns.Distribution(normal=0.001)
)  # of the change of resistance at full scale
RANDOM = campaigns.Damage(zones=(1, 4), depth=(0.05, 0.5))
HEALTHY = campaigns.Damage(zones=(0, 0))
LATE = 30  # samples by which records through the chain are longer: more than the estimator's delay
SIZES = (0.005, 0.01, 0.1, 0.5)  # [1] of single damages, to tell the probability of detection
SHARES = (0.0, 0.15, 0.8, 1.0)  # of the sizes below each: most where the detectors' limits are to be
# Factors of what is not as a detector takes it to be: the mismatches of the issue, and their ranges when everything varies.
MISMATCHES: dict[str, tuple[str, float, float]] = {
    "load": ("pressure_amplitude", 0.9, 1.1),
    "frequency": ("pressure_frequency", 0.95, 1.05),
    "damping": ("mass_damping", 0.5, 2.0),
    "modulus": ("youngs_modulus", 0.98, 1.02),
    "gain": ("sensor_gain", 0.98, 1.02),
}
Fault = Literal["none", "dead", "swapped"]


@dataclass(frozen=True)
class Condition:
    """One set of records.

    Attributes
    ----------
    name : str
        What tables call it.
    store : str
        Name of the campaign's store; conditions may share it.
    campaign : CampaignPlan
        What is simulated.
    noisy : bool
        Whether the campaign's noise of strain is added; the chain always has its own.
    fault : {"none", "dead", "swapped"}
        A sensor that repeats its first reading, or two that are exchanged: which ones, the number of the case tells.
    quick : bool
        Whether only quick judges are asked: what is varied alone is varied with everything else too, and what the slow ones
        refuse takes them longest.
    """

    name: str
    store: str
    campaign: campaigns.CampaignPlan
    noisy: bool = True
    fault: Fault = "none"
    quick: bool = False


def conditions(
    cases: int, mesh: campaigns.Mesh, other: campaigns.Mesh, *, seed: int = 10, stop: float = 0.3
) -> list[Condition]:
    """List the conditions of an assessment, apart from those of the probability of detection.

    Parameters
    ----------
    cases : int
        Records of each.
    mesh, other : Mesh
        Membrane of all conditions, and of the one called "another mesh"; "another law" has Hencky's on the former.
    seed : int
        Of all campaigns; none of the training.
    stop : float
        Length of the records [s].
    """
    random = campaigns.CampaignPlan(cases=cases, seed=seed, stop=stop, membrane=mesh, damage=RANDOM, noise=THESIS_NOISE)
    healthy = replace(random, damage=HEALTHY)
    everything = {what: campaigns.Vary(factor=(low, high)) for what, low, high in MISMATCHES.values()}
    return [
        Condition("clean", "random", random, noisy=False),
        Condition("noise", "random", random),
        *_mismatches(random),
        Condition("everything varied", "everything", replace(random, vary=everything)),
        Condition("dead sensor", "random", random, fault="dead", quick=True),
        Condition("swapped sensors", "random", random, fault="swapped", quick=True),
        Condition("whole chain", "chain", _through_chain(random)),
        Condition("another mesh", "mesh", replace(random, membrane=other)),
        Condition("another law", "law", replace(random, membrane=replace(mesh, law="hencky")), quick=True),
        Condition("healthy, clean", "healthy", healthy, noisy=False, quick=True),
        Condition("healthy, noise", "healthy", healthy),
        Condition("healthy, everything varied", "healthy_everything", replace(healthy, vary=everything)),
        Condition("healthy, whole chain", "healthy_chain", _through_chain(healthy)),
    ]


def table_conditions(damages: Damages, mesh: campaigns.Mesh, *, seed: int = 13, stop: float = 0.3) -> list[Condition]:
    """List the conditions that the cases of the thesis' tables are put to, called clean, noise and whole chain."""
    cases = campaigns.CampaignPlan(
        seed=seed, stop=stop, membrane=mesh, damage=campaigns.Damage(cases=damages), noise=THESIS_NOISE
    )
    return [
        Condition("clean", f"tables_{seed}", cases, noisy=False),
        Condition("noise", f"tables_{seed}", cases),
        Condition("whole chain", f"tables_{seed}_chain", _through_chain(cases)),
    ]


def _mismatches(random: campaigns.CampaignPlan) -> Iterator[Condition]:
    for name, (what, *factors) in MISMATCHES.items():
        for factor in factors:
            campaign = replace(random, vary={what: campaigns.Vary(factor=(factor, factor))})
            yield Condition(f"{name} x {factor:g}", f"{name}_{factor:g}", campaign, quick=True)


def _through_chain(campaign: campaigns.CampaignPlan) -> campaigns.CampaignPlan:
    """Return a campaign through sensor and estimator, longer by more than the estimator's delay."""
    stop = campaign.stop + LATE * campaign.step
    return replace(campaign, noise=CHAIN_NOISE, chain=campaigns.Chain(compensator="estimator"), stop=stop)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """Records that tell a probability of detection: healthy ones for the threshold, and one damage in each zone by size."""

    name: str
    healthy: Condition
    damaged: Condition


def detections(
    cases: int, mesh: campaigns.Mesh, *, seed: int = 11, long: float = 0.9, stop: float = 0.3
) -> list[Detection]:
    """List the conditions of the probability of detection.

    Parameters
    ----------
    cases : int
        Healthy records of each; there are a fifth as many sizes in each zone.
    mesh : Mesh
        Membrane.
    seed : int
        Of all campaigns.
    long, stop : float
        Length of the records of strain with the thesis' noise, and through the whole chain [s].
    """
    base = campaigns.CampaignPlan(cases=cases, seed=seed, stop=long, membrane=mesh, damage=HEALTHY, noise=THESIS_NOISE)
    damaged = replace(
        base,
        cases=None,
        damage=campaigns.Damage(cases=single_damages(max(cases // 5, 1), mesh.structure.n_zones)),
        seed=seed + 1,
    )
    chain, damaged_chain = (_through_chain(replace(campaign, stop=stop)) for campaign in (base, damaged))
    found = []
    for name, store, pair in (
        (f"noise, {long:g} s", "noise", (base, damaged)),
        (f"whole chain, {stop:g} s", "chain", (chain, damaged_chain)),
    ):
        healthy, sizes = (
            Condition(f"{kind}, {name}", f"detection_{store}_{kind}", campaign)
            for kind, campaign in zip(("healthy", "sizes"), pair, strict=True)
        )
        found.append(Detection(name=name, healthy=healthy, damaged=sizes))
    return found


def single_damages(sizes: int, zones: int) -> Damages:
    """List damages of one zone at a time, zone after zone, every zone ``sizes`` times.

    The logarithms of the sizes fill ``SIZES`` in each zone, evenly within the shares, at other places in every zone, and the
    first few already lie far apart (van der Corput), so that a slow judge may stop anywhere.
    """
    zone = np.arange(zones)
    order = np.argsort([_van_der_corput(k) for k in range(sizes)]).argsort()
    places = (order[:, None] + (zone * 7 % zones + 0.5) / zones) / sizes
    size = np.exp(np.interp(places, SHARES, np.log(SIZES)))
    return tuple({k: float(one)} for row in size for k, one in enumerate(row, start=1))


def _van_der_corput(k: int) -> float:
    bits = f"{k:b}"[::-1]
    return int(bits, 2) / float(2 ** len(bits))


@dataclass(frozen=True, kw_only=True)
class Records:
    """Histories of n cases, whose simulation did not fail.

    Attributes
    ----------
    damage : ndarray, shape (n, zones)
        True damage [1].
    strain : ndarray, shape (n, sensors, T)
        What a judge of strain gets [1]; through a chain that of the compensator, without its delay.
    resistance : ndarray, shape (n, 4, T'), or None
        With noise [ohm]; None without a chain.
    step : float
        Sampling step [s].
    failed : int
        Cases that were left out.
    """

    damage: Matrix
    strain: Matrix
    resistance: Matrix | None
    step: float
    failed: int

    def __len__(self) -> int:
        """Return n."""
        return len(self.damage)


def make_records(
    condition: Condition,
    folder: Path,
    *,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Records:
    """Simulate what is missing of a condition and read all of it.

    Parameters
    ----------
    condition : Condition
        What to read.
    folder : Path
        Where the stores of campaigns are.
    workers, progress
        As in ``run_campaign``.

    Raises
    ------
    CampaignStoppedError, DataError, OSError
        As in ``run_campaign``.
    """
    campaign = condition.campaign
    path = folder / f"{condition.store}_{campaign.count}.zarr"
    campaigns.run_campaign(campaign, path, workers=workers, progress=progress)
    data = campaigns.read_campaign(path)
    sound = ~data["failed"].to_numpy()
    data = data.isel(case=np.flatnonzero(sound))
    resistance = None
    if campaign.chain is not None:
        late = round(float(data["compensated_strain"].attrs["delay"]) / campaign.step)
        samples = campaign.steps - LATE
        strain = data["compensated_strain"].to_numpy()[:, :, late : late + samples]
        resistance = campaigns.measured_resistance(data).to_numpy()[:, :, :samples]
    elif condition.noisy:
        strain = campaigns.measured_strain(data).to_numpy()
    else:
        strain = (data["sensor_gain"] * data["strain"]).to_numpy()
    return Records(
        damage=data["damage"].to_numpy(),
        strain=with_fault(strain, data["case"].to_numpy(), condition.fault),
        resistance=resistance,
        step=campaign.step,
        failed=int((~sound).sum()),
    )


def with_fault(histories: Matrix, numbers: Matrix, fault: Fault) -> Matrix:
    """Return histories, shape (n, sensors, T), with one dead sensor or two swapped ones, by the numbers of the cases."""
    found = np.array(histories)
    sensors = found.shape[1]
    pairs = list(combinations(range(sensors), 2))
    for k, number in enumerate(numbers):
        if fault == "dead":
            dead = int(number) % sensors
            found[k, dead] = found[k, dead, 0]
        elif fault == "swapped":
            pair = list(pairs[int(number) % len(pairs)])
            found[k, pair] = found[k, pair[::-1]]
    return found
