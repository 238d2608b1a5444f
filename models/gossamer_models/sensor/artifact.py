r"""Identified numbers of one sensor: density tables, relaxation terms and their provenance.

Symbols: ``N`` number of lines and of bins along a line, ``mu[i, k]`` weight [1] of up-switching on line
:math:`\alpha - \beta = i/N` for :math:`k/N < \alpha < (k+1)/N`, ``nu = eta*mu`` weight [1] of down-switching, and per
relaxation term (``drives.py``) the :math:`a, b, c, d` of Eq. (4.12) and Section 4.2 of the thesis and the exponentials
that stand for :math:`e^{-b t^c}`. Strain is normalised by its full scale, output by the rise of a virgin sensor to full
scale.

A small network may correct the output by what the memory shows: ``X`` features of a sensor's state over their trained range,
-1 to 1 [1]; hidden units ``a`` [1]; ``r`` what it gives [1],

.. math:: a = \tanh(W X + c), \qquad r = B \tanh(w \cdot a / B), \qquad
   G = \max(0,\, 1 - \sum_i \max(|X_i| - 1, 0) / m).

The bound ``B`` limits it. The correction of the output is ``G r``: the gate ``G`` is 1 within the range that the network was
trained in, and 0 where the features together leave it by more than the margin m of half of their range: there the physics
stands alone. To the networks of a direct inverse (``direct.py``) features beyond that range are at its ends.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from functools import cache
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np

from ..arrays import Vector
from ..artifacts import read_as, write_artifact
from ..errors import require
from .drives import RelaxationTerm
from .hysteresis import across

MARGIN = 0.5  # m [1]
SCHEMA = "gossamer.sensor"
VERSION = 1
FILTER = "the numbers of a filter"
MIN_SPRING_WEIGHT = 1e-3  # of mu and nu on line 0: the slope that the inverse divides by is never smaller
METHODS = ("inverse", "estimator", "filter")  # of compensation
DEFAULT_PATH = Path(__file__).with_name("nylon_silver.json")

Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModel:
    """Error of a model as a random process: white noise plus a part that is slowly forgotten.

    Attributes
    ----------
    white, slow : float
        Standard deviations [1] of the two parts, positive.
    time : float
        Correlation time [s] of the slow part, positive.
    """

    white: float
    slow: float
    time: float

    def __post_init__(self) -> None:
        _positive(self, FILTER, "white", "slow", "time")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """Numbers of a filter of strain.

    Attributes
    ----------
    output : ErrorModel
        Error of the output that the sensor's model predicts.
    inverse : ErrorModel or None
        Error of the strain that the direct inverse gives; None where the filter does not use it.
    rate : float
        Speed of strain [1/s] that it exceeds half of the time in which it moves.
    hold : float
        Share of the time [1] in which strain rests, below 1.
    turns : float
        Sudden changes of its rate per second [1/s].
    wander : float
        Change of its rate between them, standard deviation after one second [1/s].
    tail : float
        Degrees of freedom [1] of the errors' Student distribution: the smaller, the less a single sample counts.
    factor, floor : float
        Stated deviation = square root of (factor times that of the hypotheses) squared plus floor squared [1].
    """

    output: ErrorModel
    inverse: ErrorModel | None = None
    rate: float = 0.1
    hold: float = 0.1
    turns: float = 0.1
    wander: float = 0.03
    tail: float = 30.0
    factor: float = 1.0
    floor: float = 1e-3

    def __post_init__(self) -> None:
        _positive(self, FILTER, "rate", "turns", "wander", "tail", "factor", "floor")
        share = "the share of time at rest is 0 or more and below 1"
        require(0.0 <= self.hold < 1.0, f"hold is {self.hold:g}; {share}. Identify the sensor again.")


def _positive(owner: object, what: str, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        require(0.0 < value < np.inf, f"{name} is {value:g}; {what} are positive. Identify the sensor again.")


DEFAULT_TRACKING = Tracking(output=ErrorModel(white=3e-3, slow=5e-3, time=10.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallNetwork:
    """Weights of a network with one hidden layer.

    Attributes
    ----------
    lowest, highest : tuple of float, length F
        Range of each feature in training [1].
    hidden : tuple of tuples of float, shape (H, F)
        W [1].
    bias, out : tuple of float, length H
        c and w [1].
    bound : float
        B [1], positive.

    Raises
    ------
    ParameterError
        The shapes do not fit together, or a number is not finite.
    """

    lowest: tuple[float, ...]
    highest: tuple[float, ...]
    hidden: tuple[tuple[float, ...], ...]
    bias: tuple[float, ...]
    out: tuple[float, ...]
    bound: float

    def __post_init__(self) -> None:
        F, H = len(self.lowest), len(self.hidden)
        sizes = [len(self.highest), *(len(row) for row in self.hidden)] == [F] * (H + 1) and len(self.bias) == H
        numbers = np.concatenate([np.ravel(getattr(self, each.name)) for each in fields(self)]) if sizes else [np.nan]
        require(
            sizes and len(self.out) == H and np.isfinite(numbers).all() and self.bound > 0.0,
            f"the network of {F} features and {H} units is not complete. Identify the sensor again.",
        )

    def place(self, features: ca.MX) -> ca.MX:
        """Return X [1] of features [1], shape (F,) or (F, P)."""
        low, half = ca.DM(self.lowest), 0.5 * (ca.DM(self.highest) - ca.DM(self.lowest))
        return (features - across(low, features)) / across(half, features) - 1.0

    def value(self, X: ca.MX) -> ca.MX:
        """Return r [1], scalar or shape (1, P)."""
        a = ca.tanh(ca.mtimes(ca.DM(self.hidden), X) + across(ca.DM(self.bias), X))
        return self.bound * ca.tanh(ca.mtimes(ca.DM(self.out).T, a) / self.bound)

    def correction(self, features: ca.MX) -> ca.MX:
        """Return G r [1], scalar or shape (1, P), from features [1], shape (F,) or (F, P)."""
        X = self.place(features)
        return ca.fmax(1.0 - ca.sum1(ca.fmax(ca.fabs(X) - 1.0, 0.0)) / MARGIN, 0.0) * self.value(X)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Scales of one identified sensor's normalised strain and output: start values of the parameters of its FMUs.

    Attributes
    ----------
    rest_resistance : float
        Resistance [ohm] of the unstrained sensor at rest, positive.
    full_scale_resistance_change : float
        Its static rise [ohm] on the first loading to full scale, positive.
    full_scale_strain : float
        Strain [1] at the end of the identified range, positive.
    """

    rest_resistance: float
    full_scale_resistance_change: float
    full_scale_strain: float

    def __post_init__(self) -> None:
        _positive(self, "the scales of a sensor", *self.__slots__)


