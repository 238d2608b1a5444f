"""What a twin says of a record."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .further import further
from .groups import UNRESOLVED
from .least_squares import PRIOR_DEVIATION, Point
from .problem import RecordProblem
from .record import ResponseRecord, Wiring
from .search import Fit, box
from .sensor_error import Shares
from .zone_sets import Alternatives, alternatives, drop_zones

DETERMINED = 0.02  # deviation of a damage that is answered with a value
WIDTH = 1.96  # deviations to each side of the bounds, 95 %
UNLIKELY = 1e-4  # sets of zones whose covariance does not count
OFF = 0.2  # of the range: no answer is valid where a sensor is further off its model
OFF_BEHIND = 0.005  # the same where the mesh's error was learned behind sensors that keep to it
GROWTH = ("growth", "growth_deviation", "growth_probability")
OF_ZONES = (
    "damage",
    "estimate",
    "deviation",
    "probability",
    "covariance",
    "bounds",
    *GROWTH,
    "faults",
    "explanations",
    "further",
)
EXPLAINS, EXPLANATIONS = 0.01, 6  # probability of an explanation that is told, and most of them


@dataclass(frozen=True, kw_only=True)
class FaultFound:
    """What a twin says of a fault.

    Attributes
    ----------
    name : str
        What it is.
    share, deviation : float
        By which something is less, or more, than it should be [1], and its standard deviation.
    probability : float
        How likely it is [1].
    """

    name: str
    share: float
    deviation: float
    probability: float


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Damage of all zones with its uncertainty, and whether the twin explains the record.

    Attributes
    ----------
    zones : tuple of str
        Names of the zones.
    faults : tuple of FaultFound
        Of everything else that may have gone wrong, where that was asked.
    explanations : tuple of tuple
        What explains the record, the likeliest first: probability [1], and what is damaged or wrong.
    damage, deviation : ndarray, shape (zones,)
        Lost fraction of Young's modulus [1] and its standard deviation, which counts in that other zones may explain the
        record as well; where ``damage`` is zero, the deviation that it would have if it were fitted.
    probability : ndarray, shape (zones,)
        How likely each zone is damaged [1].
    covariance : ndarray, shape (zones, zones)
        Covariance of the damages [1]; rows and columns of zones that were dropped are zero outside the diagonal, but for
        zones that may be damaged in place of others.
    nuisances : dict of tuple of float
        Value and standard deviation of each nuisance: a factor for load, damping, modulus and gain; phase [rad]; pressure
        [Pa]; offset [1], of strain or of the sensor's change at full scale; places [m].
    sensor_errors, sensor_offsets : tuple of float or None
        How far each sensor is off its identified model, as shares of the range of what it reads [1]: root mean square of its
        likeliest error beside an offset, and that offset; None of one without values. Empty for strain.
    chi2_per_sample, chi2_bound : float
        Mean square of the residuals in units of the expected ones, and the bound that a right model passes in 999 of
        1000 records.
    valid : bool
        Whether the answer can be used: chi2 is below its bound and no doubt forbids it.
    unresolved : tuple of int
        Zones, from 1, that this record cannot tell by themselves.
    together_with : tuple of tuple of str
        Of each zone the names of those that it was answered together with: all have their mean damage and its deviation.
    left_out : tuple of int
        Sensors, from 1, that were left out.
    order : tuple of int
        Sensors, from 1, whose histories were taken for those of the first, the second, ...
    doubts : tuple of str
        Sentences on what is wrong with the record or the answer.
    samples, simulations : int
        Values that were fitted, and cases that were simulated.
    record : ResponseRecord
        What was fitted: the samples that were compared, of the sensors in ``order`` that were not left out.
    predicted : ndarray, shape (sensors, n)
        What the sensors read by this answer, in the unit of the record, without the model error that is allowed for.
    strain : ndarray, shape (sensors, n)
        What they feel by this answer [1], at the samples of the record.
    growth, growth_deviation, growth_probability : ndarray, shape (zones,), or None
        Damage since the last inspection [1], its deviation, and how likely there is some; None without an inspection.
    further : str
        What would tell the two likeliest explanations apart, a record or a gauge; empty where one of them is likely.
    records : tuple of Answer
        Of several records, what is said of each, with the damages of all; ``record`` and ``predicted`` are of the first.
    """

    zones: tuple[str, ...]
    damage: Vector
    deviation: Vector
    probability: Vector
    covariance: Matrix
    nuisances: dict[str, tuple[float, float]]
    sensor_errors: tuple[float | None, ...] = ()
    sensor_offsets: tuple[float | None, ...] = ()
    chi2_per_sample: float
    chi2_bound: float
    valid: bool
    unresolved: tuple[int, ...] = ()
    together_with: tuple[tuple[str, ...], ...] = ()
    left_out: tuple[int, ...] = ()
    order: tuple[int, ...]
    doubts: tuple[str, ...] = field(default=())
    samples: int = 0
    simulations: int = 0
    record: ResponseRecord
    predicted: Matrix
    strain: Matrix
    growth: Vector | None = None
    growth_deviation: Vector | None = None
    growth_probability: Vector | None = None
    records: tuple[Answer, ...] = ()
    faults: tuple[FaultFound, ...] = ()
    explanations: tuple[tuple[float, tuple[str, ...]], ...] = ()
    further: str = ""

    @property
    def determined(self) -> Rows:
        """Whether the damage of each zone is known to 2 percentage points, shape (zones,); others have bounds alone."""
        return np.asarray((self.deviation <= DETERMINED) & ~self._untold)

    @property
    def value(self) -> Vector:
        """Damage of each zone that is determined [1], shape (zones,); not a number of the others."""
        return np.where(self.determined, self.damage, np.nan)

    @property
    def bounds(self) -> Matrix:
        """Between which the damage of each zone lies in 95 of 100 records that the twin explains [1], shape (zones, 2)."""
        reach = np.where(self._untold, 1.0, WIDTH * self.deviation)
        return np.asarray(np.clip(self.damage[:, None] + reach[:, None] * [-1.0, 1.0], 0.0, 1.0))

    @property
    def _untold(self) -> Rows:
        """Which zones the record cannot tell by themselves, and that are not answered together with others."""
        together = np.array([bool(others) for others in self.together_with or [()] * len(self.zones)])
        return np.asarray(np.isin(np.arange(1, len(self.zones) + 1), self.unresolved or ()) & ~together)

    def as_json(self, *, show_invalid: bool = False) -> dict[str, Any]:
        """Return the answer without its histories as JSON values: null where a zone has no value.

        Parameters
        ----------
        show_invalid : bool
            Whether the zones of an answer that is not valid are shown.
        """
        shown = self.valid or show_invalid
        left_out = ("record", "predicted", "strain", "records", *(() if shown else OF_ZONES))
        found = {
            name: value.tolist() if isinstance(value := getattr(self, name), np.ndarray) else value
            for name in (*self.__dataclass_fields__, "determined", "bounds")
            if name not in left_out
        }
        alike = {*OF_ZONES, "zones", "determined", "unresolved", "together_with", "records"}
        found["records"] = [
            {name: value for name, value in record.as_json().items() if name not in alike} for record in self.records
        ]
        if not shown:
            return found | dict.fromkeys(OF_ZONES)
        found["faults"] = [asdict(fault) for fault in self.faults]
        found["estimate"] = self.damage.tolist()  # also of zones that have bounds alone
        return found | {"damage": [None if np.isnan(value) else value for value in self.value.tolist()]}


