r"""What a record depends on beside damage, and how well it is known beforehand.

Symbols: ``z`` value of a nuisance in units of its prior's deviation, so that its prior is a normal distribution of mean 0
and deviation 1; ``c`` coefficients of a load that is unknown; ``m`` rows of nuisances, ``n`` samples.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import shift

from ..arrays import Matrix, Vector
from ..errors import ParameterError, require

# Parameters that a factor multiplies, and the deviation of its logarithm.
FACTORS = {
    "amplitude": ("pressure_amplitude", 0.10),  # and each load of the record
    "frequency": ("pressure_frequency", 0.05),
    "damping": ("mass_damping", math.log(2.0)),
    "modulus": ("youngs_modulus", 0.02),  # of all regions together
    "density": ("density", 0.05),  # of all regions together
    "prestrain": ("edge_displacement", 0.05),
}
PRESSURE = "pressure"  # input that stands for gas where there is none and it stays
# Likewise, of structures that are calibrated; of gas, an input.
STRUCTURAL = {
    "thickness": ("thickness", 0.05),
    "prestress": ("prestress", 0.10),
    "tension": ("tension", 0.10),
    "support": ("support_stiffness", math.log(2.0)),  # of all springs together
    "gas": ("gas_amount", 0.05),
}
SCALES = {**FACTORS, **STRUCTURAL}
OF_BUILT_IN = ("amplitude", "frequency", "phase")  # which acts if its amplitude is not zero
NUMBERS = tuple(name for name in SCALES if name not in OF_BUILT_IN)  # of the structure
PHASE = 0.1  # [rad]
OFFSET = 0.02  # [1], of strain, or of the change of resistance at full scale
GAIN = 0.02  # factor
CLOCK, SPARE = 5.0, 16  # samples by which a record is late, and that are simulated after its end
MODULUS = "modulus"
SENSOR = "sensor"  # the error of sensors that are off their identified model, offset and gain within it
GAINS = "gain"
PLACES = ("place_along", "place_across")  # [m] of each sensor, from its point along its direction and across, if calibrated
LASTING = (GAINS, *PLACES)  # of sensors, the same in all records
OF_SENSOR = ("offset", GAINS)
BY_DEFAULT = ("clock", *OF_SENSOR, *FACTORS, SENSOR)
NAMES = (*BY_DEFAULT, "phase", *STRUCTURAL, *PLACES)  # at which a load sets in is known by default
OF_MOTION = ("clock", "frequency", "damping", "density")
FAR = 2.0  # deviations of its prior by which a nuisance is said to be off
WORDS = {
    "offset": "sensor {at} reads {value:+.2g} more",
    "gain": "sensor {at} has a gain of {value:.3g}",
    "place_along": "sensor {at} is {value:+.2g} mm off along its direction",
    "place_across": "sensor {at} is {value:+.2g} mm off across its direction",
    "clock": "the record is {value:.2g} samples late",
    "phase": "the load has a phase that is {value:+.2g} rad off",
    "amplitude": "the load is {value:.3g} times as large",
    "frequency": "the load has {value:.3g} times the frequency",
    "damping": "the damping is {value:.3g} times as large",
    "modulus": "Young's modulus is {value:.3g} times as large",
    "density": "the density is {value:.3g} times as large",
    "prestrain": "the prestrain is {value:.3g} times as large",
    "thickness": "the thickness is {value:.3g} times as large",
    "prestress": "the prestress is {value:.3g} times as large",
    "tension": "the tension of the edges is {value:.3g} times as large",
    "support": "the supports are {value:.3g} times as stiff",
    "gas": "there is {value:.3g} times as much gas",
}
BEYOND = 5.0  # no nuisance leaves its prior by more deviations
KNOTS = 0.4  # of the first period, between knots of the spline of an unknown load
DEGREE = 3
CLOSED = 1e-6  # of its swing: how far the last value of a load is from the first where a period ends


@dataclass(frozen=True)
class Loads:
    """What acts on a structure while it is recorded.

    Attributes
    ----------
    start : mapping of str to float
        Parameters, and inputs in whose equilibrium the record begins, that differ from those of the model.
    histories : mapping of str to ndarray of shape (n,)
        Inputs at each sample, or in each state.
    exact : tuple of str
        Inputs that act as the record says, but for what a fault takes of them.
    """

    start: Mapping[str, float] = field(default_factory=dict)
    histories: Mapping[str, Vector] = field(default_factory=dict)
    exact: tuple[str, ...] = ()

    @property
    def scalable(self) -> tuple[str, ...]:
        """Inputs that change and whose histories may have an unknown factor."""
        return tuple(name for name, values in self.histories.items() if np.ptp(values) > 0.0 and name not in self.exact)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadTable:
    """Loads and motions of a structure: over time, again and again, or in some states of rest.

    Attributes
    ----------
    values : mapping of str to tuple of float, length n
        By the names of the model's inputs, in its units.
    time : tuple of float, length n
        Times [s] from 0; none where these are n states.
    """

    values: Mapping[str, tuple[float, ...]]
    time: tuple[float, ...] = ()

    @classmethod
    def stored(cls, content: Mapping[str, Any] | None) -> LoadTable | None:
        """Make it of what ``asdict`` gave, or None of None."""
        if content is None:
            return None
        values = {name: tuple(map(float, load)) for name, load in content["values"].items()}
        return cls(values=values, time=tuple(map(float, content["time"])))

    @property
    def states(self) -> int:
        """How many states of rest there are."""
        return 0 if self.time else len(next(iter(self.values.values())))

    @property
    def length(self) -> float:
        """Time after which all is repeated [s]: that of the last values if they are the first again, else a step later."""
        closed = all(abs(load[-1] - load[0]) <= CLOSED * np.ptp(load) for load in self.values.values())
        return self.time[-1] + (0.0 if closed else float(np.median(np.diff(self.time))))

    def loads(self, samples: int, h: float) -> Loads:
        """Return the loads at some samples of a step [s], which begin at rest under the first ones; or in all states."""
        if self.states:
            return Loads(histories={name: np.array(load) for name, load in self.values.items()})
        at = h * np.arange(1.0, samples + 1.0)
        histories = {name: np.interp(at, self.time, load, period=self.length) for name, load in self.values.items()}
        return Loads({name: load[0] for name, load in self.values.items()}, histories)


@dataclass(frozen=True)
class Spread:
    """How well factors are known together.

    Attributes
    ----------
    names : tuple of str
        Some of ``SCALES``, and gains and places of all sensors or of none, ``gain[1]``, ....
    covariance : ndarray, shape (k, k)
        Of the logarithms of the factors, of the gains, and of the places [m].
    gains : tuple of float
        These gains [1].
    """

    names: tuple[str, ...]
    covariance: Matrix
    gains: tuple[float, ...] = ()

    @property
    def of_structure(self) -> Spread:
        """The same without gains and places."""
        at = [k for k, name in enumerate(self.names) if number_of(name) not in LASTING]
        return Spread(tuple(self.names[k] for k in at), self.covariance[np.ix_(at, at)])

    def root(self, names: Sequence[str]) -> Matrix:
        """Return the lower triangular root of the covariance of some of them, shape (n, n)."""
        at = [self.names.index(name) for name in names]
        return np.asarray(np.linalg.cholesky(self.covariance[np.ix_(at, at)]))


@dataclass(frozen=True)
class Nuisances:
    """Nuisances of one fit, in a fixed order: those that the simulation takes, then those of the sensors.

    Attributes
    ----------
    kinds : tuple of str
        Some of ``NAMES``, or names of inputs of the model whose histories are unknown.
    parameters : mapping of str to float
        Of the model: values that factors multiply.
    inputs : mapping of str to float
        Inputs of the model with their values at the start.
    sensors : int
        How many have an offset, a gain and a place of their own.
    loads : Loads
        What is known of the loads.
    length, period : float
        Time that an unknown load lasts, and the first period, of which the knots of its spline are ``KNOTS`` apart [s].
    spread : Spread or None
        How well some factors are known, in place of the deviations of ``SCALES``.
    slopes : ndarray, shape (2, sensors, n or more), or None
        How the strain changes along each sensor's direction, and across [1/m]; needed where places are nuisances.

    Raises
    ------
    ParameterError
        There is no such nuisance, it is named twice, or it has nothing to act on.
    """

    kinds: tuple[str, ...]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    sensors: int
    loads: Loads = field(default_factory=Loads)
    length: float = 0.0
    period: float = math.inf
    spread: Spread | None = None
    slopes: Matrix | None = None

    def __post_init__(self) -> None:
        check_names(self.kinds, self.inputs)
        for kind in self.kinds:
            if kind in (*SCALES, "phase") and kind not in dict.fromkeys(k.partition("[")[0] for k in self.simulated):
                load = kind in OF_BUILT_IN
                what = "no built-in load, and the record has no load that changes" if load else f"no {kind}"
                msg = f"{kind!r} cannot be fitted: the membrane has {what}. Leave it out, or set it."
                raise ParameterError(msg)
            if kind in self.inputs and not self._deviation(kind) > 0.0:
                msg = f"the size of the load {kind!r} is not known. Give it a start value that is as large as it may be."
                raise ParameterError(msg)

    @property
    def knots(self) -> int:
        """Coefficients of an unknown load."""
        return DEGREE + max(1, math.ceil(self.length / (KNOTS * self.period)))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Inputs whose histories are unknown."""
        return tuple(kind for kind in self.kinds if kind in self.inputs)

    @property
    def scaled(self) -> tuple[str, ...]:
        """Inputs whose histories have an unknown factor."""
        return self.loads.scalable if "amplitude" in self.kinds else ()

    @property
    def simulated(self) -> tuple[str, ...]:
        """Names of the nuisances that need a simulation each for a derivative."""
        each = (kind for of in (*SCALES, "phase") for kind in self.kinds if number_of(kind) == of)
        names = [kind for kind in each if _acts(kind, self._scalable)]
        names += [f"amplitude[{name}]" for name in self.scaled]
        return (*names, *(f"{name}[{k + 1}]" for name in self.unknown for k in range(self.knots)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all, in order."""
        each = (kind for kind in ("offset", *LASTING) if kind in self.kinds)
        late = ("clock",) if "clock" in self.kinds else ()
        return (*self.simulated, *late, *(f"{kind}[{k + 1}]" for kind in each for k in range(self.sensors)))

    def moved(self, z: Matrix) -> dict[str, Vector]:
        """Return the parameters, and inputs at the start, of rows of z, shape (m, number of nuisances)."""
        given = {name: np.full(len(z), value) for name, value in self.loads.start.items()}
        values = {**self._scalable, **self.loads.start}
        given |= {parameter: factor * values[parameter] for parameter, factor in self._factors(z).items()}
        if "phase" in self.simulated:
            given["pressure_phase"] = self.parameters["pressure_phase"] + PHASE * z[:, self.simulated.index("phase")]
        for name, factor in self._scales(z).items():
            given[name] = factor * self.loads.start.get(name, self.inputs[name])
        return given

    @property
    def _scalable(self) -> dict[str, float]:
        """Parameters and inputs that factors multiply, with their values."""
        return _staying({**self.parameters, **self.inputs}, self.loads)

    def _factors(self, z: Matrix) -> dict[str, Vector]:
        """Return the factors on parameters and inputs of the structure, shape (m,)."""
        names, root = self._root
        f = sum(number_of(name) in SCALES for name in names)
        logs = dict(zip(names[:f], root[:f, :f] @ z[:, :f].T, strict=True))
        return {parameter: np.exp(log) for name, log in logs.items() for parameter in scaled_by(name, self._scalable)}

    @cached_property
    def _root(self) -> tuple[tuple[str, ...], Matrix]:
        """Factors, which come first, gains and places among the nuisances, and their ``root_of``."""
        names = tuple(name for name in self.names if number_of(name) in (*SCALES, *LASTING))
        return names, root_of(names, self.spread)

    def _of_root(self, z: Matrix) -> Matrix:
        """Return the columns of factors, gains and places of rows of z, shape (m, n)."""
        f = sum(number_of(name) in SCALES for name in self._root[0])
        last = len(self._root[0]) - f
        return np.hstack([z[:, :f], z[:, z.shape[1] - last :]])

    def _lasting(self, kind: str, z: Matrix) -> Matrix:
        """Return gains above those known, or places of one of ``PLACES`` [m], of rows of z, shape (m, sensors)."""
        names, root = self._root
        rows = [name.partition("[")[0] == kind for name in names]
        return np.asarray(self._of_root(z) @ root[rows].T) if any(rows) else np.zeros((len(z), self.sensors))

    def _gains(self, z: Matrix) -> Matrix:
        """Return the gains above 1 of rows of z, shape (m, sensors)."""
        known = np.array(self.spread.gains) - 1.0 if self.spread is not None and self.spread.gains else 0.0
        return np.asarray(known + self._lasting(GAINS, z))

    def histories(self, z: Matrix, time: Vector) -> dict[str, Matrix]:
        """Return the loads at the given times [s], shape (n,), or (m, n) where they depend on nuisances.

        A load whose known part has fewer samples stays what it was.
        """
        known = {name: np.asarray(values) for name, values in self.loads.histories.items()}
        found = {name: values[np.minimum(np.arange(time.size), values.size - 1)] for name, values in known.items()}
        of_structure = {name: factor for name, factor in self._factors(z).items() if name in found}
        for name, factor in [*of_structure.items(), *self._scales(z).items()]:
            found[name] = factor[:, None] * found[name]
        for name in self.unknown:
            at = self.simulated.index(f"{name}[1]")
            c = self._deviation(name) * z[:, at : at + self.knots]
            load = found.get(name, self.loads.start.get(name, self.inputs[name]))
            found[name] = np.asarray(load + c @ spline_basis(time, self.length, self.knots).T)
        return found

    def read(self, y: Matrix, zero: Matrix, scale: Matrix, z: Matrix) -> Matrix:
        """Return what sensors with place, delay, gain and offset read, shape (m, sensors, n).

        Parameters
        ----------
        y : ndarray, shape (m, sensors, n)
            Strain or resistance.
        zero, scale : ndarray, shape (sensors, 1)
            Values that a gain leaves as they are, and what an offset is a fraction of.
        z : ndarray, shape (m, number of nuisances)
            Nuisances.
        """
        at = len(self.simulated)
        for kind, slope in zip(PLACES, () if self.slopes is None else self.slopes, strict=False):
            y = y + self._lasting(kind, z)[:, :, None] * slope[:, : y.shape[2]]
        if "clock" in self.kinds:
            rows = zip(np.broadcast_to(y, (len(z), *y.shape[1:])), CLOCK * z[:, at], strict=True)
            y = np.stack([shift(row, (0.0, late), mode="nearest") if late else row for row, late in rows])
            at += 1
        if "offset" in self.kinds:
            y = y + OFFSET * scale * z[:, at : at + self.sensors, None]
        gains = self._gains(z)
        return y + gains[:, :, None] * (y - zero) if gains.any() else y

    def values(self, z: Vector, deviation: Vector) -> dict[str, tuple[float, float]]:
        """Return value and deviation of each nuisance: factors for load, damping, modulus and gain; else in units."""
        names, root = self._root
        kinds, logs = np.array([number_of(name) for name in names], dtype=object), root @ self._of_root(z[None])[0]
        factors = np.where(np.isin(kinds, PLACES), logs, np.exp(logs))
        if GAINS in kinds:
            factors[kinds == GAINS] = 1.0 + self._gains(z[None])[0]
        spread = np.where(np.isin(kinds, LASTING), 1.0, factors) * np.sqrt(root**2 @ self._of_root(deviation[None])[0] ** 2)
        found = dict(zip(names, zip(factors.tolist(), spread.tolist(), strict=True), strict=True))
        for name, at, sigma in zip(self.names, z.tolist(), deviation.tolist(), strict=True):
            kind = name.partition("[")[0]
            if name in found:
                continue
            if kind in FACTORS:  # of the loads of the record
                factor = math.exp(FACTORS[kind][1] * at)
                found[name] = (factor, factor * FACTORS[kind][1] * sigma)
            else:
                of_load = name.rpartition("[")[0]
                unit = {"phase": PHASE, "offset": OFFSET, "clock": CLOCK}.get(kind) or self._deviation(of_load)
                found[name] = (unit * at, unit * sigma)
        return found

    def told(self, names: Iterable[str], z: Vector) -> list[str]:
        """Say what some nuisances are."""
        values, factor = self.values(z, np.zeros(z.size)), dict.fromkeys(PLACES, 1e3)  # in mm
        split = [(name, *name.removesuffix("]").partition("[")) for name in names]
        return [
            WORDS[kind].format(at=at, value=factor.get(kind, 1.0) * values[name][0])
            + f" ({name})" * (bool(at) and number_of(name) in SCALES)
            for name, kind, _, at in split
            if kind in WORDS
        ]

    def far(self, z: Vector) -> list[str]:
        """Say which nuisances are further off than expected."""
        return self.told((name for name, at in zip(self.names, z.tolist(), strict=True) if abs(at) > FAR), z)

    def _scales(self, z: Matrix) -> dict[str, Vector]:
        """Return the factors of the loads of the record, shape (m,)."""
        at = {name: self.simulated.index(f"amplitude[{name}]") for name in self.scaled}
        return {name: np.exp(FACTORS["amplitude"][1] * z[:, i]) for name, i in at.items()}

    def _deviation(self, load: str) -> float:
        """Return the prior's deviation of the coefficients of an unknown load: as large as what is known of any like it."""
        sizes = [abs(self.inputs[load]), abs(self.loads.start.get(load, 0.0))]
        sizes += [float(np.abs(values).max()) for name, values in self.loads.histories.items() if name == load]
        if load == "pressure":
            sizes.append(self.parameters.get("pressure_amplitude", 0.0))
        return max(sizes)


def root_of(names: Sequence[str], spread: Spread | None) -> Matrix:
    """Return what turns factors, gains and places in units of their priors into logarithms, gains above 1, and metres.

    Shape (n, n); how far off places may be, a spread alone tells.
    """
    root = np.diag([SCALES[number_of(name)][1] if number_of(name) in SCALES else GAIN for name in names])
    if spread is not None:
        known = [name for name in names if name in spread.names]
        at = [names.index(name) for name in known]
        root[np.ix_(at, at)] = spread.root(known)
    return root


def number_of(name: str) -> str:
    """Return what of ``SCALES`` a nuisance is, also if it is that of one region or support alone, like ``modulus[2]``."""
    kind, _, place = name.partition("[")
    return kind if not place or place[:-1].isdigit() else name


def possible(parameters: Mapping[str, float], loads: Loads, spread: Spread | None = None) -> tuple[str, ...]:
    """Return those of ``NAMES`` that have something to act on, in parts where they are known in parts.

    ``parameters`` has inputs too.
    """
    found = []
    for name in _possible(parameters, loads):
        names = () if spread is None else spread.names
        parts = [each for each in names if each != name and number_of(each) == name and name in SCALES]
        found += parts or [name]
    return tuple(found)


def _possible(parameters: Mapping[str, float], loads: Loads) -> tuple[str, ...]:
    parameters = _staying(parameters, loads)
    return tuple(name for name in NAMES if _acts(name, parameters) or (name == "amplitude" and loads.scalable))


def _acts(kind: str, parameters: Mapping[str, float]) -> bool:
    """Tell whether a nuisance acts on some parameter, or on the sensors."""
    if kind in OF_BUILT_IN and not parameters.get("pressure_amplitude", 0.0) > 0.0:
        return False
    return number_of(kind) not in SCALES or any(parameters[name] for name in scaled_by(kind, parameters))


def _staying(numbers: Mapping[str, float], loads: Loads) -> dict[str, float]:
    """Return numbers without the pressure if that is a load of the record, which has a factor of its own."""
    changes = np.ptp(loads.histories.get(PRESSURE, np.zeros(1))) > 0.0
    return {name: value for name, value in numbers.items() if not (name == PRESSURE and changes)}


def scaled_by(kind: str, parameters: Mapping[str, float]) -> list[str]:
    """Return the parameters that a factor multiplies, of all regions or of one, or the one that is a factor itself."""
    array, place = SCALES[number_of(kind)][0], kind.partition("[")[2]
    if place:
        return [name for name in parameters if name == f"{array}[{place}"]
    if kind == "gas" and array not in parameters:
        return [name for name in parameters if name == PRESSURE]
    return [name for name in parameters if name.partition("[")[0] in (array, f"{array}_factor")]


def check_names(kinds: Sequence[str], inputs: Collection[str] = ()) -> None:
    """Raise ``ParameterError`` unless each kind is one of ``NAMES``, or an input, and stands once."""
    for kind in kinds:
        if number_of(kind) not in NAMES and kind not in inputs:
            loads = f", and the loads {', '.join(list(inputs)[:8])}" if inputs else ""
            msg = f"there is no nuisance {kind!r}. Choose from {', '.join(NAMES)}{loads}."
            raise ParameterError(msg)
    require(len(set(kinds)) == len(kinds), f"a nuisance is named twice in {', '.join(kinds)}. Name each once.")


def spline_basis(time: Vector, length: float, count: int) -> Matrix:
    """Return cubic B-splines on equal knots from 0 to a length [s], shape (n, count)."""
    inner = np.linspace(0.0, length, count - DEGREE + 1)
    knots = np.r_[[0.0] * DEGREE, inner, [length] * DEGREE]
    return np.asarray(BSpline.design_matrix(np.minimum(time, length), knots, DEGREE).toarray())
