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


def plan_of_square(mesh: campaigns.Mesh | None = None, stop: float = 0.3) -> campaigns.CampaignPlan:
    """Return what the shipped detectors are judged on: the square under its load, with the thesis' noise, for a time [s]."""
    return campaigns.CampaignPlan(cases=1, stop=stop, membrane=mesh or campaigns.Mesh(), noise=THESIS_NOISE)


def conditions(plan: campaigns.CampaignPlan, other: campaigns.Mesh | None, cases: int, *, seed: int = 10) -> list[Condition]:
    """List the conditions of an assessment, apart from those of the probability of detection.

    Parameters
    ----------
    plan : CampaignPlan
        Membrane, load, noise of strain, and the times of a record; a chain of sensors stands behind the square alone.
    other : Mesh or None
        Membrane of the condition called "another mesh"; without one it is left out.
    cases : int
        Records of each condition.
    seed : int
        Of all campaigns; none of the training.
    """
    mesh = plan.membrane
    damage = replace(RANDOM, zones=(1, min(RANDOM.zones[1], mesh.structure.n_zones)))
    random = replace(plan, cases=cases, seed=seed, damage=damage, window=None)
    healthy = replace(random, damage=HEALTHY)
    everything = {name: vary for what in MISMATCHES.values() for name, vary in _varied(mesh, *what).items()}
    square = mesh.setup is None  # whose sensors are known
    found = [
        Condition("clean", "random", random, noisy=False),
        Condition("noise", "random", random),
        *_mismatches(random),
        Condition("everything varied", "everything", replace(random, vary=everything)),
        Condition("dead sensor", "random", random, fault="dead", quick=True),
    ]
    if mesh.structure.n_sensors > 1:
        found.append(Condition("swapped sensors", "random", random, fault="swapped", quick=True))
    if square:
        found.append(Condition("whole chain", "chain", _through_chain(random)))
    if other is not None:
        found.append(Condition("another mesh", "mesh", replace(random, membrane=other)))
    found += [
        Condition("another law", "law", replace(random, membrane=_other_law(mesh)), quick=True),
        Condition("healthy, clean", "healthy", healthy, noisy=False, quick=True),
        Condition("healthy, noise", "healthy", healthy),
        Condition("healthy, everything varied", "healthy_everything", replace(healthy, vary=everything)),
    ]
    if square:
        found.append(Condition("healthy, whole chain", "healthy_chain", _through_chain(healthy)))
    return found


def _varied(mesh: campaigns.Mesh, what: str, low: float, high: float) -> dict[str, campaigns.Vary]:
    """Return the range of factors of a quantity, or of all elements of an array, where the membrane has one above 0."""
    names = [name for name in mesh.settable if name.partition("[")[0] == what] or [what]
    names += [campaigns.LOAD] * (what == "pressure_amplitude" and mesh.load is not None)
    base = {name: 1.0 if name in campaigns.OF_NO_VARIABLE else mesh.base(name) for name in names}
    return {name: campaigns.Vary(factor=(low, high)) for name in names if base[name] > 0.0}


def _other_law(mesh: campaigns.Mesh) -> campaigns.Mesh:
    """Return the membrane with Hencky's law, or one that has it with Saint Venant's."""
    own = mesh.law if mesh.setup is None else mesh.setup.law
    law = "hencky" if own != "hencky" else "st_venant_kirchhoff"
    return replace(mesh, law=law) if mesh.setup is None else replace(mesh, setup=replace(mesh.setup, law=law))


def finer(mesh: campaigns.Mesh) -> campaigns.Mesh | None:
    """Return the membrane with about twice the resolution; None of one with triangles, which have no order."""
    if mesh.setup is None:
        return replace(mesh, order=2 * mesh.order)
    if any(block.order == 0 for block in mesh.structure.mesh.blocks):
        return None
    return replace(mesh, setup=replace(mesh.setup, order=mesh.setup.order + 1))


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
            if vary := _varied(random.membrane, what, factor, factor):
                yield Condition(f"{name} x {factor:g}", f"{name}_{factor:g}", replace(random, vary=vary), quick=True)


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


def detections(plan: campaigns.CampaignPlan, cases: int, *, seed: int = 11) -> list[Detection]:
    """List the conditions of the probability of detection: thrice as long with noise, and as long through the whole chain.

    Parameters
    ----------
    plan : CampaignPlan
        As of ``conditions``.
    cases : int
        Healthy records of each; there are a fifth as many sizes in each zone.
    seed : int
        Of all campaigns.
    """
    base = replace(plan, cases=cases, seed=seed, stop=3.0 * plan.stop, window=None, damage=HEALTHY)
    sizes = single_damages(max(cases // 5, 1), plan.membrane.structure.n_zones)
    damaged = replace(base, cases=None, damage=campaigns.Damage(cases=sizes), seed=seed + 1)
    pairs = [(f"noise, {base.stop:g} s", "noise", (base, damaged))]
    if plan.membrane.setup is None:
        chain, damaged = (_through_chain(replace(campaign, stop=plan.stop)) for campaign in (base, damaged))
        pairs.append((f"whole chain, {plan.stop:g} s", "chain", (chain, damaged)))
    found = []
    for name, store, pair in pairs:
        healthy, some = (
            Condition(f"{kind}, {name}", f"detection_{store}_{kind}", campaign)
            for kind, campaign in zip(("healthy", "sizes"), pair, strict=True)
        )
        found.append(Detection(name=name, healthy=healthy, damaged=some))
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
    resistance : ndarray, shape (n, sensors, T'), or None
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
    condition: Condition, folder: Path, *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
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
