"""Measured records as they are told and kept; what the twin is fitted to: results of a run, or a table."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.inputs import followed, keep
from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, ResultsError, require

from .arguments import AnyPath, assigned
from .options import TwinOptions
from .results import print_tables
from .working import TERMINAL, talk

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.arrays import Vector
    from gossamer_models.fitting import Record
    from gossamer_models.membrane import Structure
    from gossamer_models.twin import Calibration, ResponseRecord

KINDS = ("strain", "resistance")
OFF_GRID = 1e-3  # steps

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class KnownRecord:
    """A record and what is known about where it comes from.

    Attributes
    ----------
    record : ResponseRecord
        Histories.
    structure : Structure
        The membrane.
    parameters : mapping of str to float
        Parameters of the membrane, and inputs at the start, that differ from its start values.
    sensor_parameters : mapping of str to list of float
        Parameters of the sensors, one value for each.
    calibration : Calibration or None
        What is known of the structure from healthy records.
    of_run : bool
        Whether it comes from the results of a run, so that its mesh is that of the membrane.
    """

    record: ResponseRecord
    structure: Structure
    parameters: Mapping[str, float] = field(default_factory=dict)
    sensor_parameters: Mapping[str, list[float]] = field(default_factory=dict)
    calibration: Calibration | None = None
    of_run: bool = False

    def twin(self, sensor: AnyPath | None = None) -> dict[str, Any]:
        """Return what a twin of the record is made of: its membrane, and for resistance its sensors.

        Parameters
        ----------
        sensor : path, optional
            Artifact of the sensors; by default the shipped one.
        """
        from gossamer_models.sensor import SensorArtifact, default_artifact

        structure, calibration = self.structure, self.calibration
        if self.of_run and structure.setup.calibration is not None:  # a simulation reads what there is: gains are of gauges
            setup = replace(structure.setup, calibration=structure.setup.calibration.of_structure)
            structure = replace(structure, setup=setup)
        known: dict[str, Any] = {"structure": structure, "parameters": self.parameters}
        known |= {} if calibration is None else {"calibration": calibration}
        if self.record.kind == "strain":
            return known
        found = default_artifact() if sensor is None else SensorArtifact.read(Path(sensor))
        return known | {"sensor": found, "sensor_parameters": self.sensor_parameters}


def find_record(path: Path, options: TwinOptions, stop: float | None = None) -> KnownRecord:
    """Read a record.

    Parameters
    ----------
    path : Path
        Results of a run, their folder, or a CSV file with the columns of ``read_table``.
    options : TwinOptions
        ``kind``, also compensated strain of a run; None for resistance where it was recorded, else strain; ``noise``, its
        standard deviation; ``setup``, the membrane, and ``elements_per_side`` and ``order`` of the square; ``set``, its
        parameters.
    stop : float, optional
        Last time to use [s].

    Raises
    ------
    OrchestratorError
        An option makes no sense, or the results lack what is needed.
    """
    from gossamer_files.measured import header_of, of_a_run
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import read_table
    from gossamer_orchestrator import load_results

    kind, noise, values = options["kind"], options["noise"], assigned(options["set"])
    structure, mesh = _structure(options), (options["elements_per_side"], options["order"])
    if path.suffix == ".csv" and not of_a_run(header_of(path)):
        require(kind != "compensated", "compensated strain stands in the results of a run; of a table, write strain.")
        structure = structure or square_structure(*mesh)
        record = read_table(path, kind, noise, structure, options["begins"])
        found = KnownRecord(record=record, structure=structure, parameters=_assigned(values, structure))
    else:
        found = find_in_results(load_results(path), kind, noise, values, structure, mesh)
    found = _calibrated(found, options)
    if stop is not None:
        require(math.isfinite(stop), f"{option('stop')} is {stop:g}. Write a positive number.")
        found = replace(found, record=found.record.first(max(0, round(stop / found.record.step))))
    return found


def find_records(paths: Sequence[Path], options: TwinOptions, stop: float | None = None) -> list[KnownRecord]:
    """Read records of one structure, see ``find_record``.

    Raises
    ------
    OrchestratorError
        One of them comes from another structure.
    """
    found = [find_record(path, options, stop) for path in paths]
    for path, other in zip(paths[1:], found[1:], strict=True):
        one, same = found[0], other.record.kind == found[0].record.kind
        require(same, f"{path} holds {other.record.kind}, {paths[0]} {one.record.kind}. Give records of one kind.")
        same = other.structure.setup == one.structure.setup and other.parameters == one.parameters
        text = f"{path} comes from another structure than {paths[0]}, or from other parameters of it"
        require(same, f"{text}. Give records of one structure.")
    return found


def find_arriving(pipe: Path, options: TwinOptions) -> Iterator[KnownRecord]:
    """Read a table while it is written, in records that follow each other; options as of ``find_record``.

    Raises
    ------
    OrchestratorError
        An option makes no sense, or the noise is not given: what comes later would tell it.
    """
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import read_arriving

    require(options["noise"] is not None, f"lines that arrive do not tell their noise yet. State it with {option('noise')}.")
    structure = _structure(options) or square_structure(options["elements_per_side"], options["order"])
    known, parameters = None, _assigned(assigned(options["set"]), structure)
    with pipe.open(encoding="utf-8") as lines:
        for record in read_arriving(lines, options["kind"], options["noise"], structure, options["begins"]):
            known = known or _calibrated(KnownRecord(record=record, structure=structure, parameters=parameters), options)
            yield replace(known, record=record)


def _calibrated(found: KnownRecord, options: TwinOptions) -> KnownRecord:
    """Return a record with the structure as a calibration tells it, if there is one."""
    from gossamer_models.twin import Calibration

    path = options.get("calibration")
    if path is None:
        return found
    known = Calibration.read(Path(path))
    known = known.of_structure if found.of_run else known
    structure, parameters = known.applied(found.structure, None)
    given = _assigned(assigned(options["set"]), structure)  # a run's record of its own parameters does not count
    return replace(found, structure=structure, parameters={**found.parameters, **parameters, **given}, calibration=known)


def find_in_results(
    data: xr.Dataset,
    kind: str | None = None,
    noise: float | None = None,
    values: Sequence[str] = (),
    structure: Structure | None = None,
    mesh: tuple[int, int] = (4, 4),
) -> KnownRecord:
    """Find a record in the results of a run, see ``find_record``; by default of the membrane that its FMU carries."""
    from gossamer_models.twin.reading import input_units
    from gossamer_orchestrator.results import dataset

    data, membrane = _on_grid(data), dataset.find(data, "membrane")
    structure = structure or structure_in(data, membrane, mesh)
    names = {v.name for v in structure.table if v.causality == "parameter"}
    recorded = dataset.parameters_of(data, membrane)
    if unknown := [name for name in recorded if name.startswith("youngs_modulus") and name not in names]:
        advice = f"Name the setup that its FMU was built from with {option('setup')}."
        msg = f"the membrane of the results has a parameter {unknown[0]!r}, that of the twin has none. {advice}"
        raise OrchestratorError(msg)
    recorded = {name: value for name, value in recorded.items() if name in names}
    units = input_units(structure)
    start = {name: value for name, value in dataset.parameters_of(data, membrane, "start").items() if name in units}
    record, sensors = _recorded(data, kind, noise, structure)
    return KnownRecord(
        record=replace(record, start={**start, **record.start}),
        structure=structure,
        parameters={**recorded, **_assigned(values, structure)},
        sensor_parameters=sensors,
        of_run=True,
    )


def structure_in(data: xr.Dataset, membrane: str, mesh: tuple[int, int] = (4, 4)) -> Structure:
    """Return the membrane that an FMU of a run carries, or a square with some elements a side of some order."""
    from gossamer_models.membrane import read_structure, square_structure

    carried = json.loads(data.attrs.get("fmus", "{}")).get(membrane, {}).get("setup")
    return square_structure(*mesh) if carried is None else read_structure(carried)


def _structure(options: TwinOptions) -> Structure | None:
    """Return the membrane that is named."""
    from .descriptions import load_structure

    if options["setup"] is None:
        return None
    if (options["elements_per_side"], options["order"]) != (4, 4):
        sizes = f"{option('elements_per_side')} and {option('order')}"
        msg = f"{sizes} are of the square, and a setup has its own. Leave them out."
        raise OrchestratorError(msg)
    return load_structure(options["setup"])


def beside(record: Path, name: str) -> Path:
    """Return the path of a file beside a record, or in its folder if it is one."""
    return (record if record.is_dir() else record.parent) / name


def keep_records(*records: Path) -> None:
    """Register the files of records, or those of the runs that are in folders, as read by the command under way."""
    from gossamer_orchestrator.results.files import RECORDED

    keep(*(path for each in records for path in ([each / name for name in RECORDED] if each.is_dir() else [each])))


def name_of(record: Path) -> str:
    """Return the name of a record: that of the folder of a run, or of a CSV file without its ending."""
    from gossamer_orchestrator.results.files import RECORDED

    path = followed(record)
    if path.is_dir():
        return path.name
    return path.parent.name if path.name in RECORDED else path.stem


def _on_grid(data: xr.Dataset) -> xr.Dataset:
    """Leave out the ends of windows and of the run that were recorded between two points of ``record every``."""
    import numpy as np

    time = data["time"].to_numpy()
    if len(time) < 3:
        return data
    step = float(data.attrs["step"] * data.attrs["record_every"]) if "record_every" in data.attrs else None
    place = (time - time[0]) / (step or float(np.median(np.diff(time))))
    return data.isel(time=np.abs(place - np.round(place)) < OFF_GRID)


def _recorded(
    data: xr.Dataset, kind: str | None, noise: float | None, structure: Structure
) -> tuple[ResponseRecord, dict[str, list[float]]]:
    import numpy as np
    from gossamer_models.twin import make_record
    from gossamer_orchestrator.results import dataset

    time = data["time"].to_numpy().astype(float)
    count = structure.n_sensors
    values = np.full((count, len(time)), np.nan)
    loads = _loads(data, structure)
    settled = bool(loads) and not structure.starts_in_plane
    sensors = dataset.sensors(data) if dataset.find_all(data, "sensor") else {}
    received = {k: f"{name}.resistance" for k, name in dataset.compensators(data).items()} if sensors else {}
    names = {k: received[k] if received.get(k) in data else f"{name}.resistance" for k, name in sensors.items()}
    names = {k: name for k, name in names.items() if name in data}
    if kind == "compensated":
        return _compensated(data, noise, loads, count, settled=settled), {}
    if kind == "strain" or (kind is None and not names):
        strain = dataset.need(data, f"{dataset.find(data, 'membrane')}.strain")[0]
        for k in strain[strain.dims[1]].to_numpy().tolist():
            values[k - 1] = _in_unit(strain.sel({strain.dims[1]: k}), "1")
        return make_record(time, values, "strain", noise, "the results", None, loads, settled=settled), {}
    if not names:
        msg = "the results hold no resistance. Add sensor?.resistance to [record] in the scenario and run it again."
        raise ResultsError(msg)
    for k, name in names.items():
        values[k - 1] = _in_unit(data[name], "ohm")
    if data.attrs.get("master") == "jacobi":  # what sensors got is one step old
        time, values = time[:-1], values[:, 1:]
        loads = {name: load[:-1] for name, load in loads.items()}
    each = [dataset.parameters_of(data, sensors[k]) if k in sensors else {} for k in range(1, count + 1)]
    known = next((parameters for parameters in each if parameters), {})
    tabled = {name: [parameters.get(name, known[name]) for parameters in each] for name in known}
    return make_record(time, values, "resistance", noise, "the results", None, loads, settled=settled), tabled


def _compensated(
    data: xr.Dataset, noise: float | None, loads: Mapping[str, Vector], count: int, *, settled: bool
) -> ResponseRecord:
    """Return the strain that compensators recovered, moved back by their delay; its noise is what they state, or more."""
    import numpy as np
    from gossamer_models.twin import make_record
    from gossamer_orchestrator.results import dataset

    found = {k: name for k, name in dataset.compensators(data).items() if f"{name}.strain" in data}
    if not found:
        msg = "the results hold no compensated strain. Add compensator?.strain to [record] in the scenario and run it again."
        raise ResultsError(msg)
    time = data["time"].to_numpy().astype(float)
    values, least = np.full((count, len(time)), np.nan), np.zeros(count)
    for k, name in found.items():
        late = 2 if data.attrs.get("master") == "jacobi" else 0  # what sensors and compensators got is one step old
        if "noise" in dataset.parameters_of(data, name) or f"{name}.delay" in data:
            delay, deviation = dataset.need(data, f"{name}.delay", f"{name}.strain_deviation")
            late += round(float(delay[-1]) / float(np.median(np.diff(time))))
            least[k - 1] = float(deviation.mean())
        values[k - 1, : len(time) - late] = _in_unit(data[f"{name}.strain"], "1")[late:]
    record = make_record(time, values, "strain", noise, "the results", None, loads, settled=settled)
    return replace(record, least_noise=least)


def _loads(data: xr.Dataset, structure: Structure) -> dict[str, Vector]:
    """Return the recorded inputs of the membrane, in its units."""
    from gossamer_models.twin.reading import input_units
    from gossamer_orchestrator.results import dataset

    membrane, found = dataset.find(data, "membrane"), {}
    for name, unit in input_units(structure).items():
        array, _, index = name.partition("[")
        column = data.get(f"{membrane}.{array}")
        if column is not None and index:
            column = column.sel({column.dims[1]: int(index[:-1])})
        if column is not None:
            found[name] = _in_unit(column, unit)
    return found


def _in_unit(values: xr.DataArray, wanted: str) -> Vector:
    """Return values in a unit, whatever unit stands with them: a CSV file may have been edited."""
    from gossamer_files.measured import conversion, factor

    unit, what = values.attrs.get("units") or wanted, str(values.name).rpartition(".")[2]
    scale = 1.0 if unit == wanted else factor(unit, what) if what in KINDS else conversion(unit, wanted)
    if scale is None:
        msg = f"{values.name} is in {unit!r}, which is no unit of {what}. Write {wanted}."
        raise ResultsError(msg)
    return scale * values.to_numpy().astype(float)


def _assigned(texts: Sequence[str], structure: Structure) -> dict[str, float]:
    from gossamer_models.twin.reading import input_units
    from gossamer_orchestrator.names import suggest

    known = [v.name for v in structure.table if v.causality == "parameter"] + [*input_units(structure)]
    given = numbers_by_name(texts, "NAME=VALUE")
    for name in given:
        if name not in known:
            msg = f"{option('set', name)}: the membrane has no parameter {name!r}. {suggest(name, known)}"
            raise OrchestratorError(msg)
    return given


def numbers_by_name(texts: Sequence[str], example: str, name_of_option: str = "set") -> dict[str, float]:
    """Read numbers by name, ``NAME=VALUE`` each, of an option."""
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            msg = f"{option(name_of_option, text)}: {value!r} is no number; write a name and a number, {example}."
            raise OrchestratorError(msg) from None
    return found


def tell_recognised(records: Sequence[Record]) -> None:
    """Tell columns, units, ranges, sampling and gaps of records, how they were repaired, and what a user should confirm."""
    from gossamer_models.tables import recognised_table

    console = talk()
    print_tables(console, [recognised_table(records)])
    for record in records:
        confirm = [f"{record.name}: {text}" for text in (record.summary.remarks if record.summary else ())]
        for text in (*record.repaired, *confirm):
            console.print(text, style="yellow", markup=False)
            if not TERMINAL.talks and text in confirm:
                logger.info("%s", text)


def histories(record: Record, predicted: Any) -> xr.Dataset:  # noqa: ANN401
    """Return a record and its predicted resistance over time."""
    import xarray as xr

    unit = record.unit or "not stated"
    columns = {"strain": (record.strain, "1"), "resistance": (record.resistance, unit), "predicted": (predicted, unit)}
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        coords={"time": ("time", record.time, {"units": "s", "long_name": "time"})},
        attrs={"record": record.name},
    )
