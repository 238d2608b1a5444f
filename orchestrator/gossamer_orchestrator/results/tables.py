"""Tables of judgements for a terminal, and the rows of those that stand on a page too."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from gossamer_files.tables import TableText
from rich.table import Table

from ..words import uncertain
from .dataset import zone_label
from .judgements import Judgement

LEAST_SHOWN = 0.0005  # damage that is shown as 0.1 %; among zones with less, none is the most damaged


def since(onset: float, deviation: float) -> str:
    """Return the title of a table of damage that began at an onset with a standard deviation [s]."""
    return f"Damage since t = {uncertain(onset, deviation, 's')}"


def onset_table(
    onset: float, spread: float, damage: Sequence[float], deviation: Sequence[float], names: Sequence[str] = ()
) -> TableText:
    """Return the damage [%] of each zone that is damaged since an onset [s], each with its standard deviation."""
    zones = [zone_label(name) for name in names] or [str(k + 1) for k in range(len(damage))]
    rows = zip(zones, damage, deviation, strict=True)
    cells = [(zone, f"{100.0 * d:.2f} ± {100.0 * s:.2f}") for zone, d, s in rows if d > 0.0]
    return TableText(("zone", "damage ± standard deviation [%]"), cells, since(onset, spread))


def zone_table(judgement: Judgement) -> Table:
    """Tabulate true and estimated damage as the membrane is seen: zone 1 lower left, x to the right, y up."""
    side, certain = math.isqrt(judgement.true.size), bool(np.isfinite(judgement.deviation).all())
    known = bool(np.isfinite(judgement.true).all())
    errors = (
        f"mean absolute error {100 * judgement.mean_absolute_error:.2f} %\n"
        f"largest error {100 * judgement.largest_error:+.2f} % in zone {judgement.label(judgement.worst_zone - 1)}\n"
    )
    what = f"{'true -> ' * known}estimated{' +- its standard deviation' * certain}"
    table = Table(
        title=f"Damage at t = {judgement.time:.4f} s, {what} [%]",
        caption=(
            f"{errors if known else ''}{judgement.likeness or 'similarity'} with training {judgement.likeness_value:.2g}"
        ),
        show_header=False,
        show_lines=True,
    )
    zones = judgement.true.size
    for row in reversed(range(-(-zones // side))):
        cells = []
        for zone in range(row * side, min((row + 1) * side, zones)):
            true, estimated = 100 * judgement.true[zone], 100 * judgement.estimated[zone]
            numbers = f"{true:.0f} -> {estimated:.1f}" if known else f"{estimated:.1f}"
            if certain:
                numbers += f" +- {100 * judgement.deviation[zone]:.1f}"
            cells.append(
                f"zone {judgement.label(zone)}\n"
                + (f"[bold]{numbers}[/bold]" if true > 0.0 or estimated >= 5.0 else numbers)
            )
        table.add_row(*cells)
    return table


def window_table(ended: Sequence[Judgement], most: int | None = None) -> TableText:
    """Tabulate the windows, or the last ones: the most damaged zone, and the errors if the truth is known."""
    likeness = next((judgement.likeness for judgement in ended if judgement.likeness), "similarity")
    known = all(np.isfinite(judgement.true).all() for judgement in ended)
    compared = ("true there [%]", "mean abs. error [%]") if known else ()
    rows = []
    for judgement in ended[-(most or len(ended)) :]:
        zone = int(np.argmax(judgement.estimated))
        found = judgement.estimated[zone] >= LEAST_SHOWN
        true = f"{100 * judgement.true[zone]:.0f}" if found else "-"
        cells = [f"{judgement.time:.4f}", judgement.label(zone) if found else "-", f"{100 * judgement.estimated[zone]:.1f}"]
        cells += [true, f"{100 * judgement.mean_absolute_error:.2f}"] * known
        rows.append((*cells, f"{judgement.likeness_value:.2g}", "yes" if judgement.valid else "no"))
    some = f", the last {len(rows)} of {len(ended)}" if len(rows) < len(ended) else ""
    head = ("t [s]", "most damaged zone", "estimated [%]", *compared, likeness, "valid")
    return TableText(head, rows, f"Windows of the detector{some}")
