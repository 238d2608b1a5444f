"""A stored sensor judged on records that it was not fitted to: errors, beside those of a static cubic.

The sensor is not fitted. With its own scales a record is predicted as the FMUs would. With those of the record,
``scales.py``, they are fitted to the first stretch of it, and the rest is what counts. The cubic is fitted
to the same first stretch of every record, so it knows more than a sensor without fitted scales.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from gossamer_files import digest
from gossamer_files.charts import Chart
from gossamer_files.options import option
from gossamer_files.plots import save_charts

from ..arrays import Rows, Vector
from ..artifacts import artifact_schema
from ..automatic.compare import HERE, Interval, beside, cubic, error_interval
from ..errors import ArtifactError
from ..fitting.errors import nrmse
from ..fitting.reading import Columns, read_records
from ..fitting.records import Record, judged_rows, training_rows
from ..plots import BAND, ModelledRecord, record_files
from ..replay import REACH, clipped_strain, recover, sensor_output, table_path, write_predictions
from ..sensor import Scales, SensorArtifact
from .scales import RelaxingScales, fit_scales, hardly_overlapping

RIGHT = 0.05  # share of the errors that a normal distribution leaves beyond the band
TOO_SURE = 0.5  # stated over true deviation, below which it is said
LEAST_JUDGED = 0.25  # share of a record that must lie before its first strain beyond the full scale


@dataclass(frozen=True, kw_only=True)
class Judged(ModelledRecord):
    """One record and what a sensor makes of it; the cubic and fitted scales know its first stretch.

    Attributes
    ----------
    scales : RelaxingScales or None
        Its fitted scales; None where the sensor's own were used.
    cubic, cubic_strain : ndarray, shape (m,)
        Resistance [ohm] and strain [1] by static cubics.
    known : bool
        Whether the sensor was fitted to this file.
    elsewhere : tuple of str
        Where it fills little of the ranges that the sensor was identified on, a sentence each.
    clipped : tuple of str
        Where recovered strain stands at a limit of the range of the sensor, a sentence each.
    """

    scales: RelaxingScales | None
    cubic: Vector
    cubic_strain: Vector
    known: bool = False
    elsewhere: tuple[str, ...] = ()
    clipped: tuple[str, ...] = ()

    def stretches(self) -> dict[str, Rows]:
        """Return the first stretch and the rest, where there is one, by name."""
        named = (self.fitted or "first", self.first), ("judged", ~self.first)
        return {name: rows for name, rows in named if rows.any()}

    def judged(self) -> Rows:
        """Return the samples after the first stretch, or this one where there is no more."""
        return self.stretches().get("judged", self.first)

    def forward(self, rows: Rows, predicted: Vector | None = None) -> float:
        """Return the error of the sensor's resistance, or of another one, on some samples [% of range]."""
        of = self.predicted if predicted is None else predicted
        return nrmse(self.record.resistance[rows], of[rows], float(np.ptp(self.record.resistance)))

    def strain(self, rows: Rows, recovered: Vector) -> float:
        """Return the error of a recovered strain on some samples, but for those not delivered [% of range]."""
        rows = rows & np.isfinite(recovered)
        return nrmse(self.record.strain[rows], recovered[rows], float(np.ptp(self.record.strain)))

    def deviation_ratio(self, rows: Rows, name: str) -> float | None:
        """Return the root mean square of the stated deviation over that of the true error [1], where one is stated."""
        stated, found = self.recovered[name].deviation, self.recovered[name].strain
        if stated is None:
            return None
        rows = rows & np.isfinite(found)
        true = float(np.mean((found[rows] - self.record.strain[rows]) ** 2))
        return float(np.sqrt(np.mean(stated[rows] ** 2) / true)) if true > 0.0 else None

    def too_sure(self) -> tuple[str, ...]:
        """Say which compensators state deviations far below their errors on the judged stretch."""
        rows, said = self.judged(), []
        for name, found in self.recovered.items():
            ratio = self.deviation_ratio(rows, name)
            if found.deviation is None or ratio is None or not ratio < TOO_SURE:
                continue
            error, reach = np.abs(found.strain - self.record.strain), BAND * found.deviation
            beyond = float(np.mean((error > reach)[rows & np.isfinite(error)]))
            if beyond <= RIGHT:  # a few large errors, not a narrow band
                continue
            said.append(
                f"{self.record.name}: the deviation that {name} states is {ratio:.2g} of the true one: "
                f"{100.0 * beyond:.0f} % of the errors leave the band of ± {BAND:g} deviations; "
                f"{100.0 * RIGHT:g} % would be right."
            )
        return tuple(said)

    def defeats(self) -> tuple[str, ...]:
        """Say where the sensor is no better than the static cubic."""
        compared = {"resistance": "predicts resistance"} | dict.fromkeys(self.recovered, "recovers strain")
        said = []
        for name, (own, its) in self.intervals().items():
            if words := beside(its, HERE if name == "resistance" else name, own):
                said.append(f"{self.record.name}: a cubic {compared[name]} {words}.")
        return tuple(said)

    def intervals(self) -> dict[str, tuple[Interval, Interval]]:
        """Return the errors on the judged stretch of the sensor and of the cubic, with intervals of confidence.

        Returns
        -------
        dict of str to tuple of Interval
            NRMSE [% of range] of "resistance", and of the strain by each compensator that delivers any there, by its name.
        """
        record, rows = self.record, self.judged()
        cubic = (error_interval(record.resistance, self.cubic, rows), error_interval(record.strain, self.cubic_strain, rows))
        found = {"resistance": (error_interval(record.resistance, self.predicted, rows), cubic[0])}
        for name, each in self.recovered.items():
            delivered = rows & np.isfinite(each.strain)
            if delivered.any():
                found[name] = error_interval(record.strain, each.strain, delivered), cubic[1]
        return found

    def sentences(self) -> tuple[str, ...]:
        """Say how the record was repaired, how it relates to what the sensor knows, and where a static cubic is as good."""
        name, defeats = self.record.name, self.defeats()
        said = list(self.record.repaired)
        if self.known:
            said.append(f"{name} is a record that the sensor was fitted to: its errors say little of others.")
        said += [*self.elsewhere, *self.clipped, *self.too_sure(), *defeats]
        if defeats and self.scales is None:
            advice = f"find its own scales ({option('fit_scales', True)})"
            said.append(f"{name}: its sensor may be mounted or drifted otherwise; {advice}.")
        return tuple(said)


