"""What is told of measured records while a command works, and what they become in a result."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .results import print_tables
from .terminal import TERMINAL, talk

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.fitting import Record

logger = logging.getLogger(__name__)


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
