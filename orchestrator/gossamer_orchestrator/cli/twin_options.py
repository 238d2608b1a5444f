"""Options that ``gossamer twin`` and ``gossamer watch`` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

RecordArgument: TypeAlias = Annotated[
    Path, typer.Argument(help="Results of a run (results.nc, results.csv or their folder), or a CSV file.")
]
KindOption: TypeAlias = Annotated[str | None, typer.Option(help="strain or resistance, where the record has both.")]
NoiseOption: TypeAlias = Annotated[
    float | None, typer.Option(help="Standard deviation of the noise, 1 or ohm; estimated by default.", min=0.0)
]
ValuesOption: TypeAlias = Annotated[
    list[str] | None, typer.Option("--set", help="A parameter of the membrane; may be repeated.", metavar="NAME=VALUE")
]
SensorOption: TypeAlias = Annotated[
    Path | None, typer.Option(help="Artifact of the sensors; the shipped one by default.", metavar="FILE")
]
ElementsOption: TypeAlias = Annotated[
    int, typer.Option(help="Elements along a side of the twin, a multiple of 4.", metavar="N")
]
OrderOption: TypeAlias = Annotated[int, typer.Option(help="Their order; 1 for bilinear ones.")]

NUISANCE_UNITS = {"phase": "rad", "pressure": "Pa"}  # of what is fitted beside damage; the others are ratios


def beside(record: Path, name: str) -> Path:
    """Return the path of a file beside a record, or in its folder if it is one."""
    return (record if record.is_dir() else record.parent) / name


def name_of(record: Path) -> str:
    """Return the name of a record: that of the folder of a run, or of a CSV file without its ending."""
    from ..results.files import RECORDED

    path = record.resolve()
    if path.is_dir():
        return path.name
    return path.parent.name if path.name in RECORDED else path.stem


def file_of(record: Path) -> Path:
    """Return the file of a record that may be given as the folder of a run."""
    return beside(record, "results.nc") if record.is_dir() else record
