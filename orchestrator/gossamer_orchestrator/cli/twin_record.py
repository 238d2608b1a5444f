"""What the twin is fitted to: results of a run with their parameters, or a table."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from gossamer_files.measured import header_of, of_a_run

from ..errors import OrchestratorError, ResultsError
from ..names import suggest
from ..results import dataset
from ..results.files import load_results

if TYPE_CHECKING:
    from gossamer_models.membrane import MembraneParams
    from gossamer_models.sensor import SensorArtifact
    from gossamer_models.twin import ResponseRecord

KINDS = ("resistance", "strain")
OFF_GRID = 1e-3  # steps


@dataclass(frozen=True, kw_only=True)
class Found:
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


def find_record(path: Path, kind: str | None, noise: float | None, stop: float | None, params: Sequence[str]) -> Found:
    """Read a record.

    Parameters
    ----------
    path : Path
        Results of a run, their folder, or a CSV file with the columns of ``read_table``.
    kind : {"strain", "resistance"} or None
        None for resistance where it was recorded, else strain.
    noise, stop : float or None
        Standard deviation of the noise; last time to use [s].
    params : sequence of str
        Membrane parameters, ``NAME=VALUE``.

    Raises
    ------
    OrchestratorError
        An option makes no sense, or the results lack what is needed.
    """
    from gossamer_models.membrane import MembraneParams
    from gossamer_models.twin import read_table

    if kind not in (None, *KINDS):
        msg = f"--kind is {kind!r}. Write strain or resistance."
        raise OrchestratorError(msg)
    if path.suffix == ".csv" and not of_a_run(header_of(path)):
        given = _assigned(params, asdict(MembraneParams()))
        found = Found(record=read_table(path, kind, noise), params=MembraneParams(**given))
    else:
        found = find_in_results(load_results(path), kind, noise, params)
    if stop is not None:
        if not math.isfinite(stop):
            msg = f"--stop is {stop:g}. Write a positive number."
            raise OrchestratorError(msg)
        samples = max(0, round(stop / found.record.step))
        found = replace(found, record=replace(found.record, values=found.record.values[:, :samples]))
    return found


def sensor_of(found: Found, file: Path | None) -> SensorArtifact | None:
    """Return the sensors of a record of resistance, from a file or as shipped; None for a record of strain."""
    from gossamer_models.sensor import SensorArtifact, default_artifact

    if found.record.kind == "strain":
        return None
    return default_artifact() if file is None else SensorArtifact.read(file)


def find_in_results(data: xr.Dataset, kind: str | None, noise: float | None, params: Sequence[str]) -> Found:
    """Find a record in the results of a run, as ``find_record`` does."""
    from gossamer_models.membrane import MembraneParams

    names = asdict(MembraneParams())
    record, sensors = _recorded(_on_grid(data), kind, noise)
    known = {name: value for name, value in _parameters(data, dataset.find(data, "membrane")).items() if name in names}
    return Found(
        record=record, params=MembraneParams(**{**known, **_assigned(params, names)}), sensor_parameters=sensors
    )


def _on_grid(data: xr.Dataset) -> xr.Dataset:
    """Leave out the ends of windows and of the run that were recorded between two points of ``record every``."""
    time = data["time"].to_numpy()
    if len(time) < 3:
        return data
    step = float(data.attrs["step"] * data.attrs["record_every"]) if "record_every" in data.attrs else None
    place = (time - time[0]) / (step or float(np.median(np.diff(time))))
    return data.isel(time=np.abs(place - np.round(place)) < OFF_GRID)


def _recorded(data: xr.Dataset, kind: str | None, noise: float | None) -> tuple[ResponseRecord, dict[str, list[float]]]:
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import make_record

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
            values[k - 1] = strain.sel({strain.dims[1]: k}).to_numpy()
        return make_record(time, values, "strain", noise, "the results"), {}
    if not names:
        msg = "the results hold no resistance. Add sensor?.resistance to [record] in the scenario and run it again."
        raise ResultsError(msg)
    for k, name in names.items():
        values[k - 1] = data[name].to_numpy()
    if data.attrs.get("master") == "jacobi":  # what sensors got is one step old
        time, values = time[:-1], values[:, 1:]
    each = [_parameters(data, sensors[k]) if k in sensors else {} for k in range(1, count + 1)]
    known = next((parameters for parameters in each if parameters), {})
    tabled = {name: [parameters.get(name, known[name]) for parameters in each] for name in known}
    return make_record(time, values, "resistance", noise, "the results"), tabled


def _parameters(data: xr.Dataset, component: str) -> dict[str, float]:
    """Return the parameters of a component; none in results without provenance, such as a CSV file."""
    fmus = json.loads(data.attrs.get("fmus", "{}"))
    return dict(fmus.get(component, {}).get("parameters", {}))


def _assigned(texts: Sequence[str], known: Mapping[str, float]) -> dict[str, float]:
    given = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in known:
            msg = f"--set {text}: the membrane has no parameter {name!r}. {suggest(name, known)}"
            raise OrchestratorError(msg)
        try:
            given[name] = float(value)
        except ValueError:
            msg = f"--set {text}: {value!r} is no number. Write {name}=VALUE."
            raise OrchestratorError(msg) from None
    return given
