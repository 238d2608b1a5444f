"""Run an identified sensor and its compensator through a record, as their FMUs would; what they give as a CSV file."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from gossamer_files import replacing

from .arrays import Rows, Vector
from .compensator import compensator_model
from .errors import DataError
from .fitting.records import Record, noise_of, without_delay
from .sensor import SensorArtifact, sensor_model
from .sensor.fit import PreisachFit
from .step_model import StepModel
from .stepper import Stepper, simulate

REACH = 1.005  # strain up to this factor of full scale is clipped, as the sensor does
MANY_CLIPPED = 0.05  # share of samples at a limit of the range from which their error says too little
AT_LIMIT, APART_FROM_IT = (1e-6, 0.01)  # of full scale: a recovered strain that stands at a limit, a true one that does not
SHIFT = 10.0  # resistance at rest of the models: it must be positive, and only differences from it count


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovered:
    """Strain that a compensator recovers from the resistance of a record.

    Attributes
    ----------
    strain : ndarray, shape (m,)
        At the times of the record [1]: the delay of the compensator is taken back; not a number where it is not delivered
        before the record ends.
    present : ndarray, shape (m,)
        Without delay [1].
    deviation : ndarray, shape (m,), or None
        Standard deviation that the compensator states [1]; None for one that states none, and for a filter whose numbers
        were not identified.
    delay : float
        Delay of the compensator at the end of the record [s].
    """

    strain: Vector
    present: Vector
    deviation: Vector | None = None
    delay: float = 0.0

    def late(self, record: Record) -> int:
        """Return the delay in samples of the record."""
        return round(self.delay / float(np.median(np.diff(record.time))))


def clipped_strain(record: Record, recovered: Recovered, full_scale: float, rows: Rows) -> str:
    """Say how many samples of a recovered strain stand at a limit of the range although the true one does not.

    Parameters
    ----------
    record : Record
        The record.
    recovered : Recovered
        What is recovered from its resistance.
    full_scale : float
        Strain [1] at the end of the range, which begins at 0.
    rows : ndarray of bool, shape (m,)
        Samples to look at.

    Returns
    -------
    str
        A sentence; empty where they are few.
    """
    rows = rows & np.isfinite(recovered.strain)
    strain, true = recovered.strain[rows], record.strain[rows]
    clipped = [
        (np.abs(strain - limit) <= AT_LIMIT * full_scale) & (np.abs(true - limit) > APART_FROM_IT * full_scale)
        for limit in (0.0, full_scale)
    ]
    share = float(np.mean(clipped[0] | clipped[1])) if strain.size else 0.0
    if share <= MANY_CLIPPED:
        return ""
    return (
        f"{record.name}: {100.0 * share:.0f} % of the recovered samples stand at a limit of the range, 0 or "
        f"{100.0 * full_scale:.4g} % strain, and the true strain does not: without this limit the error would be larger."
    )


def predict_resistance(fit: PreisachFit, record: Record) -> Vector:
    """Return the resistance that the sensor gives for the strain of a record, shape (m,), starting at rest.

    Raises
    ------
    DataError
        Strain exceeds the full scale of the sensor; the message names the line.
    """
    return fit.rest_resistance + fit.resistance_change * sensor_output(fit.artifact, fit.full_scale, record)


def recover_by_fit(fit: PreisachFit, record: Record, method: str | None = None, *, fill: bool = True) -> Recovered:
    """Return the strain that a compensator recovers from the resistance of a record, starting at rest.

    Parameters
    ----------
    fit, record
        The sensor, and a record of it.
    method : str or None
        As for ``recover``.
    fill : bool
        Whether the last samples, for which the record ends before the strain is delivered, have the present strain; else
        they are not a number.
    """
    output = (record.resistance - fit.rest_resistance) / fit.resistance_change
    found = recover(fit.artifact, fit.full_scale, record, output, method)
    if not fill:
        return found
    late = np.isnan(found.strain)
    deviation = found.deviation
    if deviation is not None and not late.all():
        deviation = np.where(late, deviation[~late][-1], deviation)
    return replace(found, strain=np.where(late, found.present, found.strain), deviation=deviation)


def sensor_output(artifact: SensorArtifact, full_scale: float, record: Record) -> Vector:
    """Return the normalised output [1] that a sensor gives for the strain of a record, shape (m,), starting at rest.

    Parameters
    ----------
    artifact : SensorArtifact
        The sensor.
    full_scale : float
        Strain [1] at the end of its range.
    record : Record
        The record.

    Raises
    ------
    DataError
        Strain exceeds the full scale of the sensor; the message names the line.
    """
    beyond = np.flatnonzero(record.strain > REACH * full_scale)
    if beyond.size:
        k = int(beyond[0])
        msg = (
            f"{record.name}, line {record.lines[k]}: strain {record.strain[k]:g} is beyond the full scale "
            f"{full_scale:g} of the sensor. Identify it on a wider range."
        )
        raise DataError(msg)
    strain = np.minimum(record.strain, full_scale)
    return _run(sensor_model(artifact), full_scale, record, "strain", strain, ["resistance"])["resistance"] - SHIFT


def recover(
    artifact: SensorArtifact, full_scale: float, record: Record, output: Vector, method: str | None = None
) -> Recovered:
    """Return the strain that a compensator recovers from a normalised output, starting at rest at the first strain.

    Parameters
    ----------
    artifact, full_scale, record
        As for ``sensor_output``.
    output : ndarray, shape (m,)
        Normalised output [1] at the samples of the record.
    method : str or None
        As for ``compensator_model``.

    Raises
    ------
    ParameterError
        The method is unknown or cannot compensate this sensor.
    """
    model = compensator_model(artifact, method)  # type: ignore[arg-type]
    noise = 0.0  # the model of a filter has its own
    if (method or artifact.compensator) == "estimator":
        noise = noise_of(output) if artifact.noise is None else artifact.noise
    more = [name for name in ("present_strain", "strain_deviation", "delay") if name in model.names]
    results = _run(model, full_scale, record, "resistance", output + SHIFT, ["strain", *more], noise=noise)
    strain, deviation = results["strain"], results.get("strain_deviation")
    if not artifact.states_deviation(method):
        deviation = None
    if "delay" not in results:
        return Recovered(strain=strain, present=strain, deviation=deviation)
    return Recovered(
        strain=without_delay(record.time, results["delay"], strain),
        present=results["present_strain"],
        deviation=None if deviation is None else without_delay(record.time, results["delay"], deviation),
        delay=float(results["delay"][-1]),
    )


def _run(
    model: StepModel, full_scale: float, record: Record, source: str, values: Vector, results: list[str], **parameters: float
) -> dict[str, Vector]:
    """Return results of a normalised model at the samples of a record, initialized at the first one."""
    stepper = Stepper(model, rest_resistance=SHIFT, full_scale_resistance_change=1.0, full_scale_strain=full_scale)
    for name, value in parameters.items():
        if name in model.names:
            stepper.set(name, value)
    stepper.set("rest_strain", float(min(record.strain[0], full_scale)))
    stepper.set(source, float(values[0]))
    stepper.initialize()
    first = {name: stepper.get(name) for name in results}
    later = simulate(stepper, np.diff(record.time), {source: values[1:]}, results)
    return {name: np.concatenate([[first[name]], later[name]]) for name in results}


def table_path(folder: Path, name: str) -> Path:
    """Return where the predictions of a record of a name go."""
    return folder / f"{Path(name).stem}_predicted.csv"


def write_predictions(path: Path, record: Record, predicted: Vector, recovered: Mapping[str, Vector], fitted: Rows) -> Path:
    """Write a record beside what a model makes of it; return the path.

    Parameters
    ----------
    path : Path
        File to write.
    record : Record
        The record.
    predicted : ndarray, shape (m,)
        Resistance [ohm] for its strain.
    recovered : mapping of str to ndarray, shape (m,)
        Further columns [1] by their names: strain from its resistance, and its standard deviation where one is stated. A
        cell is empty where the value is not a number.
    fitted : ndarray of bool, shape (m,)
        Samples that something was fitted to.
    """
    unit = "" if record.unit is None else f" [{record.unit}]"
    names = ("time [s]", "strain [1]", f"resistance{unit}", f"predicted{unit}", *(f"{name} [1]" for name in recovered))
    columns = (record.time, record.strain, record.resistance, predicted, *recovered.values())
    with replacing(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*names, "fitted"])
        for row, used in zip(np.column_stack(columns).tolist(), fitted.tolist(), strict=True):
            writer.writerow([*("" if np.isnan(value) else f"{value:.9g}" for value in row), int(used)])
    return path