@dataclass(frozen=True, slots=True, kw_only=True)
class TemperatureEffect:
    """How gain and offset of a sensor follow temperature, linear in its difference from a reference.

    Attributes
    ----------
    reference : float
        Temperature [K] at which the artifact was identified, positive.
    gain : float
        Relative change of the output [1/K].
    offset : float
        Change of the output at rest [1/K].
    """

    reference: float
    gain: float
    offset: float

    def __post_init__(self) -> None:
        _positive(self, "absolute temperatures", "reference")
        finite = np.isfinite(self.gain) and np.isfinite(self.offset)
        require(finite, "the effect of temperature is no finite number. Identify the sensor again.")

    def undone(self, R: Vector, temperature: Vector, rest: float, change: float) -> Vector:
        """Return resistance [ohm] at temperatures [K], shape (m,), as at the reference, by that at rest and its rise."""
        dT = temperature - self.reference
        return rest + (R - rest - change * self.offset * dT) / (1.0 + self.gain * dT)


@dataclass(frozen=True, kw_only=True)
class SensorArtifact:
    r"""Everything that distinguishes one sensor from another, normalised.

    Attributes
    ----------
    mu, nu : tuple of tuples of float, shape (N, N)
        Weights [1] of up- and down-switching; row i is the line :math:`\alpha - \beta = i/N`, column k the bin of
        :math:`\alpha`; zero for k < i, nowhere negative.
    relaxation : tuple of RelaxationTerm
        Terms of the dynamic operators; empty for a rate-independent sensor.
    fading : float
        :math:`\kappa` of ``law.py``: share of what the operators remember that a unit of normalised strain erases [1], not
        negative (extension); 0 in the thesis.
    inverse : DirectInverse or None
        Direct inverse from output to strain, where one was identified (extension); None for the exact inverse.
    residual : SmallNetwork or None
        It corrects the output (extension); such a sensor has no exact inverse.
    tracking : Tracking or None
        Numbers of the filter of strain, where they were identified; None for ``DEFAULT_TRACKING``.
    compensator : {"inverse", "estimator", "filter"} or None
        Method that the identification chose for the FMU ``compensator``; None for the inverse.
    scales : Scales or None
        Scales of a record in ohm; None for a record without units.
    noise : float or None
        Standard deviation [1] of the white noise of the output in the training stretches, with which the estimator was
        judged; None where it was not measured.
    error : float or None
        What the model misses of the worst test stretch, root mean square as a share of its range [1]; None without one.
    temperature : TemperatureEffect or None
        What temperature does to the output; None where the records held none, or told nothing of it.
    provenance : dict
        Origin and digest of the data, command, errors reached, assumptions.

    Raises
    ------
    ParameterError
        A table is not square and triangular, holds a negative or non-finite number, or the spring line (i = 0) is
        too weak to invert.
    """

    mu: Table
    nu: Table
    relaxation: tuple[RelaxationTerm, ...] = ()
    fading: float = 0.0
    inverse: DirectInverse | None = None
    residual: SmallNetwork | None = None
    tracking: Tracking | None = None
    compensator: str | None = None
    scales: Scales | None = None
    noise: float | None = None
    error: float | None = None
    temperature: TemperatureEffect | None = None
    provenance: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        again = "Identify the sensor again."
        methods = ", ".join(METHODS)
        require(
            self.compensator in (None, *METHODS), f"the compensator is {self.compensator!r}; it is one of {methods}. {again}"
        )
        require(0.0 <= self.fading < np.inf, f"the fading is {self.fading:g}; it is not negative. {again}")
        require(
            self.noise is None or 0.0 <= self.noise < np.inf,
            f"the noise is {self.noise}; a standard deviation is not negative. {again}",
        )
        require(
            self.error is None or 0.0 < self.error < np.inf, f"the error is {self.error}; a deviation is positive. {again}"
        )
        trained = self.inverse is None or (self.inverse.networks and bool(self.inverse.ahead) == bool(self.inverse.later))
        require(trained, f"the direct inverse lacks networks. {again}")
        for name, table in (("mu", self.mu), ("nu", self.nu)):
            _check_table(name, table, (len(self.mu), len(self.mu)))

    @property
    def exactly_invertible(self) -> bool:
        """Whether the exact inverse exists: nothing moves the output against the strain, no gain, no fading, no network."""
        return self.residual is None and not self.fading and not any(term.signed or term.gain for term in self.relaxation)

    def states_deviation(self, method: str | None) -> bool:
        """Tell whether a compensator states its deviation: not where its numbers were not identified."""
        method = method or self.compensator
        if method == "filter":
            return self.tracking is not None
        return method == "estimator" or (method != "exact" and self.inverse is not None and self.inverse.floor > 0.0)

    @property
    def n_lines(self) -> int:
        """Number of lines and of bins along a line."""
        return len(self.mu)

    def tables(self) -> tuple[Vector, Vector]:
        """Return ``mu`` and ``nu`` as arrays of shape (N, N)."""
        return np.array(self.mu), np.array(self.nu)

    def write(self, path: Path) -> None:
        """Write the artifact as JSON."""
        content = {name: value for name, value in asdict(self).items() if value is not None}
        write_artifact(path, SCHEMA, VERSION, content.pop("provenance"), content)

    @classmethod
    def read(cls, path: Path) -> SensorArtifact:
        """Read what ``write`` wrote.

        Raises
        ------
        ArtifactError
            The file is missing, truncated, of another schema or version, or its content is not a usable sensor.
        """
        return read_as(cls, "sensor", path, SCHEMA, VERSION)


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectInverse:
    """Direct inverse: operators that the output drives, and networks that read the strain from their memory, ``direct.py``.

    Attributes
    ----------
    lowest, highest : float
        Normalised outputs [1] of training: between them the output counts from 0 to 1.
    widths, times : tuple of float
        Half widths of the plays [1], times of the low-passes [s].
    networks : tuple of SmallNetwork
        Each gives the present normalised strain [1] less one half; their mean counts. Empty before they are trained.
    ahead : tuple of int
        How many samples later than a strain the outputs are that tell it, increasing; empty for none.
    step : float
        Samples of ``ahead`` are no closer than this [s].
    later : tuple of SmallNetwork
        Give the strain that is as old as the last of ``ahead``.
    factor, floor : float
        Of the stated deviation, see ``DirectLaw.deviation`` [1]; both 0 where it was not calibrated.
    """

    lowest: float
    highest: float
    widths: tuple[float, ...]
    times: tuple[float, ...]
    networks: tuple[SmallNetwork, ...] = ()
    ahead: tuple[int, ...] = ()
    step: float = 0.0
    later: tuple[SmallNetwork, ...] = ()
    factor: float = 0.0
    floor: float = 0.0

    def __post_init__(self) -> None:
        again = "Identify it again."
        numbers = (self.lowest, self.highest, *self.widths, *self.times, self.step, self.factor, self.floor)
        positive = min((*self.widths, *self.times), default=1.0) > 0.0 <= min(self.step, self.factor, self.floor)
        increasing = all(a < b for a, b in pairwise((0, *self.ahead)))
        require(
            np.isfinite(numbers).all() and positive and increasing and self.lowest < self.highest,
            f"a direct inverse needs a rising range, positive numbers and increasing samples. {again}",
        )
        n = 1 + len(self.widths) + len(self.times)
        for networks, count in ((self.networks, n), (self.later, n + len(self.ahead))):
            fits = all(len(each.lowest) == count for each in networks)
            require(fits, f"the networks of a direct inverse see {count} features. {again}")


