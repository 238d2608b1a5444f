"""What the twin is fitted to: results of a run with their parameters, or a table."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, ResultsError

from .arguments import AnyPath, assigned
from .options import TwinOptions

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.membrane import MembraneParams
    from gossamer_models.twin import ResponseRecord

OFF_GRID = 1e-3  # steps


@dataclass(frozen=True, kw_only=True)
class KnownRecord:
    """A record and what is known about where it comes from.

    Attributes
    ----------
    record : ResponseRecord
        Histories.
    params : MembraneParams
        Parameters of the membrane.
    sensor_parameters : mapping of str to list of float
        Parameters of the sensors, one value for each.
    """

    record: ResponseRecord
    params: MembraneParams
    sensor_parameters: Mapping[str, list[float]] = field(default_factory=dict)

    def twin(self, sensor: AnyPath | None = None, elements_per_side: int = 4, order: int = 4) -> dict[str, Any]:
        """Return what a twin of the record is made of: its membrane, and for resistance its sensors.

        Parameters
        ----------
        sensor : path, optional
            Artifact of the sensors; by default the shipped one.
        elements_per_side, order : int
            Of the twin's mesh.
        """
        from gossamer_models.membrane import square_structure
        from gossamer_models.sensor import SensorArtifact, default_artifact

        structure = square_structure(elements_per_side, order, params=self.params)
        if self.record.kind == "strain":
            return {"structure": structure}
        found = default_artifact() if sensor is None else SensorArtifact.read(Path(sensor))
        return {"structure": structure, "sensor": found, "sensor_parameters": self.sensor_parameters}


def find_record(path: Path, options: TwinOptions, stop: float | None = None) -> KnownRecord:
    """Read a record.

    Parameters
    ----------
    path : Path
        Results of a run, their folder, or a CSV file with the columns of ``read_table``.
    options : TwinOptions
        ``kind``, None for resistance where it was recorded, else strain; ``noise``, its standard deviation; ``set``,
        parameters of the membrane.
    stop : float, optional
        Last time to use [s].

    Raises
    ------
    OrchestratorError
        An option makes no sense, or the results lack what is needed.
    """
    from gossamer_files.measured import header_of, of_a_run
    from gossamer_models.membrane import MembraneParams
    from gossamer_models.twin import read_table
    from gossamer_orchestrator import load_results

    kind, noise, values = options["kind"], options["noise"], assigned(options["set"])
    if path.suffix == ".csv" and not of_a_run(header_of(path)):
        known = asdict(MembraneParams())
        found = KnownRecord(record=read_table(path, kind, noise), params=MembraneParams(**_assigned(values, known)))
    else:
        found = find_in_results(load_results(path), kind, noise, values)
    if stop is not None:
        if not math.isfinite(stop):
            msg = f"{option('stop')} is {stop:g}. Write a positive number."
            raise OrchestratorError(msg)
        samples = max(0, round(stop / found.record.step))
        found = replace(found, record=replace(found.record, values=found.record.values[:, :samples]))
    return found


def find_in_results(
    data: xr.Dataset, kind: str | None = None, noise: float | None = None, values: Sequence[str] = ()
) -> KnownRecord:
    """Find a record in the results of a run, as ``find_record`` does."""
    from gossamer_models.membrane import MembraneParams
    from gossamer_orchestrator.results import dataset

    names = asdict(MembraneParams())
    record, sensors = _recorded(_on_grid(data), kind, noise)
    known = {name: value for name, value in _parameters(data, dataset.find(data, "membrane")).items() if name in names}
    params = MembraneParams(**{**known, **_assigned(values, names)})
    return KnownRecord(record=record, params=params, sensor_parameters=sensors)


def beside(record: Path, name: str) -> Path:
    """Return the path of a file beside a record, or in its folder if it is one."""
    return (record if record.is_dir() else record.parent) / name


def file_of(record: Path) -> Path:
    """Return the file of a record that may be given as the folder of a run."""
    return beside(record, "results.nc") if record.is_dir() else record


def name_of(record: Path) -> str:
    """Return the name of a record: that of the folder of a run, or of a CSV file without its ending."""
    from gossamer_orchestrator.results.files import RECORDED

    path = record.resolve()
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


def _recorded(data: xr.Dataset, kind: str | None, noise: float | None) -> tuple[ResponseRecord, dict[str, list[float]]]:
    import numpy as np
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import make_record
    from gossamer_orchestrator.results import dataset

    time = data["time"].to_numpy().astype(float)
    count = square_structure().n_sensors
    values = np.full((count, len(time)), np.nan)
    sensors = dataset.sensors(data) if dataset.find_all(data, "sensor") else {}
    received = {k: f"{name}.resistance" for k, name in dataset.compensators(data).items()} if sensors else {}
    names = {k: received[k] if received.get(k) in data else f"{name}.resistance" for k, name in sensors.items()}
    names = {k: name for k, name in names.items() if name in data}
    if kind == "strain" or (kind is None and not names):
        strain = dataset.need(data, f"{dataset.find(data, 'membrane')}.strain")[0]
        for k in strain[strain.dims[1]].to_numpy().tolist():
            values[k - 1] = _in_si(strain.sel({strain.dims[1]: k}), "strain")
        return make_record(time, values, "strain", noise, "the results"), {}
    if not names:
        msg = "the results hold no resistance. Add sensor?.resistance to [record] in the scenario and run it again."
        raise ResultsError(msg)
    for k, name in names.items():
        values[k - 1] = _in_si(data[name], "resistance")
    if data.attrs.get("master") == "jacobi":  # what sensors got is one step old
        time, values = time[:-1], values[:, 1:]
    each = [_parameters(data, sensors[k]) if k in sensors else {} for k in range(1, count + 1)]
    known = next((parameters for parameters in each if parameters), {})
    tabled = {name: [parameters.get(name, known[name]) for parameters in each] for name in known}
    return make_record(time, values, "resistance", noise, "the results"), tabled


def _in_si(values: xr.DataArray, what: str) -> Any:  # noqa: ANN401
    """Return values in 1 or ohm, whatever unit stands with them: a CSV file may have been edited."""
    from gossamer_files.measured.units import SI, factor

    unit = values.attrs.get("units") or SI[what]
    scale = 1.0 if unit == SI[what] else factor(unit, what)
    if scale is None:
        msg = f"{values.name} is in {unit!r}, which is no unit of {what}. Write {SI[what]}."
        raise ResultsError(msg)
    return scale * values.to_numpy()


def _parameters(data: xr.Dataset, component: str) -> dict[str, float]:
    """Return the parameters of a component; none in results without provenance, such as a CSV file."""
    fmus = json.loads(data.attrs.get("fmus", "{}"))
    return dict(fmus.get(component, {}).get("parameters", {}))


def _assigned(texts: Sequence[str], known: Mapping[str, float]) -> dict[str, float]:
    from gossamer_orchestrator.names import suggest

    given = numbers_by_name(texts, "NAME=VALUE")
    for name in given:
        if name not in known:
            msg = f"{option('set', name)}: the membrane has no parameter {name!r}. {suggest(name, known)}"
            raise OrchestratorError(msg)
    return given


def numbers_by_name(texts: Sequence[str], example: str) -> dict[str, float]:
    """Read numbers by name, ``NAME=VALUE`` each."""
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            msg = f"{option('set', text)}: {value!r} is no number; write a name and a number, {example}."
            raise OrchestratorError(msg) from None
    return found
