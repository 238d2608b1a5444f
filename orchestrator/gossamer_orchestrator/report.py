"""What the detector found, against what was put in.

A judgement is the instant at which a window of the detector ends: its damage estimate or its indices change while ``valid``
is 1. Everything is read from recorded results, so it works on a file as well as right after a run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import ResultsError

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


UNKNOWN = 1e-3  # similarity below which a judgement is an extrapolation


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """One judgement of the detector.

    Attributes
    ----------
    time : float
        When it was made [s].
    true, estimated : numpy.ndarray
        Damage of every zone [1], at that time.
    similarity : float
        Largest similarity with a case the detector was trained on [1].
    """

    time: float
    true: NDArray[np.float64]
    estimated: NDArray[np.float64]
    similarity: float

    @property
    def mean_absolute_error(self) -> float:
        """Mean over the zones of ``|estimated - true|`` [1]."""
        return float(np.mean(np.abs(self.estimated - self.true)))

    @property
    def worst_zone(self) -> int:
        """Zone with the largest error, counted from 1."""
        return int(np.argmax(np.abs(self.estimated - self.true))) + 1

    @property
    def largest_error(self) -> float:
        """Error of the worst zone [1], with its sign."""
        return float((self.estimated - self.true)[self.worst_zone - 1])


def need(data: xr.Dataset, *names: str) -> list[xr.DataArray]:
    """Return recorded variables; raise ``ResultsError`` that says how to record them if one is missing."""
    missing = [name for name in names if name not in data.data_vars]
    if missing:
        msg = f"the results lack {', '.join(missing)}. Add it to [record] variables in the scenario and run it again."
        raise ResultsError(msg)
    return [data[name] for name in names]


def judgements(data: xr.Dataset, membrane: str = "membrane", detector: str = "detector") -> list[Judgement]:
    """List all judgements of a run, in order of time; ``membrane`` and ``detector`` are component names."""
    true, estimated, valid = need(data, f"{membrane}.damage", f"{detector}.damage", f"{detector}.valid")
    watched = [estimated.to_numpy(), valid.to_numpy()[:, None]]
    for name in ("index", "similarity"):
        if f"{detector}.{name}" in data.data_vars:
            values = data[f"{detector}.{name}"].to_numpy()
            watched.append(values.reshape(len(values), -1))
    changed = np.any(np.diff(np.hstack(watched), axis=0) != 0.0, axis=1)
    rows = np.flatnonzero(changed & (valid.to_numpy()[1:] > 0.5)) + 1
    similarity = f"{detector}.similarity"
    return [
        Judgement(
            time=float(data["time"][k]),
            true=true.to_numpy()[k],
            estimated=estimated.to_numpy()[k],
            similarity=float(data[similarity][k]) if similarity in data.data_vars else math.nan,
        )
        for k in rows
    ]


def judge(data: xr.Dataset, membrane: str = "membrane", detector: str = "detector") -> Judgement:
    """Return the last judgement of a run.

    Raises
    ------
    ResultsError
        Damage was not recorded, or no window ended in time.
    """
    found = judgements(data, membrane, detector)
    if not found:
        msg = (
            f"the detector made no valid judgement until t = {float(data['time'][-1]):.9g} s. Run for at least one window, "
            "with the window length and sampling step it was trained for."
        )
        raise ResultsError(msg)
    return found[-1]


def doubts(data: xr.Dataset, found: list[Judgement]) -> list[str]:
    """Say why the last judgement should not be trusted: sensors beyond their range, or nothing like it in training."""
    beyond = [
        name.removesuffix(".saturated")
        for name in map(str, data.data_vars)
        if name.endswith(".saturated") and float(data[name].max()) > 0.5
    ]
    sentences = []
    if beyond:
        sentences.append(
            f"Beyond their range during the run: {', '.join(beyond)}. What follows from them is a lower bound."
        )
    if found and found[-1].similarity < UNKNOWN:
        sentences.append(
            f"The detector was trained on nothing like this (similarity {found[-1].similarity:.1g}). "
            "Do not trust its numbers."
        )
    return sentences


def zone_table(judgement: Judgement) -> Table:
    """Draw true and estimated damage as the membrane is seen: zone 1 lower left, x to the right, y up."""
    from rich.table import Table

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


def history_table(found: list[Judgement]) -> Table:
    """Draw a row per judgement: its errors and the zone it suspects most."""
    from rich.table import Table

    table = Table(title="Judgements")
    for heading in (
        "t [s]",
        "most damaged zone",
        "estimated [%]",
        "true there [%]",
        "mean abs. error [%]",
        "similarity",
    ):
        table.add_column(heading, justify="right")
    for judgement in found:
        zone = int(np.argmax(judgement.estimated))
        table.add_row(
            f"{judgement.time:.4f}",
            f"{zone + 1}",
            f"{100 * judgement.estimated[zone]:.1f}",
            f"{100 * judgement.true[zone]:.0f}",
            f"{100 * judgement.mean_absolute_error:.2f}",
            f"{judgement.similarity:.2g}",
        )
    return table
