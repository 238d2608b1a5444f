"""Conditions that judges are put to, each a world of its own: what is simulated, and how the sensors read it.

Every condition is a campaign, so its cases are a function of seed and number. Damage of parts of zones, sensors off their
place and a pressure that is not as thought are those of a finer mesh, where there is one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .. import campaign as campaigns
from ..arrays import Matrix
from ..detector.thesis_tables import NOISE, Damages
from ..errors import ParameterError
from ..membrane.setup import MAX_ORDER
from ..membrane.zones import MOST_ZONES
from . import readings, truths

THESIS_NOISE = campaigns.MeasurementNoise(strain=campaigns.Distribution(uniform=NOISE))
# of the change of resistance at full scale
CHAIN_NOISE = campaigns.MeasurementNoise(resistance=campaigns.Distribution(normal=0.001))
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
TUNED = {
    *("clean", "noise", "load x 0.9", "frequency x 1.05", "damping x 0.5", "modulus x 1.02", "gain x 0.98"),
    *("density x 1.05", "everything varied", "dead sensor", "another mesh", "prestrain x 1.05", "modulus x 0.95"),
    *("one gain x 0.95", "late by 1 sample", "a sensor 3 % off its place", "tilted pressure"),
    *("band across zones", "hole in a zone", "healthy, noise", "healthy, whole chain", "other sensors"),
    *("healthy, modulus within 5 %", "sensors off"),
}
# Kept out of tuning: nobody looks at these while a judge is made better, nor chooses a number by them.
HELD_OUT = {
    *("load x 1.1", "frequency x 0.95", "damping x 2", "modulus x 0.98", "modulus x 1.05", "gain x 1.02"),
    *("thickness x 1.05", "prestrain x 0.9", "swapped sensors", "finest mesh", "rough pressure", "outliers"),
    *("a sensor 1 % off its place", "late by 5 samples", "corner of zones", "healthy, everything varied"),
    *(
        "whole chain",
        "less sensitive sensors",
        "another law",
        "coloured noise",
        "healthy, clean",
        "pressure with a harmonic",
        "healthy, gain within 5 %",
        "healthy, sensors off",
    ),
}
KNOWN = TUNED | HELD_OUT
MATERIAL = {"density": (1.05,), "thickness": (1.05,), "prestrain": (0.9, 1.05), "modulus": (0.95, 1.05)}
# What sensors have that are not those of the artifact: their full scale is at a strain of 0.5 there, and 100 ohm.
OTHER_SENSORS = {
    "other sensors": {"full_scale_strain": 0.525},
    "less sensitive sensors": {"full_scale_resistance_change": 93.0},
}
PARTIAL = {"band across zones": "band", "corner of zones": "corner", "hole in a zone": "hole"}
READINGS: dict[str, readings.Reading] = {
    "one gain x 0.95": readings.one_gain,
    "coloured noise": readings.coloured,
    "outliers": readings.outliers,
    "late by 1 sample": partial(readings.late, 1),
    "late by 5 samples": partial(readings.late, 5),
}
SHORT = (
    *("noise", "another mesh", "load x 0.9", "one gain x 0.95", "a sensor 3 % off its place", "late by 1 sample"),
    *("band across zones", "hole in a zone"),
)


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
    read : callable
        Turns strain and its noise, shape (n, sensors, T), and the numbers of the cases into what is read, see ``readings``.
    quick : bool
        Whether only quick judges are asked in a whole assessment: what is varied alone is varied with everything else too,
        and what the slow ones refuse takes them longest.
    loads : callable or None
        Gives inputs of the membrane over the samples, shape (n, T), beside those of the campaign.
    parts : bool
        Whether damage is that of parts of zones, see ``truths.quartered``.
    """

    name: str
    store: str
    campaign: campaigns.CampaignPlan
    noisy: bool = True
    read: readings.Reading = readings.as_it_is
    quick: bool = False
    loads: Callable[[campaigns.CampaignPlan], dict[str, Matrix]] | None = None
    parts: bool = False

    @property
    def held_out(self) -> bool:
        """Whether it is kept out of tuning."""
        return self.name in HELD_OUT


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
        Condition("dead sensor", "random", random, read=readings.dead, quick=True),
        Condition("sensors off", "random", random, read=readings.off, quick=True),
    ]
    if mesh.structure.n_sensors > 1:
        found.append(Condition("swapped sensors", "random", random, read=readings.swapped, quick=True))
    if square:
        found.append(Condition("whole chain", "chain", _through_chain(random)))
    if other is not None:
        found.append(Condition("another mesh", "mesh", replace(random, membrane=other)))
    found.append(Condition("another law", "law", replace(random, membrane=_other_law(mesh)), quick=True))
    found += _finer_worlds(replace(random, membrane=other or mesh), mesh)
    if square:
        for name, scale in OTHER_SENSORS.items():
            found.append(Condition(name, name.replace(" ", "_"), _through_chain(random, **scale), quick=True))
    found += [
        Condition("healthy, clean", "healthy", healthy, noisy=False, quick=True),
        Condition("healthy, noise", "healthy", healthy),
        Condition("healthy, sensors off", "healthy", healthy, read=readings.off, quick=True),
        Condition("healthy, everything varied", "healthy_everything", replace(healthy, vary=everything)),
    ]
    for name in ("modulus", "gain"):
        if vary := _varied(mesh, MISMATCHES[name][0], 0.95, 1.05):
            off = replace(healthy, vary=vary)
            found.append(Condition(f"healthy, {name} within 5 %", f"healthy_{name}", off, quick=True))
    if square:
        found.append(Condition("healthy, whole chain", "healthy_chain", _through_chain(healthy)))
    return found


