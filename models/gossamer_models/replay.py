"""Run an identified sensor and its compensator through a record, as their FMUs would."""

from __future__ import annotations

import numpy as np

from .arrays import Vector
from .compensator import compensator_model
from .errors import DataError
from .fitting.records import Record
from .sensor import sensor_model
from .sensor.fit import PreisachFit
from .simulate import simulate
from .step_model import StepModel
from .stepper import Stepper

REACH = 1.005  # strain up to this factor of full scale is clipped, as the sensor does
SHIFT = 10.0  # resistance at rest of the models: it must be positive, and only differences from it count


def predict_resistance(fit: PreisachFit, record: Record) -> Vector:
    """Return the resistance that the sensor gives for the strain of a record, shape (m,), starting at rest.

    Raises
    ------
    DataError
        Strain exceeds the full scale of the sensor; the message names the line.
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
    output = _run(sensor_model(fit.artifact), fit, record, "strain", strain, "resistance") - SHIFT
    return fit.rest_resistance + fit.resistance_change * output


def recover_strain(fit: PreisachFit, record: Record) -> Vector:
    """Return the strain [1] that the compensator recovers from the resistance of a record, shape (m,), starting at rest."""
    output = (record.resistance - fit.rest_resistance) / fit.resistance_change + SHIFT
    return _run(compensator_model(fit.artifact), fit, record, "resistance", output, "strain")


def _run(model: StepModel, fit: PreisachFit, record: Record, source: str, values: Vector, result: str) -> Vector:
    """Return one result of a normalised model at the samples of a record, initialized at the first one."""
    stepper = Stepper(model, rest_resistance=SHIFT, full_scale_resistance_change=1.0, full_scale_strain=fit.full_scale)
    stepper.set("rest_strain", float(min(record.strain[0], fit.full_scale)))
    stepper.set(source, float(values[0]))
    stepper.initialize()
    first = stepper.get(result)
    later = simulate(stepper, np.diff(record.time), {source: values[1:]}, [result])[result]
    return np.concatenate([[first], later])
