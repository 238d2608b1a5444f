"""Run an identified sensor and its compensator through a record, as their FMUs would."""

from __future__ import annotations

from dataclasses import dataclass

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
    output = _run(sensor_model(fit.artifact), fit, record, "strain", strain, "resistance")["resistance"] - SHIFT
    return fit.rest_resistance + fit.resistance_change * output


@dataclass(frozen=True, kw_only=True)
class Recovered:
    """Strain that a compensator recovers from the resistance of a record.

    Attributes
    ----------
    strain : ndarray, shape (m,)
        Strain [1] at the time for which it holds: a delay is taken back, the last samples are present strains.
    present : ndarray, shape (m,)
        Strain [1] without delay.
    deviation : ndarray or None, shape (m,)
        Standard deviation [1] of the error of ``strain`` that the compensator states; None if it states none.
    delay : float
        Delay [s] that was taken back, at the end of the record.
    """

    strain: Vector
    present: Vector
    deviation: Vector | None = None
    delay: float = 0.0


def recover(fit: PreisachFit, record: Record, method: str | None = None, *, noise: float = 0.0) -> Recovered:
    """Return the strain that a compensator recovers from the resistance of a record, starting at rest.

    Parameters
    ----------
    fit : PreisachFit
        The sensor.
    record : Record
        Its resistance.
    method : {"inverse", "estimator", "filter"} or None
        See ``compensator_model``; None for the one that the artifact names.
    noise : float
        Standard deviation of the resistance's white noise [ohm], for estimator and filter.
    """
    output = (record.resistance - fit.rest_resistance) / fit.resistance_change + SHIFT
    model = compensator_model(fit.artifact, method)  # type: ignore[arg-type]
    if "delay" not in model.names:
        strain = _run(model, fit, record, "resistance", output, "strain")["strain"]
        return Recovered(strain=strain, present=strain)
    names = ("strain", "present_strain", "strain_deviation", "delay")
    late = _run(model, fit, record, "resistance", output, *names, noise=noise / fit.resistance_change)
    lag, size = late["delay"][-1], record.time.size
    M = int(size - np.searchsorted(record.time, record.time[-1] - lag + 1e-9 * lag))
    present = late["present_strain"]
    moved = {
        name: np.concatenate([late[name][M:], last])
        for name, last in (("strain", present[size - M :]), ("strain_deviation", late["strain_deviation"][size - M :]))
    }
    return Recovered(strain=moved["strain"], present=present, deviation=moved["strain_deviation"], delay=float(lag))


def recover_strain(fit: PreisachFit, record: Record) -> Vector:
    """Return the strain [1] of ``recover`` with the method that the artifact names."""
    return recover(fit, record).strain


def _run(
    model: StepModel, fit: PreisachFit, record: Record, source: str, values: Vector, *results: str, **given: float
) -> dict[str, Vector]:
    """Return results of a normalised model at the samples of a record, initialized at the first one."""
    scales = {"rest_resistance": SHIFT, "full_scale_resistance_change": 1.0, "full_scale_strain": fit.full_scale}
    stepper = Stepper(model, **scales, **given)
    stepper.set("rest_strain", float(min(record.strain[0], fit.full_scale)))
    stepper.set(source, float(values[0]))
    stepper.initialize()
    first = {name: stepper.get(name) for name in results}
    later = simulate(stepper, np.diff(record.time), {source: values[1:]}, results)
    return {name: np.concatenate([[first[name]], later[name]]) for name in results}