def chosen(found: Sequence[Condition], names: Sequence[str]) -> list[Condition]:
    """Return the conditions of some names; ``all`` stands for all, ``short`` for the eight of ``SHORT`` that there are.

    Raises
    ------
    ParameterError
        There is no such condition.
    """
    there = {condition.name: condition for condition in found}
    groups = {"all": [*there], "short": [name for name in SHORT if name in there]}
    wanted = [each for name in names for each in groups.get(name, [name])]
    for name in wanted:
        if name not in there:
            msg = f"there is no condition {name!r} of this structure. Choose from all, short, {', '.join(there)}."
            raise ParameterError(msg)
    return [there[name] for name in dict.fromkeys(wanted)]


def _finer_worlds(truth: campaigns.CampaignPlan, mesh: campaigns.Mesh) -> Iterator[Condition]:
    """Give what else may be off, on a finer mesh; of some membrane that of parts of zones is in four of its own elements."""
    if (finest := _finest(mesh)) is not None:
        yield Condition("finest mesh", "finest", replace(truth, membrane=finest), quick=True)
    for what, factors in MATERIAL.items():
        for factor in factors:
            if (changed := truths.with_material(truth.membrane, what, factor)) is not None:
                plan = replace(truth, membrane=changed)
                yield Condition(f"{what} x {factor:g}", f"{what}_{factor:g}", plan, quick=True)
    for name, read in READINGS.items():
        yield Condition(name, "mesh", truth, read=read, quick=True)
    if mesh.structure.n_sensors:
        for percent in (1, 3):
            moved = replace(truth, membrane=truths.with_moved_sensors(truth.membrane, percent / 100.0))
            name = f"a sensor {percent} % off its place"
            yield Condition(name, f"moved_{percent}", moved, read=readings.off_place, quick=True)
    if any(load.kind == "pressure" for load in mesh.structure.setup.loads):
        yield Condition("rough pressure", "rough", truth, loads=truths.rough_pressure, quick=True)
        yield Condition("pressure with a harmonic", "harmonic", truth, loads=truths.harmonic, quick=True)
        tilted = replace(truth, membrane=truths.tilted(mesh))
        yield Condition("tilted pressure", "tilted", tilted, loads=truths.tilt, quick=True)
    structure = mesh.structure
    if truths.QUARTERS * structure.n_zones > MOST_ZONES or structure.n_face_zones < structure.n_zones:
        return
    parts = truths.quartered(mesh)
    for name, kind in PARTIAL.items():
        listed = truths.partial_damages(kind, parts.structure, truth.count, truth.seed)
        plan = replace(truth, cases=None, membrane=parts, damage=campaigns.Damage(cases=listed))
        yield Condition(name, kind, plan, quick=True, parts=True)


def _finest(mesh: campaigns.Mesh) -> campaigns.Mesh | None:
    """Return the membrane with about three times the resolution, or the order that there is; None of one with triangles."""
    if mesh.setup is None:
        return replace(mesh, order=min(3 * mesh.order, MAX_ORDER))
    once = finer(mesh)
    return None if once is None else finer(once)


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


def _through_chain(campaign: campaigns.CampaignPlan, **sensor: float) -> campaigns.CampaignPlan:
    """Return a campaign through sensor and estimator, longer by more than the estimator's delay."""
    stop = campaign.stop + LATE * campaign.step
    chain = campaigns.Chain(compensator="estimator", sensor_parameters=sensor)
    return replace(campaign, noise=CHAIN_NOISE, chain=chain, stop=stop)


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
