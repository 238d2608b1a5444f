"""SYNTHETIC Dataset-1, -2 and -3, and a long random history, measured on the virtual specimen.

The thesis prints its experiments as pictures only. We assume their strain and times (Section 2.1): ramps of 50 s. Every
record starts with a fully recovered specimen.

The observations of Section 2.1, in Dataset-1 and in % of its range of 620 ohm: (1) the loop is anticlockwise, (2) 7.7 wide
on average in the first cycle and 5.8 in the second, (3) which lies 5.4 higher, while resistance at zero strain climbs to 8.8
and 12.0; (4) the width at half strain is 2.4, 9.3 and 13.5 at 0.05, 0.15 and 0.45 %/s; (5) at rest 12.0 relaxes to 3.2 in
200 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from gossamer_models.arrays import Vector
from gossamer_models.errors import ParameterError

from .material import VirtualSpecimen

SAMPLING_STEP = 0.5  # [s]
RAMP = 50.0  # [s]
NOISE = 1.5  # [ohm], standard deviation: 0.24 % of the range of Dataset-1; real records show 0.1 to 0.25 %
STRAIN_1, STRAIN_2 = 0.075, 0.15  # [1] at 0.15 %/s and 0.30 %/s
SLOWEST, FASTEST = 0.0005, 0.003  # [1/s] of a random history
NAMES = {1: "Dataset-1 (synthetic)", 2: "Dataset-2 (synthetic)", 3: "Dataset-3 (synthetic)"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Dataset:
    """One SYNTHETIC record; arrays are read-only.

    Attributes
    ----------
    name : str
        Name, for titles; it contains the word synthetic.
    description : str
        Strain history of the specimen.
    time : ndarray, shape (n,)
        Time [s], in equal steps.
    strain : ndarray, shape (n,)
        Strain [1], exact.
    resistance : ndarray, shape (n,)
        Resistance [ohm] with noise.
    noise_free : ndarray, shape (n,)
        Resistance [ohm] without noise; for evaluation, not for fitting.
    rest_resistance : float
        Resistance [ohm] before the record; the models' output is the change from it.
    train_until : float
        End [s] of the stretch for fitting; 0 for a record for evaluation only.
    """

    name: str
    description: str
    time: Vector
    strain: Vector
    resistance: Vector
    noise_free: Vector
    rest_resistance: float
    train_until: float

    @property
    def train(self) -> slice:
        """Samples for fitting: those before ``train_until``."""
        return slice(0, int(np.searchsorted(self.time, self.train_until)))

    @property
    def test(self) -> slice:
        """Samples after the stretch for fitting."""
        return slice(self.train.stop, self.time.size)

    @property
    def resistance_change(self) -> Vector:
        """Measured change of resistance [ohm] against the specimen at rest, shape (n,)."""
        return self.resistance - self.rest_resistance


@cache
def dataset(number: int) -> Dataset:
    """Measure one of the three SYNTHETIC datasets.

    Parameters
    ----------
    number : int
        1: two triangles to 7.5 % at 0.15 %/s, then no strain from 200 s to 400 s. 2: two triangles to 15 % at 0.30 %/s.
        3: four triangles to 7.5 % at 0.15 %/s.

    Returns
    -------
    Dataset
        801, 401 and 801 samples, 0.5 s apart; fits use the first 200 s of Dataset-1 or -3; Dataset-2 is for evaluation.

    Raises
    ------
    ParameterError
        There is no such dataset.
    """
    if number not in NAMES:
        msg = f"there is no Dataset-{number}. Choose 1, 2 or 3."
        raise ParameterError(msg)
    cycles, top, end, train = {1: (2, STRAIN_1, 400.0, 200.0), 2: (2, STRAIN_2, 200.0, 0.0), 3: (4, STRAIN_1, 400.0, 200.0)}[
        number
    ]
    corners = RAMP * np.arange(2 * cycles + 1)
    peaks = top * (np.arange(2 * cycles + 1) % 2)
    rest = ", then no strain to 400 s" if end > corners[-1] else ""
    text = f"SYNTHETIC: {cycles} triangles to {top:.1%} in ramps of {RAMP:g} s{rest}"
    time = _clock(round(end / SAMPLING_STEP) + 1)
    return _measure(NAMES[number], text, time, np.interp(time, corners, peaks), train_until=train, seed=number)


@cache
def random_reversals(samples: int = 4001, *, seed: int = 55) -> Dataset:
    """Measure a long SYNTHETIC history of random reversals, to evaluate compensators as Section 5.5 does.

    Parameters
    ----------
    samples : int, optional
        Number of samples, 0.5 s apart, 2 or more.
    seed : int, optional
        Of the history and of the noise.

    Returns
    -------
    Dataset
        Ramps between random strains of 0 to 7.5 % at random rates of 0.05 to 0.30 %/s; the first half is for fitting.

    Raises
    ------
    ParameterError
        Fewer than two samples.
    """
    if samples < 2:
        msg = f"a history of {samples} samples has no reversals. Choose 2 samples or more."
        raise ParameterError(msg)
    rng = np.random.default_rng(seed)
    time = _clock(samples)
    corners, turns = [0.0], [0.0]
    while corners[-1] < time[-1]:
        turns.append(rng.uniform(0.0, STRAIN_1))
        corners.append(corners[-1] + abs(turns[-1] - turns[-2]) / rng.uniform(SLOWEST, FASTEST))
    text = f"SYNTHETIC: random reversals between 0 and {STRAIN_1:.1%} at {SLOWEST:.2%}/s to {FASTEST:.2%}/s, seed {seed}"
    strain = np.interp(time, corners, turns)
    return _measure("Random reversals (synthetic)", text, time, strain, train_until=time[-1] / 2, seed=seed)


def _clock(samples: int) -> Vector:
    """Return the times [s] of that many samples; a half is exact in binary."""
    time: Vector = np.arange(samples, dtype=np.float64)
    time *= SAMPLING_STEP
    return time


def _measure(name: str, text: str, time: Vector, strain: Vector, *, train_until: float, seed: int) -> Dataset:
    """Stretch the specimen and read the meter: white noise, the size of which does not depend on the record."""
    specimen = VirtualSpecimen()
    exact = specimen.resistance(time, strain)
    read = exact + NOISE * np.random.default_rng(seed).standard_normal(time.size)
    for array in (time, strain, exact, read):
        array.setflags(write=False)
    return Dataset(
        name=name,
        description=f"{text}; noise of {NOISE:g} ohm",
        time=time,
        strain=strain,
        resistance=read,
        noise_free=exact,
        rest_resistance=specimen.params.rest_resistance,
        train_until=train_until,
    )