def answer_of(
    fit: Fit,
    doubts: Sequence[str],
    more: Sequence[str],
    wiring: Wiring | None,
    unresolved: tuple[int, ...],
    *,
    sparse: bool,
    hidden: bool,
) -> Answer:
    """Return what a fit says.

    Parameters
    ----------
    fit : Fit
        Of the record.
    doubts, more : sequence of str
        Sentences that stand first, and those on the error of the mesh.
    wiring : Wiring or None
        How the record was read, unless as it is.
    unresolved : tuple of int
        Zones, from 1, that the record cannot tell by themselves.
    sparse : bool
        Whether zones were dropped.
    hidden : bool
        Whether the error of the mesh forbids a valid answer.
    """
    per_sample, bound = fit.per_sample, fit.chi2_bound
    said, valid = list(doubts), fit.passes and not hidden and (wiring is None or not wiring.moved)
    said += [fit.oddity] if fit.oddity else []
    if not fit.passes and (per_sample > bound or not fit.oddity):
        said.append(
            f"the twin does not explain the record: chi2 per sample is {per_sample:.3g}, its bound {bound:.3g}. Check "
            "load, damping, sensors and noise"
        )
    of_zones = ZonesFound.of(fit, sparse=sparse)
    fields, more_doubts, reads = of_record(fit.problem, fit.point, of_zones.unknowns[fit.problem.zones :])
    return Answer(
        zones=names_of(fit),
        chi2_per_sample=per_sample,
        chi2_bound=bound,
        valid=valid and reads,
        unresolved=unresolved,
        together_with=together_with(fit),
        order=order_of(wiring, fit.problem.model.sensors),
        doubts=(*said, *more_doubts, *more),
        further=further(fit) if valid and reads and fit.problem.whole < fit.problem.zones else "",
        **of_zones.as_fields(fit),
        **fields,
    )