def judge_files(
    sensor: Path,
    paths: Sequence[Path],
    *,
    columns: Columns | None = None,
    compensators: Sequence[str] = (),
    own_scales: bool = False,
    stretch: str = "50%",
    recognised: Callable[[Sequence[Record]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Judged, ...]:
    """Judge a stored sensor on records without fitting it.

    Parameters
    ----------
    sensor : Path
        Artifact of a Preisach sensor.
    paths : sequence of Path
        CSV files, one record each.
    columns : Columns or None
        Columns to read, with their units.
    compensators : sequence of str
        What recovers strain, see ``replay.recover``; the one that the artifact names by default, else the inverse.
    own_scales : bool
        Fit gain, offset and what was still relaxing of each record to its first stretch.
    stretch : str
        That first stretch, see ``training_rows``.
    recognised : callable
        Called with the records before anything is computed.
    progress : callable
        Called with a sentence on the progress.

    Returns
    -------
    tuple of Judged
        One for each record.

    Raises
    ------
    ArtifactError
        The artifact cannot be read, or is of a model without a compensator.
    DataError
        A record cannot be read, exceeds the sensor's range early, or does not follow it.
    ParameterError
        There is no such compensator for this sensor.
    """
    artifact = read_sensor(sensor)
    offset, gain, full_scale = scales_of(artifact, sensor)
    compensators = compensators or (artifact.compensator or "inverse",)
    whole = read_records(paths, columns)
    read = tuple(_at_reference(up_to_full_scale(record, full_scale), artifact, offset, gain) for record in whole)
    recognised(read)
    judged = []
    for path, record, its_file in zip(paths, read, whole, strict=True):
        progress(f"judging {record.name}")
        first = training_rows(record, stretch, end=float(its_file.time[-1]))
        output = sensor_output(artifact, full_scale, record)
        scales = fit_scales(output, record, first) if own_scales else None
        gains, offsets = (gain, offset) if scales is None else (scales.gain, scales.offset)
        normalised = (record.resistance - offsets) / gains
        recovered = {name: recover(artifact, full_scale, record, normalised, name) for name in compensators}
        rest = judged_rows(first)
        clipped = (clipped_strain(record, found, full_scale, rest) for found in recovered.values())
        judged.append(
            Judged(
                record=record,
                first=first,
                stretch="stretch to which the scales are fitted" if scales else "first stretch",
                fitted="scales fitted" if scales else "",
                predicted=offsets + gains * output,
                recovered=recovered,
                clipped=tuple(filter(None, clipped)),
                scales=scales,
                cubic=cubic((record.strain,), (record.resistance,), (first,))[0],
                cubic_strain=cubic((record.resistance,), (record.strain,), (first,))[0],
                known=digest(path) in artifact.provenance.get("sha256", ""),
                elsewhere=hardly_overlapping(record, offset, gain, full_scale, own_scales=own_scales),
            )
        )
    return tuple(judged)


def up_to_full_scale(record: Record, full_scale: float) -> Record:
    """Return a record up to its first strain beyond the full scale [1] of a sensor, and say so in its repairs.

    What a sensor remembers of strain beyond the range that it was identified on is not known. The record itself is returned
    if there is no such strain, or if less than ``LEAST_JUDGED`` of it would be left; no sensor can be run through that one.
    """
    beyond = np.flatnonzero(record.strain > REACH * full_scale)
    if not beyond.size or beyond[0] < LEAST_JUDGED * record.time.size:
        return record
    k = int(beyond[0])
    text = (
        f"only the {k} of {record.time.size} samples before line {record.lines[k]} are judged: strain reaches "
        f"{record.strain[k]:g} there, beyond the full scale {full_scale:g} of the sensor, and what it does from there on "
        "was not identified"
    )
    return replace(record.at(np.arange(k)), repairs=(*record.repairs, text))


def _at_reference(record: Record, artifact: SensorArtifact, offset: float, gain: float) -> Record:
    """Return a record with the resistance that it would have at the temperature of the artifact, and say so."""
    warm = artifact.temperature
    if warm is None or record.temperature is None:
        return record
    R = warm.undone(record.resistance, record.temperature, offset, gain)
    text = f"its resistance is brought to {warm.reference:.1f} K, at which the sensor was identified"
    return replace(record, resistance=R, repairs=(*record.repairs, text))


def read_sensor(path: Path) -> SensorArtifact:
    """Read a Preisach sensor; refuse a fractional one by name, and say how to make one that is not there."""
    if not path.exists():
        msg = f"there is no sensor {path}. Make it with 'gossamer identify', or name another file."
        raise ArtifactError(msg)
    if artifact_schema(path) == "gossamer.fractional":
        msg = f"{path} holds a fractional model, which recovers no strain. Judge a sensor of {option('model', 'preisach')}."
        raise ArtifactError(msg)
    return SensorArtifact.read(path)


def scales_of(artifact: SensorArtifact, path: Path) -> tuple[float, float, float]:
    """Return resistance at rest and its rise to full scale [ohm] and full scale [1] of the record a sensor was fitted to."""
    if artifact.scales is not None:
        scales: Scales = artifact.scales
        return scales.rest_resistance, scales.full_scale_resistance_change, scales.full_scale_strain
    try:
        offset, scale, full = (float(artifact.provenance[name]) for name in ("offset", "scale", "full_scale_strain"))
    except (KeyError, ValueError):
        msg = f"{path} does not say the scales of its record. Identify it again with gossamer identify."
        raise ArtifactError(msg) from None
    return offset, scale, full


def save_judged(judged: Sequence[Judged], folder: Path, *, pictures: bool = True, form: str = "png") -> list[Path]:
    """Write predictions as CSV, and pictures of resistance, recovered strain and residuals; return the paths."""
    paths = []
    drawn: dict[str, Chart] = {}
    for each in judged:
        path, fitted = table_path(folder, each.record.name), each.first & bool(each.fitted)
        paths.append(write_predictions(path, each.record, each.predicted, _cells(each), fitted))
        if pictures:
            drawn |= record_files(each)
    return [*paths, *save_charts(drawn, folder, form)]


def _cells(each: Judged) -> Mapping[str, Vector]:
    cells: dict[str, Vector] = {}
    for name, found in each.recovered.items():
        cells[f"recovered strain by {name}"] = found.strain
        if found.deviation is not None:
            cells[f"its deviation by {name}"] = found.deviation
    return cells
