"""Tables of the detector's judgements, for a terminal."""

from __future__ import annotations

import math

import numpy as np
from rich.table import Table

from .judgements import Judgement


def zone_table(judgement: Judgement) -> Table:
    """Tabulate true and estimated damage as the membrane is seen: zone 1 lower left, x to the right, y up."""
    side = math.isqrt(judgement.true.size)
    table = Table(
        title=f"Damage at t = {judgement.time:.4f} s, true -> estimated [%]",
        caption=(
            f"mean absolute error {100 * judgement.mean_absolute_error:.2f} %\n"
            f"largest error {100 * judgement.largest_error:+.2f} % in zone {judgement.worst_zone}\n"
            f"similarity with training {judgement.similarity:.2g}"
        ),
        show_header=False,
        show_lines=True,
    )
    for row in reversed(range(side)):
        cells = []
        for zone in range(row * side, (row + 1) * side):
            true, estimated = 100 * judgement.true[zone], 100 * judgement.estimated[zone]
            numbers = f"{true:.0f} -> {estimated:.1f}"
            cells.append(f"zone {zone + 1}\n" + (f"[bold]{numbers}[/bold]" if true or estimated >= 5.0 else numbers))
        table.add_row(*cells)
    return table


def history_table(ended: list[Judgement]) -> Table:
    """Tabulate the windows: the most damaged zone by the estimate, and the errors."""
    table = Table(title="Judgements")
    for heading in (
        r"t \[s]",  # [s] would strike the rest through
        "most damaged zone",
        "estimated [%]",
        "true there [%]",
        "mean abs. error [%]",
        "similarity",
        "valid",
    ):
        table.add_column(heading, justify="right", min_width=max(map(len, heading.split())))
    for judgement in ended:
        zone = int(np.argmax(judgement.estimated))
        table.add_row(
            f"{judgement.time:.4f}",
            f"{zone + 1}",
            f"{100 * judgement.estimated[zone]:.1f}",
            f"{100 * judgement.true[zone]:.0f}",
            f"{100 * judgement.mean_absolute_error:.2f}",
            f"{judgement.similarity:.2g}",
            "yes" if judgement.valid else "no",
            style=None if judgement.valid else "dim",
        )
    return table
