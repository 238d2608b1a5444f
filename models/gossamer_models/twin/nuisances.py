r"""What a record depends on beside damage, and how well it is known beforehand.

Symbols: ``z`` value of a nuisance in units of its prior's deviation, so that its prior is a normal distribution of mean 0
and deviation 1; ``c`` coefficients of a pressure that is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from ..arrays import Matrix, Vector
from ..errors import ParameterError

# Deviations of the priors: of a logarithm for factors, else in the unit given.
LOAD = {
    "amplitude": ("pressure_amplitude", 0.10),  # factor
    "frequency": ("pressure_frequency", 0.05),  # factor
    "damping": ("mass_damping", math.log(2.0)),  # factor
    "modulus": ("youngs_modulus", 0.02),  # factor
}
PHASE = 0.1  # [rad]
OFFSET = 0.02  # [1], of strain, or of the change of resistance at full scale
GAIN = 0.02  # factor
MODULUS = "modulus"
NAMES = ("offset", "gain", *LOAD, "phase", "pressure")
BEYOND = 5.0  # no nuisance leaves its prior by more deviations
KNOT_SPACING = 0.02  # [s] of the spline of an unknown pressure
DEGREE = 3


@dataclass(frozen=True)
class Nuisances:
    """Nuisances of one fit, in a fixed order: those that the simulation takes, then those of the sensors.

    Attributes
    ----------
    kinds : tuple of str
        Some of ``NAMES``.
    parameters : mapping of str to float
        Of the membrane and its load: values that factors multiply.
    sensors : int
        How many have an offset and a gain of their own.
    length : float
        Time that an unknown pressure lasts [s].
    pressure_deviation : float
        Deviation of its coefficients [Pa].
    """

    kinds: tuple[str, ...]
    parameters: Mapping[str, float]
    sensors: int
    length: float = 0.0
    pressure_deviation: float = 0.0

    def __post_init__(self) -> None:
        for kind in self.kinds:
            if kind not in NAMES:
                msg = f"there is no nuisance {kind!r}. Choose from {', '.join(NAMES)}."
                raise ParameterError(msg)
        if len(set(self.kinds)) < len(self.kinds):
            msg = f"a nuisance is named twice in {', '.join(self.kinds)}. Name each once."
            raise ParameterError(msg)

    @property
    def knots(self) -> int:
        """Coefficients of an unknown pressure."""
        return DEGREE + max(1, math.ceil(self.length / KNOT_SPACING)) if "pressure" in self.kinds else 0

    @property
    def simulated(self) -> tuple[str, ...]:
        """Names of the nuisances that need a simulation each for a derivative."""
        single = tuple(kind for kind in (*LOAD, "phase") if kind in self.kinds)
        return single + tuple(f"pressure[{k + 1}]" for k in range(self.knots))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all, in order."""
        linear = (kind for kind in ("offset", "gain") if kind in self.kinds)
        return self.simulated + tuple(f"{kind}[{k + 1}]" for kind in linear for k in range(self.sensors))

    def moved(self, z: Matrix) -> dict[str, Vector]:
        """Return the membrane's parameters that the nuisances set, for rows of z, shape (m, number of nuisances)."""
        given = {}
        for i, name in enumerate(self.simulated):
            if name in LOAD:
                parameter, deviation = LOAD[name]
                given[parameter] = self.parameters[parameter] * np.exp(deviation * z[:, i])
            elif name == "phase":
                given["pressure_phase"] = self.parameters["pressure_phase"] + PHASE * z[:, i]
        return given

    def pressure(self, z: Matrix, time: Matrix) -> Matrix | None:
        """Return the unknown part of the pressure [Pa] at the given times [s], shape (m, n), or None."""
        if "pressure" not in self.kinds:
            return None
        first = self.simulated.index("pressure[1]")
        c = self.pressure_deviation * z[:, first : first + self.knots]
        return np.asarray(c @ spline_basis(time, self.length, self.knots).T)

    def read(self, y: Matrix, zero: Matrix, scale: Matrix, z: Matrix) -> Matrix:
        """Return what sensors with gain and offset read, shape (m, sensors, n).

        Parameters
        ----------
        y : ndarray, shape (m, sensors, n)
            Strain or resistance.
        zero, scale : ndarray, shape (sensors, 1)
            Values that a gain leaves as they are, and what an offset is a fraction of.
        z : ndarray, shape (m, number of nuisances)
            Nuisances.
        """
        first = len(self.simulated)
        for kind in ("offset", "gain"):
            if kind in self.kinds:
                each = z[:, first : first + self.sensors, None]
                y = y + (OFFSET * scale * each if kind == "offset" else GAIN * each * (y - zero))
                first += self.sensors
        return y

    def values(self, z: Vector, deviation: Vector) -> dict[str, tuple[float, float]]:
        """Return value and deviation of each nuisance: factors for load, damping, modulus and gain; else in units."""
        found = {}
        for name, at, sigma in zip(self.names, z.tolist(), deviation.tolist(), strict=True):
            kind = name.partition("[")[0]
            if kind in LOAD:
                factor = math.exp(LOAD[kind][1] * at)
                found[name] = (factor, factor * LOAD[kind][1] * sigma)
            elif kind == "gain":
                found[name] = (1.0 + GAIN * at, GAIN * sigma)
            else:
                unit = {"phase": PHASE, "offset": OFFSET, "pressure": self.pressure_deviation}[kind]
                found[name] = (unit * at, unit * sigma)
        return found


def spline_basis(time: Vector, length: float, count: int) -> Matrix:
    """Return cubic B-splines on equal knots from 0 to a length [s], shape (n, count)."""
    inner = np.linspace(0.0, length, count - DEGREE + 1)
    knots = np.r_[[0.0] * DEGREE, inner, [length] * DEGREE]
    return np.asarray(BSpline.design_matrix(np.minimum(time, length), knots, DEGREE).toarray())
