r"""Identified numbers of one sensor: density tables, relaxation terms and their provenance.

Symbols: ``N`` number of lines and of bins along a line, ``mu[i, k]`` weight [1] of up-switching on line
:math:`\alpha - \beta = i/N` for :math:`k/N < \alpha < (k+1)/N`, ``nu = eta*mu`` weight [1] of down-switching, and per
relaxation term the :math:`a, b, c, d` of Eq. (4.12) and Section 4.2 of the thesis and the exponentials that
stand for :math:`e^{-b t^c}`.
Strain is normalised by its full scale, output by the rise of a virgin sensor to full scale.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Vector
from ..artifacts import read_artifact, write_artifact
from ..errors import ArtifactError, ParameterError
from .drives import Drive
from .residual import Residual
from .tracking import Tracking

SCHEMA = "gossamer.sensor"
VERSION = 1
EXTENDED_VERSION = 2  # with terms that falling strain drives, negative amplitudes, gains, a direct inverse or a filter
MIN_SPRING_WEIGHT = 1e-3  # of mu and nu on line 0: the slope that the inverse divides by is never smaller
METHODS = ("inverse", "estimator", "filter")  # of compensation
DEFAULT_PATH = Path(__file__).with_name("nylon_silver.json")

Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RelaxationTerm:
    r"""One term :math:`A(\zeta) e^{-b t^c}`, :math:`A = a \zeta^d`, of the dynamic operators.

    Attributes
    ----------
    amplitude : float
        :math:`a` [1], not negative.
    power : int
        :math:`d` [1], 0 or 1, see ``Drive``.
    rate : float
        :math:`b` [s**-c], positive.
    exponent : float
        :math:`c` [1], 0 < c <= 1.
    decay_rates : tuple of float, length n
        Rates [1/s] of the exponentials whose sum is :math:`e^{-b t^c}`, positive.
    weights : tuple of float, length n
        Their weights [1], positive; the sum is close to 1.
    drive : {"rising", "falling"}
        The strain that excites the term: rising, as in the thesis, or falling (extension).
    signed : bool
        Whether the amplitude may be negative (extension). The output may then move against the strain, which the exact
        inverse cannot undo; such a sensor needs a direct inverse.
    gain : bool
        Whether the term is multiplied by the present strain (extension): loading then changes the gauge factor, not the
        resistance itself. Such a sensor needs a direct inverse too.
    """

    amplitude: float
    power: int
    rate: float
    exponent: float
    decay_rates: tuple[float, ...]
    weights: tuple[float, ...]
    drive: str = "rising"
    signed: bool = False
    gain: bool = False

    def __post_init__(self) -> None:
        numbers = (self.amplitude, self.rate, self.exponent, *self.decay_rates, *self.weights)
        if not np.isfinite(numbers).all():
            msg = "a relaxation term holds a number that is not finite. Identify it again."
            raise ParameterError(msg)
        _ = self.excitation  # refuses an unknown drive or power
        if self.amplitude < 0.0 and not self.signed:
            msg = f"a relaxation amplitude is {self.amplitude:g}; it must not be negative: the inverse needs a rising output"
            raise ParameterError(msg)
        if not (self.rate > 0.0 and 0.0 < self.exponent <= 1.0):
            msg = f"relaxation exp(-b t**c) needs b > 0 and 0 < c <= 1, not b = {self.rate:g}, c = {self.exponent:g}"
            raise ParameterError(msg)
        if not self.decay_rates or len(self.decay_rates) != len(self.weights):
            msg = f"need one weight per decay rate: {len(self.weights)} != {len(self.decay_rates)}, and at least one"
            raise ParameterError(msg)
        if min(self.decay_rates) <= 0.0 or min(self.weights) < 0.0:
            msg = "decay rates must be positive and their weights not negative. Fit the exponentials again."
            raise ParameterError(msg)

    @property
    def excitation(self) -> Drive:
        """What excites the term."""
        return Drive(self.drive, self.power, self.gain)


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
        for name in self.__slots__:
            if not (value := getattr(self, name)) > 0.0 or not np.isfinite(value):
                msg = f"{name} is {value:g}; the scales of a sensor are positive. Identify it again."
                raise ParameterError(msg)


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
    inverse : DirectInverse or None
        Direct inverse from output to strain, where one was identified (extension); None for the exact inverse.
    residual : Residual or None
        Network that corrects the output (extension); such a sensor has no exact inverse.
    tracking : Tracking or None
        Numbers of the filter of strain, where they were identified; None for ``DEFAULT_TRACKING``.
    compensator : {"inverse", "estimator", "filter"} or None
        Method that the identification chose for the FMU ``compensator``; None for the inverse.
    scales : Scales or None
        Scales of a record in ohm; None for a record without units.
    noise : float or None
        Standard deviation [1] of the white noise of the output in the training stretches, with which the estimator was
        judged; None where it was not measured.
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
    inverse: DirectInverse | None = None
    residual: Residual | None = None
    tracking: Tracking | None = None
    compensator: str | None = None
    scales: Scales | None = None
    noise: float | None = None
    provenance: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.compensator not in (None, *METHODS):
            msg = f"the compensator is {self.compensator!r}; it is one of {', '.join(METHODS)}. Identify the sensor again."
            raise ParameterError(msg)
        if self.noise is not None and not (np.isfinite(self.noise) and self.noise >= 0.0):
            msg = f"the noise is {self.noise:g}; a standard deviation is not negative. Identify the sensor again."
            raise ParameterError(msg)
        shape = (len(self.mu), len(self.mu))
        for name, table in (("mu", self.mu), ("nu", self.nu)):
            try:
                values = np.array(table, dtype=float)
            except (TypeError, ValueError):
                values = np.empty(0)
            if values.shape != shape or shape[0] < 2:
                msg = f"{name} has shape {values.shape}; mu and nu are square, of one size, 2 x 2 or larger"
                raise ParameterError(msg)
            if not np.isfinite(values).all():
                msg = f"{name} holds a number that is not finite. Identify the sensor again."
                raise ParameterError(msg)
            if (lowest := values.min()) < 0.0:
                i, k = np.argwhere(values == lowest)[0]
                msg = (
                    f"{name}[{i}, {k}] is {lowest:g}; a negative weight makes the output fall on rising strain and "
                    "cannot be inverted. Identify it with non-negative least squares."
                )
                raise ParameterError(msg)
            if np.tril(values, -1).any():
                msg = f"{name} is not zero below its diagonal: line i starts at bin k = i. Check the order of indices."
                raise ParameterError(msg)
            if (weakest := values[0].min()) < MIN_SPRING_WEIGHT:
                msg = (
                    f"{name} on the spring line 0 falls to {weakest:g}, below {MIN_SPRING_WEIGHT:g}: too small a slope "
                    "to invert. Give the spring line a larger lower bound."
                )
                raise ParameterError(msg)

    @property
    def exactly_invertible(self) -> bool:
        """Whether the exact inverse exists: no term moves the output against the strain or is a gain, and no network."""
        return self.residual is None and not any(term.signed or term.gain for term in self.relaxation)

    @property
    def n_lines(self) -> int:
        """Number of lines and of bins along a line."""
        return len(self.mu)

    def tables(self) -> tuple[Vector, Vector]:
        """Return ``mu`` and ``nu`` as arrays of shape (N, N)."""
        return np.array(self.mu), np.array(self.nu)

    def write(self, path: Path) -> None:
        """Write the artifact as JSON."""
        extended = self.inverse is not None or any(t.drive != "rising" or t.signed or t.gain for t in self.relaxation)
        content: dict[str, Any] = {"mu": self.mu, "nu": self.nu, "relaxation": [asdict(t) for t in self.relaxation]}
        extended = extended or self.residual is not None or self.tracking is not None or self.compensator is not None
        if not extended:
            for item in content["relaxation"]:
                del item["drive"], item["signed"], item["gain"]
        if self.inverse is not None:
            law = self.inverse.law
            content["inverse"] = {
                "mu": law.mu,
                "nu": law.nu,
                "relaxation": [asdict(t) for t in law.relaxation],
                **{name: getattr(self.inverse, name) for name in ("lowest", "highest", "offset", "scale")},
            }
        if self.residual is not None:
            content["residual"] = asdict(self.residual)
        if self.tracking is not None:
            content["tracking"] = asdict(self.tracking)
        if self.compensator is not None:
            content["compensator"] = self.compensator
        if self.scales is not None:
            content["scales"] = asdict(self.scales)
        if self.noise is not None:
            content["noise"] = self.noise
        write_artifact(path, SCHEMA, EXTENDED_VERSION if extended else VERSION, self.provenance, content)

    @classmethod
    def read(cls, path: Path) -> SensorArtifact:
        """Read what ``write`` wrote.

        Raises
        ------
        ArtifactError
            The file is missing, truncated, of another schema or version, or its content is not a usable sensor.
        """
        card = read_artifact(path, SCHEMA, VERSION, EXTENDED_VERSION)
        try:
            beside = card.get("inverse")
            inverse = None
            if beside is not None:
                numbers = {name: float(beside[name]) for name in ("lowest", "highest", "offset", "scale")}
                inverse = DirectInverse(law=cls(**_parts(beside)), **numbers)
            scales, tracking, noise = (card.get(name) for name in ("scales", "tracking", "noise"))
            return cls(
                **_parts(card),
                inverse=inverse,
                residual=None if card.get("residual") is None else Residual.of(card["residual"]),
                tracking=None if tracking is None else Tracking.of(tracking),
                compensator=card.get("compensator"),
                scales=None if scales is None else Scales(**{name: float(value) for name, value in scales.items()}),
                noise=None if noise is None else float(noise),
                provenance={str(key): str(value) for key, value in card["provenance"].items()},
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            msg = f"{path} does not hold a usable sensor: {error}. Identify it again or name another file."
            raise ArtifactError(msg) from error


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectInverse:
    """Direct inverse: the same kind of operators, driven by the output, whose result is the strain.

    Attributes
    ----------
    law : SensorArtifact
        Operators over the normalised output.
    lowest, highest : float
        Normalised outputs [1] that the range of ``law`` begins and ends with.
    offset, scale : float
        Normalised strain [1] = offset + scale * result of ``law``.
    """

    law: SensorArtifact
    lowest: float
    highest: float
    offset: float
    scale: float

    def __post_init__(self) -> None:
        if not (np.isfinite((self.lowest, self.highest, self.offset, self.scale)).all() and self.lowest < self.highest):
            msg = f"a direct inverse runs from {self.lowest:g} to {self.highest:g}: need a rising range. Identify it again."
            raise ParameterError(msg)


@cache
def default_artifact() -> SensorArtifact:
    """Read the artifact that ships with the package: silver-coated polyamide thread."""
    return SensorArtifact.read(DEFAULT_PATH)


def _freeze(rows: Any) -> Table:  # noqa: ANN401
    return tuple(tuple(float(value) for value in row) for row in rows)


def _parts(card: dict[str, Any]) -> dict[str, Any]:
    relaxation = tuple(_term(item) for item in card["relaxation"])
    return {"mu": _freeze(card["mu"]), "nu": _freeze(card["nu"]), "relaxation": relaxation}


def _term(item: dict[str, Any]) -> RelaxationTerm:
    pairs = {name: tuple(float(value) for value in item[name]) for name in ("decay_rates", "weights")}
    return RelaxationTerm(**{**item, **pairs})