@cache
def default_artifact() -> SensorArtifact:
    """Read the artifact that ships with the package: silver-coated polyamide thread."""
    return SensorArtifact.read(DEFAULT_PATH)


def _check_table(name: str, table: Table, shape: tuple[int, int]) -> None:
    """Refuse a table of another shape, or one that cannot be inverted."""
    try:
        values = np.array(table, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    require(
        values.shape == shape and shape[0] > 1,
        f"{name} has shape {values.shape}; mu and nu are square, of one size, 2 x 2 or larger",
    )
    require(np.isfinite(values).all(), f"{name} holds a number that is not finite. Identify the sensor again.")
    lowest, weakest = values.min(), values[0].min()
    i, k = np.argwhere(values == lowest)[0]
    require(
        lowest >= 0.0,
        f"{name}[{i}, {k}] is {lowest:g}; a negative weight makes the output fall on rising strain and cannot be inverted. "
        "Identify it with non-negative least squares.",
    )
    require(
        not np.tril(values, -1).any(),
        f"{name} is not zero below its diagonal: line i starts at bin k = i. Check the order of indices.",
    )
    require(
        weakest >= MIN_SPRING_WEIGHT,
        f"{name} on the spring line 0 falls to {weakest:g}, below {MIN_SPRING_WEIGHT:g}: too small a slope to invert. Give "
        "the spring line a larger lower bound.",
    )
