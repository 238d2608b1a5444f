"""A placement as text: a table of zones, and the sensors as tables of a setup."""

from __future__ import annotations

import csv
from pathlib import Path

from gossamer_files import replacing

from .placing import Placing


def write_csv(found: Placing, path: Path) -> None:
    """Write a row for each zone: its name, and for each placement the deviation and a90 of its damage [1]."""
    placements = {"own": found.own, "chosen": found.chosen}
    columns = {name: p for name, p in placements.items() if p is not None}
    with replacing(path) as unfinished, unfinished.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["zone", "group", *(f"{name} {what} [1]" for name in columns for what in ("deviation", "a90"))])
        for k, zone in enumerate(found.structure.setup.zones):
            numbers = [f"{v:.6g}" for p in columns.values() for v in (p.deviation[k], p.a90[k])]
            rows.writerow([k + 1, zone.group, *numbers])


def sensors_text(found: Placing) -> str:
    """Return the chosen sensors as they stand in ``setup.toml``."""
    tables = []
    for sensor in found.chosen.sensors:
        rows = [f"point = {_vector(sensor.point)}", f"direction = {_vector(sensor.direction)}"]
        if sensor.gauge_length:
            rows.append(f"gauge_length = {sensor.gauge_length!r}")
        tables.append("\n".join(["[[sensors]]", *rows]))
    return "\n\n".join(tables) + "\n"


def _vector(values: tuple[float, float, float]) -> str:
    return f"[{', '.join(repr(float(f'{value:.12g}')) for value in values)}]"
