"""Pictures of one record and of what a sensor makes of it: resistance, residual, loop, strain and its error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gossamer_models.arrays import Rows, Vector
from gossamer_models.fitting import Record
from gossamer_models.fitting.plots import quantity
from gossamer_models.fitting.records import judged_rows
from gossamer_models.replay import Recovered
from gossamer_models.review.judge import BAND
from gossamer_orchestrator.pages import Chart, band, curve

COLORS = ("@0", "@1", "@2", "@3")  # of compensators


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A record and what a sensor makes of it.

    Attributes
    ----------
    record : Record
        The record, in the units of its file.
    predicted : ndarray, shape (m,)
        Resistance [ohm] for its strain.
    recovered : mapping of str to Recovered
        Strain from its resistance, by compensator.
    first : ndarray of bool, shape (m,)
        Stretch that is marked.
    stretch : str
        What it is, for instance "training stretch".
    fitted : str
        What a model is on the marked stretch, for instance "fitted"; empty if it is a prediction there too.
    """

    record: Record
    predicted: Vector
    recovered: Mapping[str, Recovered]
    first: Rows
    stretch: str
    fitted: str


def record_charts(seen: Seen) -> list[Chart]:
    """Return the pictures of one record; those over time are zoomed together."""
    return [*_of_resistance(seen), *(_of_strain(seen) if seen.recovered else [])]


def _of_resistance(seen: Seen) -> list[Chart]:
    record = seen.record
    t, R, strain = record.time, record.resistance, 100.0 * record.strain
    size = float(np.ptp(R))
    residual = 100.0 * (seen.predicted - R) / size
    worst = int(np.abs(residual).argmax())
    return [
        _over_time(
            seen,
            "Resistance over time",
            quantity(record),
            [_measured(t, R), *_stretches(seen, t, seen.predicted)],
            note=f"Grey area: {seen.stretch}.",
            text=f"Measured resistance of {record.name} from {R.min():.6g} to {R.max():.6g} over {t[-1]:.6g} s, and that of "
            "the model.",
        ),
        _over_time(
            seen,
            "Residual",
            "model - measured [% of range]",
            _stretches(seen, t, residual),
            note=f"Of the record's range of {size:.4g}.",
            text=f"The residual is largest at {t[worst]:.6g} s, {residual[worst]:.2f} % of the range.",
            broad=False,
        ),
        Chart(
            section=record.name,
            title="Loop",
            x="strain [%]",
            y=quantity(record),
            traces=[_measured(strain, R), *_stretches(seen, strain, seen.predicted)],
            text=f"Resistance over strain from {strain.min():.4g} to {strain.max():.4g} %, measured and modelled.",
        ),
    ]


def _of_strain(seen: Seen) -> list[Chart]:
    record = seen.record
    t, strain = record.time, 100.0 * record.strain
    size = float(np.ptp(strain))
    rest = judged_rows(seen.first)
    histories, errors, stated, said = [], [], [], []
    for (name, found), color in zip(seen.recovered.items(), COLORS, strict=False):
        recovered = 100.0 * found.strain
        error = 100.0 * (recovered - strain) / size
        known = np.isfinite(error)
        rms = float(np.sqrt(np.mean(error[known] ** 2))) if known.any() else np.nan
        said.append(f"{name}: root mean square error {rms:.3g} % of the range over the whole record.")
        if found.deviation is not None:
            reach = BAND * 100.0 * found.deviation
            label = f"± {BAND:g} stated deviations" + (f", {name}" if len(seen.recovered) > 1 else "")
            histories += band(label, t, recovered - reach, recovered + reach, color)
            errors += band(label, t, -100.0 * reach / size, 100.0 * reach / size, color)
            where = f"Outside the {seen.stretch}" if rest is not seen.first else "Here"
            if (known & rest).any():
                beyond = 100.0 * float(np.mean((np.abs(recovered - strain) > reach)[known & rest]))
                stated.append(f"{where} {beyond:.1f} % of the errors of {name} leave the band; 5 % would be right.")
        histories.append(curve(name, t, recovered, color))
        errors.append(curve(name, t, error, color))
    silent = [name for name, found in seen.recovered.items() if found.deviation is None]
    stated += [f"No deviation is stated by {' and '.join(silent)}."] if silent else []
    delays = [f"{found.delay:.4g} s by {name}" for name, found in seen.recovered.items() if found.delay > 0.0]
    late = f"Delays are taken back: {', '.join(delays)}." if delays else ""
    return [
        _over_time(
            seen,
            "Strain over time",
            "strain [%]",
            [_measured(t, strain, "applied"), *histories],
            note=f"Recovered from the measured resistance. {late}".strip(),
            text=f"Applied strain from {strain.min():.4g} to {strain.max():.4g} % and strain recovered from the resistance.",
        ),
        _over_time(
            seen,
            "Error of the recovered strain",
            "recovered - applied [% of range]",
            errors,
            note=" ".join([f"Of the record's range of {size:.4g} % strain.", *stated]),
            text=" ".join(said),
            broad=False,
        ),
    ]


def _over_time(seen: Seen, title: str, y: str, traces: list[Any], *, note: str, text: str, broad: bool = True) -> Chart:
    """Return a picture over time with the first stretch marked."""
    marked = seen.record.time[seen.first]
    area = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1, "layer": "below", "line": {"width": 0}}
    ends = {"x0": float(marked[0]), "x1": float(marked[-1])} if marked.size else {}
    shapes = [area | ends | {"fillcolor": "@grey/0.15"}] if marked.size else []
    return Chart(
        section=seen.record.name,
        title=title,
        x="time [s]",
        y=y,
        traces=traces,
        layout={"shapes": shapes},
        linked=f"time of {seen.record.name}",
        broad=broad,
        note=note,
        text=text,
    )


def _measured(x: Vector, y: Vector, name: str = "measured") -> Any:  # noqa: ANN401
    return curve(name, x, y, "@grey", width=3)


def _stretches(seen: Seen, x: Vector, y: Vector) -> list[Any]:
    """Return a curve of what is fitted and one of what is predicted, where there is any."""
    if not seen.fitted:
        return [curve("predicted", x, y, "@1")]
    parts = ((seen.fitted, seen.first, "@0"), ("predicted", ~seen.first, "@1"))
    return [curve(name, x, np.where(rows, y, np.nan), color) for name, rows, color in parts if rows.any()]
