"""Run an identified sensor and its compensator through a record, as their FMUs would."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compensator import compensator_model
from ..errors import DataError
from ..sensor import sensor_model
from ..stepper import Stepper
from .preisach import Fit
from .records import Record

Vector = NDArray[np.float64]

REACH = 1.005  # strain beyond full scale by no more than this is clipped, as the sensor does


def predict_output(fit: Fit, record: Record) -> Vector:
    """Return the output that the sensor gives for the strain of a record, shape (m,), starting at rest.

    Raises
    ------
    DataError
        Strain exceeds the sensor's full scale; the line is named.
    """
    beyond = np.flatnonzero(record.strain > REACH * fit.full_scale)
    if beyond.size:
        k = int(beyond[0])
        msg = (
            f"{record.name}, line {record.lines[k]}: strain {record.strain[k]:g} is beyond the full scale "
            f"{fit.full_scale:g} of the sensor. Identify it on a wider range."
        )
        raise DataError(msg)
    strain = np.minimum(record.strain, fit.full_scale)
    sensor = Stepper(
        sensor_model(fit.artifact),
        rest_resistance=0.0,
        full_scale_resistance_change=1.0,
        full_scale_strain=fit.full_scale,
        rest_strain=float(strain[0]),
    )
    return fit.offset + fit.scale * _drive(sensor, record.time, strain, "strain", "resistance")


def recover_strain(fit: Fit, record: Record) -> Vector:
    """Return the strain [1] that the compensator recovers from the output of a record, shape (m,), starting at rest."""
    shift = 10.0  # resistances must be positive; the compensator sees differences only
    compensator = Stepper(
        compensator_model(fit.artifact),
        rest_resistance=shift,
        full_scale_resistance_change=1.0,
        full_scale_strain=fit.full_scale,
        rest_strain=float(min(record.strain[0], fit.full_scale)),
    )
    output = (record.output - fit.offset) / fit.scale + shift
    return _drive(compensator, record.time, output, "resistance", "strain")


def _drive(stepper: Stepper, time: Vector, values: Vector, source: str, result: str) -> Vector:
    stepper.set(source, float(values[0]))
    stepper.initialize()
    found = np.empty(time.size)
    found[0] = stepper.get(result)
    for k in range(1, time.size):
        stepper.set(source, float(values[k]))
        stepper.step(float(time[k] - time[k - 1]))
        found[k] = stepper.get(result)
    return found
