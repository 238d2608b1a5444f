"""Identify sensors, and judge them."""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..results.learning import Assessment, Identification
from ..table import as_call

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gossamer_models.fitting import Record
    from rich.console import Console

logger = logging.getLogger(__name__)


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


def _quietly(_console: Console, records: Sequence[Record]) -> None:
    """Log what was read of records where it should be confirmed."""
    for record in records:
        for sentence in record.summary.remarks if record.summary else ():
            logger.info("%s: %s", record.name, sentence)


def _histories(record: Record, predicted: Any) -> xr.Dataset:  # noqa: ANN401
    """Return a record and its predicted resistance over time."""
    unit = record.unit or "not stated"
    columns = {
        "strain": (record.strain, "1"),
        "resistance": (record.resistance, unit),
        "predicted": (predicted, unit),
    }
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        coords={"time": ("time", record.time, {"units": "s", "long_name": "time"})},
        attrs={"record": record.name},
    )
