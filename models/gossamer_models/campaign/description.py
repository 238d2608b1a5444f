"""What a campaign is: how many cases, drawn from which damage, load, material, sensors and noise.

Every class is one table of ``campaign.toml``, or a range or distribution in one; ``docs/campaigns.md`` describes the keys.
Ranges are pairs (low, high).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..mistakes import DescriptionError, Mistake, disordered, raise_any
from .mesh import Mesh

Pair = tuple[float, float]
MOST_STEPS = 1_000_000
MOST_CASES_PER_CHUNK = 4096
DEEPEST = 0.95  # largest damage that the membrane takes [1]
SENSOR_GAIN = "sensor_gain"
SENSOR_ERROR = "sensor_error"
NOISE = "noise"
LOAD = "load"
OF_NO_VARIABLE = {SENSOR_GAIN: 1.0, SENSOR_ERROR: 0.0, NOISE: 1.0, LOAD: 1.0}  # what else varies [1], and its constant value
ONSET = "onset"


@dataclass(frozen=True, slots=True, kw_only=True)
class Vary:
    """Range that a quantity is drawn from: ``range`` or ``factor``.

    Attributes
    ----------
    range : tuple of float or None
        In the unit of the quantity, uniform.
    factor : tuple of float or None
        Of the constant value; the logarithm is uniform, so that half and double are as likely.
    share : float
        Of the cases that it varies in [1]; it has its constant value in the others.
    """

    range: Pair | None = None
    factor: Pair | None = None
    share: float = 1.0

    def __post_init__(self) -> None:
        if (self.range is None) == (self.factor is None):
            raise DescriptionError(Mistake((), "Write either range = [low, high] or factor = [low, high]."))
        for name, pair in (("range", self.range), ("factor", self.factor)):
            raise_any([*disordered(name, pair or (0.0, 0.0), -math.inf, math.inf)])
        if self.factor is not None and self.factor[0] <= 0.0:
            text = f"'factor' begins at {self.factor[0]:g}; factors are positive. Write a range in its place."
            raise DescriptionError(Mistake(("factor",), text))
        if not 0.0 < self.share <= 1.0:
            raise DescriptionError(Mistake(("share",), f"'share' is {self.share:g}. Write a share above 0, up to 1."))

    def limits(self, base: float) -> Pair:
        """Return the lowest and highest value, given the constant one."""
        if self.range is not None:
            return self.range
        low, high = sorted(base * f for f in self.factor or (1.0, 1.0))
        return low, high


@dataclass(frozen=True, slots=True, kw_only=True)
class Distribution:
    """Distribution of white noise; one of the two.

    Attributes
    ----------
    uniform : tuple of float or None
        Range.
    normal : float or None
        Standard deviation about zero.
    """

    uniform: Pair | None = None
    normal: float | None = None

    def __post_init__(self) -> None:
        if (self.uniform is None) == (self.normal is None):
            raise DescriptionError(Mistake((), "Write either uniform = [low, high] or normal = standard deviation."))
        raise_any([*disordered("uniform", self.uniform or (0.0, 0.0), -math.inf, math.inf)])
        if self.normal is not None and self.normal < 0.0:
            raise DescriptionError(
                Mistake(("normal",), f"'normal' is {self.normal:g}. Write a standard deviation, 0 or more.")
            )

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return self.normal or 0.0 if self.uniform is None else (self.uniform[1] - self.uniform[0]) / math.sqrt(12.0)

    def draw(self, shape: tuple[int, ...], random: np.random.Generator) -> NDArray[np.float64]:
        """Draw independent numbers."""
        if self.uniform is None:
            return (self.normal or 0.0) * random.standard_normal(shape)
        low, high = self.uniform
        return low + (high - low) * random.random(shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """Damage of the cases: drawn, or a list.

    Attributes
    ----------
    zones : tuple of int
        Fewest and most damaged zones; every number between is as likely.
    depth : tuple of float
        Range of the damage of each [1], uniform.
    healthy : float
        Share of cases without damage [1].
    cases : tuple of dict
        In place of these: damage [1] by zone, from 1, for every case; longer campaigns go through the list again.
    onset : tuple of float
        Range of the time [s] at which all damage of a case begins, uniform; before 0 it is there from the start.
    """

    zones: tuple[int, int] = (1, 4)
    depth: Pair = (0.05, 0.5)
    healthy: float = 0.0
    cases: tuple[dict[int, float], ...] = ()
    onset: Pair = (0.0, 0.0)

    def __post_init__(self) -> None:
        mistakes = [*disordered("depth", self.depth, 0.0, DEEPEST), *disordered("onset", self.onset, -math.inf, math.inf)]
        if not 0.0 <= self.healthy <= 1.0:
            mistakes.append(Mistake(("healthy",), f"'healthy' is {self.healthy:g}. Write a share from 0 to 1."))
        drawn = [
            row for row in fields(self) if row.name not in ("cases", "onset") and getattr(self, row.name) != row.default
        ]
        if self.cases and drawn:
            text = f"'cases' lists the damages, so {drawn[0].name!r} has no meaning. Remove one of them."
            mistakes.append(Mistake((drawn[0].name,), text))
        raise_any(mistakes)

    def outside(self, zones: int) -> Iterator[Mistake]:
        """Refuse what a membrane with some number of zones does not have."""
        yield from disordered("zones", self.zones, 0, zones)
        for i, case in enumerate(self.cases):
            for zone, value in case.items():
                if not (1 <= zone <= zones and 0.0 <= value <= DEEPEST):
                    text = f"damage {value:g} in zone {zone}: zones are 1 to {zones}, damages 0 to {DEEPEST:g}."
                    yield Mistake(("cases", i), text)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementNoise:
    """White noise of the measurement, one draw per sample.

    Attributes
    ----------
    strain : Distribution or None
        Added to strain [1] where it is read without the chain.
    resistance : Distribution or None
        Added to the resistance, in units of the sensor's full-scale change [1]; what the compensator gets.
    """

    strain: Distribution | None = None
    resistance: Distribution | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """Sensors and compensators behind the membrane.

    Attributes
    ----------
    compensator : {"inverse", "estimator"}
        Method of ``compensator_model``.
    artifact : str or None
        File of an identified sensor; None for the one that ships with the package.
    sensor_parameters, compensator_parameters : mapping of str to float
        Parameters by name; the rest strain is that of the prestressed membrane if it is not given.
    """

    compensator: Literal["inverse", "estimator"] = "inverse"
    artifact: str | None = None
    sensor_parameters: Mapping[str, float] = field(default_factory=dict)
    compensator_parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Coarser:
    """Cases on a coarser mesh, which a network is trained on first: many cheap ones before few dear ones.

    Attributes
    ----------
    order : int
        Of their elements.
    times : int
        How many times as many cases.
    """

    order: int = 2
    times: int = 3

    def __post_init__(self) -> None:
        for name, value in (("order", self.order), ("times", self.times)):
            if value < 1:
                raise DescriptionError(Mistake((name,), f"{name!r} is {value}. Write a whole number from 1."))


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignPlan:
    """Many simulations of one membrane. A case is a function of ``seed``, its number, and what else stands here.

    Attributes
    ----------
    title : str
        One line.
    cases : int or None
        How many; None is the length of the list of damages.
    seed : int
        Of everything that is drawn.
    step, stop : float
        Sampling step and last time [s]; the first sample is taken one step after the start.
    sampling : {"random", "latin-hypercube"}
        Independent draws, or one in each of ``cases`` equal strata of every quantity.
    window : float or None
        Length of the windows of a detector that is trained on it [s]; None where the training says it.
    chunk : int
        Cases of one task and of one file, 64 to 256 are good.
    membrane, damage, vary, noise, chain, coarser
        See there; ``vary`` takes parameters and constant inputs of the membrane, ``sensor_gain``, ``sensor_error``
        and ``noise`` (a factor).

    Raises
    ------
    DescriptionError
        Values that do not go together.
    """

    title: str = ""
    cases: int | None = None
    seed: int = 0
    step: float = 3e-4
    stop: float = 0.3
    window: float | None = None
    sampling: Literal["random", "latin-hypercube"] = "random"
    chunk: int = 128
    membrane: Mesh = field(default_factory=Mesh)
    damage: Damage = field(default_factory=Damage)
    vary: Mapping[str, Vary] = field(default_factory=dict)
    noise: MeasurementNoise = field(default_factory=MeasurementNoise)
    chain: Chain | None = None
    coarser: Coarser | None = None

    def __post_init__(self) -> None:
        raise_any([*self._mistakes()])

    def _mistakes(self) -> Iterator[Mistake]:
        if self.cases is None and not self.damage.cases:
            yield Mistake(("cases",), "'cases' is missing. Write how many cases there are.")
        for name, low, high in (("cases", 1, 10**9), ("chunk", 1, MOST_CASES_PER_CHUNK), ("seed", 0, 2**63 - 1)):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                yield Mistake((name,), f"{name!r} is {value}. Write a whole number from {low} to {high}.")
        yield from (Mistake(("damage", *m.place), *m[1:]) for m in self.damage.outside(self.membrane.structure.n_zones))
        if self.membrane.finer and not any(map(self.membrane.is_finer, range(self.chunks))):
            what = f"'finer' is {self.membrane.finer:g} of {self.chunks} chunks, which is none"
            text = f"{what}. Shorten 'chunk', or run more cases."
            yield Mistake(("membrane", "finer"), text)
        yield from self._time_mistakes()
        if self.noise.resistance is not None and self.chain is None:
            text = "there is noise on the resistance and no [chain] of sensors. Add [chain], or remove it."
            yield Mistake(("noise", "resistance"), text)
        for name, vary in self.vary.items():
            yield from (Mistake(("vary", *m.place), *m[1:]) for m in self._vary_mistakes(name, vary))

    def _time_mistakes(self) -> Iterator[Mistake]:
        for name in ("step", "stop"):
            if not 0.0 < getattr(self, name) < math.inf:
                yield Mistake((name,), f"{name!r} is {getattr(self, name):g} s. Write a positive time.")
                return
        if self.window is not None and not 0.0 < self.window <= self.stop * (1.0 + 1e-9):
            text = f"'window' is {self.window:g} s and the run {self.stop:g} s long. Write a shorter time."
            yield Mistake(("window",), text)
        ratio = self.stop / self.step
        if ratio > MOST_STEPS:
            text = f"'step' = {self.step:g} s makes {ratio:.3g} steps, more than {MOST_STEPS:.0e}. Use a longer one."
            yield Mistake(("step",), text)
        elif abs(ratio - max(round(ratio), 1)) > 1e-6:
            nearest = max(round(ratio), 1) * self.step
            text = f"'stop' = {self.stop:g} s is no whole number of steps of {self.step:g} s. The nearest is {nearest:.12g}."
            yield Mistake(("stop",), text)

    def _vary_mistakes(self, name: str, vary: Vary) -> Iterator[Mistake]:
        if name in OF_NO_VARIABLE:
            if vary.limits(self.base(name))[0] < 0.0:
                yield Mistake((name,), f"{name!r} begins below 0. Write a range from 0 or a factor.")
            if name == SENSOR_ERROR and vary.factor is not None:
                yield Mistake((name,), f"{name!r} is 0, so a factor does not vary it. Write a range of shares [1].")
            if name == NOISE and self.noise == MeasurementNoise():
                yield Mistake((name,), "there is no noise to vary. Add [noise], or remove it.")
            if name == LOAD and self.membrane.load is None:
                yield Mistake((name,), "there is no table of loads to vary. Add load to [membrane], or remove it.")
            return
        known = self.membrane.settable
        if name not in known:
            yield Mistake((name,), f"the membrane has no {name!r} to vary.", name, (*known, *OF_NO_VARIABLE))
            return
        if name in self.membrane.histories:
            yield Mistake((name,), f"{name!r} stands in the table of loads. Vary {LOAD!r}, a factor on all of them.")
        if vary.range is not None and name in self.membrane.parameters:
            text = f"{name!r} has a range and a constant value in [membrane]. Remove one of them, or write a factor."
            yield Mistake((name,), text)
        if vary.factor is not None and self.base(name) == 0.0:
            yield Mistake((name,), f"{name!r} is 0, so a factor does not vary it. Write a range.")
        for value in vary.limits(self.base(name)):
            yield from self.membrane.outside((name,), value)

    def base(self, name: str) -> float:
        """Return the constant value of a quantity that can vary."""
        if name in OF_NO_VARIABLE:
            return OF_NO_VARIABLE[name]
        return self.membrane.base(name)

    @property
    def coarse(self) -> CampaignPlan | None:
        """The campaign on the coarser mesh, with other cases; None if there is none."""
        if self.coarser is None:
            return None
        membrane, cases = self.membrane.of_order(self.coarser.order), self.coarser.times * self.count
        return replace(self, membrane=membrane, cases=cases, seed=self.seed + 1, coarser=None)

    @property
    def count(self) -> int:
        """Number of cases."""
        return len(self.damage.cases) if self.cases is None else self.cases

    @property
    def steps(self) -> int:
        """Number of samples of a history."""
        return round(self.stop / self.step)

    @property
    def begins(self) -> bool:
        """Whether damage begins within the run in some cases."""
        return self.damage.onset[1] > 0.0

    @property
    def chunks(self) -> int:
        """Number of chunks; the last one may be shorter."""
        return -(-self.count // self.chunk)

    def numbers(self, chunk: int) -> range:
        """Return the cases of a chunk."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.count))
