"""What the functions of this package do: call what their commands call, and return results instead of printing them.

Arguments are those of the commands' own functions, as ``table.values`` gives them.
"""

from __future__ import annotations

import logging
import math
import webbrowser
from contextlib import nullcontext
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from gossamer_orchestrator.results.places import with_places, zone_places

from .results import Assessment, Identification, Run, Sweep, TwinAnswer, Verification
from .table import as_call

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gossamer_models.fitting import Record
    from rich.console import Console

logger = logging.getLogger(__name__)


def build(names: list[str] | None, **options: Any) -> dict[str, Path]:  # noqa: ANN401
    """Build FMUs; return their paths by name."""
    from gossamer_orchestrator.cli.build import build_given

    return build_given(names, **options)


def run(scenario: str, out: Path | None, fmus: Path, *, pictures: bool, **options: Any) -> Run:  # noqa: ANN401
    """Run a scenario; draw its pictures and write its page."""
    from gossamer_orchestrator.cli.run import draw, simulate
    from gossamer_orchestrator.results.drawing import Drawing

    with Drawing() if pictures else nullcontext() as drawing:
        data, folder = simulate(scenario, out, fmus, **options)
        if drawing:
            draw(drawing, data, folder, logger.warning)
    return Run(folder=folder, data=with_places(data))


def load(results: str | PathLike[str]) -> Run:
    """Look at the results of an earlier run.

    Parameters
    ----------
    results : path
        Folder of a run, or its results.nc or results.csv.

    Returns
    -------
    Run
        Data, verdict and judgements; it is displayed in a notebook.

    Raises
    ------
    ResultsError
        There are no results.

    Examples
    --------
    >>> gossamer.load("out/damaged").data["membrane.deflection"].plot()
    """
    from gossamer_orchestrator import load_results

    path = Path(results)
    data = load_results(path)
    return Run(folder=path if path.is_dir() else path.parent, data=with_places(data))


def verify(fmus: list[Path], limit: float) -> Verification:
    """Check FMUs."""
    from gossamer_orchestrator.verify import verify as check

    return Verification(findings={str(path): check(path, limit=limit) for path in fmus})


def sweep(scenario: str, ranges: list[str], out: Path | None, fmus: Path, **options: Any) -> Sweep:  # noqa: ANN401
    """Run a scenario with many values."""
    from gossamer_orchestrator.cli.sweep import run_cases

    cases, ended, folder, files = run_cases(scenario, ranges, out, fmus, **options)
    store = next((path for path in files if path.suffix == ".zarr"), None)
    data = None if store is None else with_places(xr.open_zarr(store, consolidated=False))
    return Sweep(folder=folder, cases=cases, ended=ended, data=data)


def view(results: Path) -> Path:
    """Open a page in the browser; return its path."""
    from gossamer_orchestrator.cli.report import newest_page

    path = newest_page(results)
    if not webbrowser.open(path.resolve().as_uri()):
        logger.warning("No browser could be started. Open %s in one.", path)
    return path


def identify(files: list[Path], **given: Any) -> Identification:  # noqa: ANN401
    """Identify a sensor."""
    from gossamer_orchestrator.cli.identify import field_parameters, identify_given, rest_of

    call = as_call("identify", given | {"files": files})
    fields = {name: given.pop(name) for name in field_parameters()}
    result, _, paths = identify_given(files, fields, call, _quietly, **given)
    records = {}
    for k, rows in enumerate(result.fit.train):
        record, predicted = result.in_its_file(k)
        known: dict[str, Any] = {"fitted": rows}
        for name, found in result.recovered_of(k).items():
            known |= {name: found.strain} | ({} if found.deviation is None else {"deviation": found.deviation})
        columns = {name: ("time", values, {"units": "1"}) for name, values in known.items()}
        records[record.name] = _histories(record, predicted).assign(columns)
    rest = rest_of(result, given["rest_resistance"])
    return Identification(path=paths[0], result=result, records=records, rest=rest, files=paths)


def assess(sensor: Path, files: list[Path], **given: Any) -> Assessment:  # noqa: ANN401
    """Judge a sensor on other records."""
    from gossamer_orchestrator.cli.assess import column_parameters, judge_given

    columns = {name: given.pop(name) for name in column_parameters()}
    judged, paths = judge_given(sensor, files, columns, _quietly, **given)
    records = {}
    for each in judged:
        unknown = np.full(each.record.time.shape, math.nan)
        deviations = [unknown if one.deviation is None else one.deviation for one in each.recovered.values()]
        found = {"recovered": [one.strain for one in each.recovered.values()], "deviation": deviations}
        by = {name: (("compensator", "time"), np.array(values), {"units": "1"}) for name, values in found.items()}
        data = _histories(each.record, each.predicted).assign(by)
        records[each.record.name] = data.assign_coords(compensator=list(each.recovered))
    return Assessment(judged=judged, records=records, stretch=given["stretch"], files=paths)


def twin(record: Path, **options: Any) -> TwinAnswer:  # noqa: ANN401
    """Fit a simulation to a record."""
    from gossamer_orchestrator.cli.twin import fit_twin

    answer, path = fit_twin(record, **options)
    ratio = {"units": "1"}
    values = {name: ("zone", getattr(answer, name), ratio) for name in ("damage", "deviation", "probability")}
    data = xr.Dataset(
        values | {"covariance": (("zone", "other_zone"), answer.covariance, ratio)},
        coords=zone_places(math.isqrt(answer.damage.size), 1.0, ratio)
        | {dim: np.arange(1, answer.damage.size + 1) for dim in ("zone", "other_zone")},
        attrs={"valid": int(answer.valid), "chi2_per_sample": answer.chi2_per_sample, "chi2_bound": answer.chi2_bound},
    )
    return TwinAnswer(path=path, answer=answer, data=data)


def _quietly(_console: Console, records: Sequence[Record]) -> None:
    """Log what was read of records where it should be confirmed."""
    for record in records:
        for sentence in record.found.remarks if record.found else ():
            logger.info("%s: %s", record.name, sentence)


def _histories(record: Record, predicted: Any) -> xr.Dataset:  # noqa: ANN401
    """Return a record and its predicted resistance over time."""
    columns = {
        "strain": (record.strain, "1"),
        "resistance": (record.resistance, "ohm"),
        "predicted": (predicted, "ohm"),
    }
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        coords={"time": ("time", record.time, {"units": "s", "long_name": "time"})},
        attrs={"record": record.name},
    )