@dataclass(frozen=True)
class ZonesFound:
    """What a fit says of its damages.

    Attributes
    ----------
    damage, probability : ndarray, shape (zones,)
        Of each unknown damage [1].
    covariance : ndarray, shape (n, n)
        Of all unknowns.
    unknowns : ndarray, shape (n,)
        Deviations of all unknowns; of damages that were dropped, what they would have if they were fitted.
    likely : Alternatives
        Sets of zones that explain the records about as well.
    """

    damage: Vector
    probability: Vector
    covariance: Matrix
    unknowns: Vector
    likely: Alternatives

    @classmethod
    def of(cls, fit: Fit, *, sparse: bool) -> ZonesFound:
        """Gather it; where zones were dropped, over the sets that may be damaged."""
        problem, kept, zones = fit.problem, fit.kept, fit.problem.zones
        A, x = fit.model.A, fit.point.x
        limits = box(problem, x)
        likely = fit.likely if sparse else alternatives(fit.model, limits, drop_zones(fit.model, limits)[0])
        spread = likely.spread if sparse else np.zeros_like(A)
        sets = zip(likely.weight, likely.kept, strict=True) if sparse else [(1.0, kept)]
        covariance = spread + sum(weight * covariance_over(A, some) for weight, some in sets if weight > UNLIKELY)
        deviation = np.sqrt(np.diag(covariance)).copy()
        for k in np.flatnonzero(~kept):
            alone = kept.copy()
            alone[k] = True
            deviation[k] = math.sqrt(covariance_over(A, alone)[k, k] + spread[k, k])
        deviation[:zones] = np.hypot(deviation[:zones], fit.vague)
        return cls(x[:zones], likely.probability[:zones], covariance, deviation, likely)

    def as_fields(self, fit: Fit) -> dict[str, Any]:
        """Return what an answer says of all zones and faults of a fit."""
        problem, zones = fit.problem, self.damage.size
        deviation, damages = self.unknowns[:zones], self.covariance[:zones, :zones].copy()
        np.fill_diagonal(damages, deviation**2)
        groups = fit.zone_groups
        of_faults = zip(problem.model.zones[groups.size :], range(problem.whole, problem.zones), strict=True)
        return {
            "damage": self.damage[groups],
            "deviation": deviation[groups],
            "probability": self.probability[groups],
            "covariance": damages[np.ix_(groups, groups)],
            "faults": tuple(
                FaultFound(
                    name=name,
                    share=float(self.damage[k]),
                    deviation=float(deviation[k]),
                    probability=float(self.probability[k]),
                )
                for name, k in of_faults
            ),
            "explanations": tuple(self._explanations(fit)),
        }

    def _explanations(self, fit: Fit) -> Iterator[tuple[float, tuple[str, ...]]]:
        """Gather sets of damages and faults, the likeliest first."""
        problem, names = fit.problem, np.array(fit.problem.model.zones)
        called = [" and ".join(names[problem.groups == k]) for k in range(problem.zones)]
        more = [" more" * (problem.before is not None and at < problem.whole) for at in range(problem.zones)]
        for k in np.argsort(-self.likely.weight, kind="stable")[:EXPLANATIONS]:
            if self.likely.weight[k] < EXPLAINS:
                return
            x, kept = fit.point.x + self.likely.move[k], np.flatnonzero(self.likely.kept[k][: problem.zones])
            yield float(self.likely.weight[k]), tuple(f"{called[at]} {100.0 * x[at]:.3g} %{more[at]}" for at in kept)


