"""The SYNTHETIC specimen on the vibrating membrane, and a sensor that is identified from one calibration of it.

The membrane strains its sensors by up to 20 % within 60 ms, the datasets the specimen by 7.5 % within 50 s. The specimen of
this file is therefore that of the datasets a thousand times as fast and for three times the strain; nothing else is chosen.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from gossamer_models.arrays import Matrix, Vector
from gossamer_models.batch import Batch
from gossamer_models.fitting import Record
from gossamer_models.membrane import MembraneParams, membrane_model
from gossamer_models.membrane.square import stretch
from gossamer_models.sensor import SensorArtifact
from gossamer_models.sensor.fit import PreisachSettings, fit_preisach

from .material import SpecimenParams, VirtualSpecimen

FASTER, WIDER = 1000.0, 3.0
NOISE = 1e-3  # of the range of resistance
MOUNTED = np.linspace(0.0, 1.0, 41)  # [s] from the unstrained sensor to the moment that the load sets in
LOADED = 0.1  # [s] until the sensor has the prestrain
STEP, STEPS, TRAINED = 3e-4, 2000, 1000  # of the calibration


def flown_resistance(strain: Matrix, h: float) -> Matrix:
    """Return the resistance [ohm] of specimens under the strains of a membrane, shape (n, 4, steps), with noise."""
    found = np.array([[_resistance(row, h)[MOUNTED.size :] for row in case] for case in strain])
    random = np.random.default_rng(len(strain))
    return np.asarray(found + NOISE * np.ptp(found) * random.standard_normal(found.shape))


@cache
def calibrated_sensor() -> tuple[SensorArtifact, float]:
    """Identify a sensor from 0.3 s of a healthy membrane under 1.1 times the load, beside a strain gauge.

    Returns
    -------
    SensorArtifact
        Modified Preisach, M = P = 7.
    float
        Its error on the next 0.3 s [% of range].
    """
    load = {"pressure_amplitude": 1.1 * MembraneParams().pressure_amplitude}
    strain = Batch(membrane_model(), ("strain[1]",)).run(STEPS, STEP, load).results[0, 0]
    (time, whole), resistance = _mounted(strain, STEP), _resistance(strain, STEP)
    resistance = resistance + NOISE * np.ptp(resistance) * np.random.default_rng(5).standard_normal(resistance.size)
    lines = np.arange(time.size, dtype=int) + 2
    record = Record(name="calibration (synthetic)", time=time, strain=whole, resistance=resistance, lines=lines)
    train = np.arange(time.size) < MOUNTED.size + TRAINED
    fit = fit_preisach((record,), (train,), PreisachSettings.of("preisach", ridge="auto"), rest_resistance=resistance[0])
    return fit.artifact, fit.errors[1].nrmse


def _mounted(strain: Vector, h: float) -> tuple[Vector, Vector]:
    """Return time [s] and strain of a sensor that is stretched to the prestrain, rests, and then follows a history."""
    prestrain = stretch(MembraneParams()) - 1.0
    before = prestrain * np.minimum(MOUNTED / LOADED, 1.0)
    time = MOUNTED[-1] + h * np.arange(1, strain.size + 1)
    return np.concatenate([MOUNTED, time]), np.concatenate([before, strain])


def _resistance(strain: Vector, h: float) -> Vector:
    """Return the resistance [ohm] of the specimen while it is mounted and then follows a history."""
    p = SpecimenParams()
    fast = {name: FASTER * getattr(p, name) for name in ("breaking_rate", "mending_rate")}
    wide = {name: WIDER * getattr(p, name) for name in ("overstrain_scale", "force_scale")}
    specimen = VirtualSpecimen(replace(p, relaxation_time=p.relaxation_time / FASTER, **fast, **wide))
    return specimen.resistance(*_mounted(strain, h))