def of_record(problem: RecordProblem, point: Point, deviation: Vector) -> tuple[dict[str, Any], list[str], bool]:
    """Return what an answer says of one record, doubts, and whether its sensors keep to their model.

    ``deviation`` is that of each nuisance, in units of its prior's.
    """
    z, reading = point.x[problem.zones :], problem.reading(point)
    said, most = problem.nuisances.far(z), OFF
    shares: Shares = ()
    offsets: Shares = ()
    if problem.sensor_error is not None:
        known = ""
        if problem.learned_behind and problem.added is None:
            most = OFF_BEHIND
            known = f"; the mesh's error is known behind sensors that are {100.0 * most:g} % off at most"
        shares, offsets = problem.sensor_error.off(problem.record.values, reading, problem.weigh_alone())
        said += [
            f"sensor {k} is {100.0 * share:.2g} % of its range off its model{known}. Check its place, or identify it again"
            for k, share in enumerate(shares, 1)
            if share is not None and share > most
        ]
    fields = {
        "nuisances": problem.nuisances.values(z, deviation),
        "sensor_errors": shares,
        "sensor_offsets": offsets,
        "left_out": tuple(k + 1 for k in range(problem.model.sensors) if k not in problem.record.sensors),
        "samples": problem.values,
        "simulations": problem.simulations,
        "record": problem.record,
        "predicted": reading,
        "strain": problem.felt(point),
    }
    return fields, said, max((share or 0.0 for share in shares), default=0.0) <= most


def untold_zones(fit: Fit) -> tuple[int, ...]:
    """Return the zones, from 1, whose own damage the record cannot tell."""
    free = (np.arange(fit.kept.size) < fit.problem.whole) | fit.kept  # faults that are not there take no zone's place
    everything = np.sqrt(np.diag(covariance_over(fit.model.A, free)))[: fit.problem.whole]
    return tuple(int(k) + 1 for k in np.flatnonzero(everything > UNRESOLVED * PRIOR_DEVIATION))


def names_of(fit: Fit) -> tuple[str, ...]:
    """Return the names of the zones, without those of faults."""
    return fit.problem.model.zones[: fit.zone_groups.size]


def order_of(wiring: Wiring | None, sensors: int) -> tuple[int, ...]:
    """Return which sensors, from 1, were taken for the first, the second, ..."""
    return tuple(k + 1 for k in (range(sensors) if wiring is None else wiring.order))


def together_with(fit: Fit) -> tuple[tuple[str, ...], ...]:
    """Return the names of the other zones of the group of each."""
    names, groups = names_of(fit), fit.zone_groups
    return tuple(
        tuple(names[other] for other in np.flatnonzero(groups == group).tolist() if other != zone)
        for zone, group in enumerate(groups.tolist())
    )


def covariance_over(A: Matrix, free: Rows) -> Matrix:
    """Invert the curvature over some unknowns; zero elsewhere."""
    full = np.zeros_like(A)
    full[np.ix_(free, free)] = np.linalg.pinv(A[np.ix_(free, free)], hermitian=True)
    return full
