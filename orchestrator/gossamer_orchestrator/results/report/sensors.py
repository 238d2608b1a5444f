"""Charts of each sensor and its compensator: resistance, strain with its band, error, loop, spectrogram and spectrum.

What a compensator states of a time is recorded later, by its delay. The strain of a sensor is the true one where that was
recorded, else the compensated one. Strain is in %, resistance in ohm. Spectra are under Hann's window, without the mean.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from gossamer_files.charts import Array, Chart, Stages, band, curve, heat, points
from gossamer_files.plots import Panels

from ...errors import ResultsError, require
from ...words import duration
from ..dataset import compensators, find, need, sensors
from ..readers import Curve, Reader, Recorded, StrainError, curve_of, over_time, readers_of

LOOP_ROWS = 2000  # of a loop of resistance over strain
LEAST = 64  # samples of a spectrum
COLUMNS, LINES = 240, 128  # of a spectrogram, at most
FLOOR = 1e-12  # of an amplitude, so that it has a logarithm


def sensor_charts(run: Recorded) -> list[Chart]:
    """Return the charts of all sensors, of which a reader of the page chooses one."""
    charts: list[Chart] = []
    for reader in readers_of(run.data):
        shown = [*(reader.true or ())[:1], reader.late, reader.resistance, reader.reading]
        run.drawn |= {str(name) for name in [*shown, *[reader.deviation, f"{reader.compensator}.delay"] * bool(reader.late)]}
        for make in (strain_charts, _resistance, loop_charts, _spectrogram):
            charts += make(run, reader)
    return charts


def strain_charts(run: Recorded, reader: Reader) -> list[Chart]:
    """Draw true and compensated strain without its delay, and the error of the latter."""
    if not reader.true and not reader.late:
        return []
    traces, error, t = [], reader.error, run.t
    earlier = t - reader.delay
    if reader.late and reader.deviation:
        low, high = (run.thin(_edge(reader, sign)) for sign in (-2.0, 2.0))
        traces += band("± 2 deviations", earlier, low, high, "@1")
    if reader.true:
        true = run.thin(curve_of(*reader.true, factor=100.0))
        traces.append(curve("true", t, true, "@grey", width=4 if reader.late else 2))
    if reader.late:
        name = f"compensated, drawn {duration(reader.delay)} earlier" if reader.delay else "compensated"
        traces.append(curve(name, earlier, run.thin(curve_of(reader.late, factor=100.0)), "@1", width=1.2))
    note = (
        "True strain, and that of the compensator without its delay."
        if error
        else "Strain of the compensator without its delay; the true strain is not recorded." * bool(reader.late)
    )
    if reader.deviation:
        note += (
            " The band is two strain_deviation wide to each side: the error that the compensator expects of noise and "
            "drift. It does not cover a sensor that behaves otherwise than it was identified, nor spikes of its resistance."
        )
    said = ["True strain"] * bool(reader.true) + ["Compensated strain"] * bool(reader.late)
    result = f"sensor {reader.number}, {error.sentence}" if error and math.isfinite(error.rms) else ""
    more = {"note": note, "text": f"{' and '.join(said)} over time.", "result": result, "choice": reader.label}
    charts = [over_time("Strain", "strain [%]", traces, broad=True, **more)]
    return [*charts, _error(run, error, reader.label)] if error else charts


def _edge(reader: Reader, sign: float) -> Curve:
    strain, deviation = curve_of(reader.late, factor=100.0), curve_of(reader.deviation, factor=100.0 * sign)
    return lambda part: strain(part) + deviation(part)


def _error(run: Recorded, error: StrainError, choice: str) -> Chart:
    traces = [] if error.reach is None else band("± 2 deviations", run.t, -100.0 * error.reach, 100.0 * error.reach, "@1")
    traces.append(curve("error", run.t, 100.0 * error.curve, "@0", width=1.2))
    known = np.abs(error.curve[np.isfinite(error.curve)])
    top = 150.0 * max(float(known.max(initial=0.0)), 1e-12)
    share = f"{100.0 * error.beyond:.2g}" if error.beyond < 0.995 else "100"
    result = f"{share} % of the points leave the band; 5 % would be right" if math.isfinite(error.beyond) else ""
    note = "Compensated minus true strain of the same time, and two standard deviations as the compensator states them."
    layout = {"yaxis": {"range": [-top, top]}}
    title = "Error of the compensated strain"
    return over_time(title, "error [% strain]", traces, note=note, result=result, layout=layout, choice=choice)


def _resistance(run: Recorded, reader: Reader) -> list[Chart]:
    traces = []
    if reader.resistance:
        traces.append(run.curve("of the sensor", reader.resistance, "@0", width=4 if reader.reading else 1.4))
    if reader.reading:
        traces.append(run.curve("as read", reader.reading, "@1", width=1.2))
    text = "Resistance of the sensor over time, and as the compensator reads it."
    return [over_time("Resistance", "resistance [ohm]", traces, text=text, choice=reader.label)] if traces else []


def loop_charts(run: Recorded, reader: Reader) -> list[Chart]:
    """Draw resistance over strain of the same time in the first and the last window, and its spectra there."""
    name, found = reader.resistance or reader.reading, reader.strain
    if not name or found is None:
        return []
    read, shift = found
    loops, spectra, measured = [], [], curve_of(name)
    for k, (title, rows) in enumerate(_stretches(run)):
        resistance = measured(run.data.isel(time=rows))
        loops.append(curve(title, 100.0 * reader.later(read, rows, shift), resistance, f"@{k}", width=1.4))
        if shape := spectrum(run.time[rows], resistance):
            spectra.append(curve(title, *shape, f"@{k}", width=1.1))
    text = "Loops of resistance against strain: hysteresis and drift."
    title, x, y, note = ("Resistance against strain", "strain [%]", "resistance [ohm]", "The diamond is the slider's time.")
    charts = [Chart(title, x, y, loops, note=note, text=text, choice=reader.label, steps=_now(run, read, shift, measured))]
    if spectra:
        powers = {"type": "log", "dtick": 1, "labelalias": {1: "10<sup>0</sup>", 10: "10<sup>1</sup>"}}
        powers |= {"minor": {"dtick": "D1", "ticks": "outside", "tickcolor": "@soft"}}
        layout, x, y = {"xaxis": powers, "yaxis": powers}, "frequency [Hz]", "amplitude [ohm]"
        note = "Amplitudes under Hann's window, without the mean."
        charts.append(Chart("Spectrum of the resistance", x, y, spectra, note=note, layout=layout, choice=reader.label))
    return charts


def _stretches(run: Recorded) -> Iterator[tuple[str, slice]]:
    """Name the rows of the first and the last window, or the last rows."""
    ends = run.time.first_from([window.time for window in run.ended]).tolist()
    if len(ends) > 1:
        spans = [("first window", 0, ends[0]), ("last window", ends[-2], ends[-1])]
    else:
        spans = [("end of the run", 0, len(run.time) - 1)]
    return ((title, slice(max(first, last - LOOP_ROWS), last + 1)) for title, first, last in spans)


def _now(run: Recorded, read: Curve, shift: int, measured: Curve) -> Stages:
    """Return the place of the loop at each of the slider's instants; it is not known before a late compensator stated it."""
    rows = run.instants[0]
    known = rows + shift < len(run.time)
    strain = np.full(len(rows), np.nan)
    strain[known] = 100.0 * read(run.data.isel(time=rows[known] + shift))
    resistance = measured(run.data.isel(time=rows))
    look: dict[str, Any] = {"symbol": "diamond", "size": 12, "line": {"color": "@panel", "width": 1.5}}
    dots = [[points("now", [e], [r], "@ink", **look)] for e, r in zip(strain, resistance, strict=True)]
    return Stages(run.time[rows], dots)


def _spectrogram(run: Recorded, reader: Reader) -> list[Chart]:
    if reader.strain is None:
        return []
    read, _ = reader.strain
    shape = spectrogram(run, read)
    if not shape:
        return []
    time, frequency, level = shape
    time = time - (0.0 if reader.true else reader.delay)
    hover = "%{x:.4g} s, %{y:.4g} Hz: 10^%{z:.2f}<extra></extra>"
    cells = heat(time, frequency, level, "log10", zmin=max(float(level.min()), -10.0), hovertemplate=hover)
    note = "Decimal logarithm of the amplitude, under Hann's window, without the mean."
    text = "Amplitude of the strain over time and frequency."
    return [over_time("Spectrogram of the strain", "frequency [Hz]", [cells], note=note, text=text, choice=reader.label)]


def spectrum(time: Array, values: Array) -> tuple[Array, Array] | None:
    """Return frequencies [Hz] and amplitudes of a curve without its mean; None if it is short, uneven or not finite."""
    if not _usable(time, values):
        return None
    hann = np.hanning(len(values))
    amplitudes = np.abs(np.fft.rfft(hann * (values - values.mean()))) * 2.0 / hann.sum()
    return np.fft.rfftfreq(len(values), time[1] - time[0])[1:], amplitudes[1:]


def spectrogram(run: Recorded, read: Curve) -> tuple[Array, Array, Array] | None:
    """Return the amplitudes of overlapping stretches of a curve, each without its mean.

    Returns
    -------
    tuple of ndarray, or None
        The middle of each stretch [s], frequencies [Hz], and the decimal logarithm of the amplitude, of shape (frequencies,
        times); of more than ``LINES`` frequencies the largest amplitude of neighbours. None as ``spectrum``.
    """
    time, count = run.time, len(run.time)
    if count < LEAST or not time.are_even():
        return None
    if not all(np.isfinite(read(run.data.isel(time=rows))).all() for rows in run.pixels.parts()):
        return None
    size = max(LEAST // 2, min(1024, count // 8))  # eight stretches beside each other, or more
    begins = np.linspace(0, count - size, min(COLUMNS, 2 * count // size)).round().astype(int)
    parts = np.stack([read(run.data.isel(time=slice(begin, begin + size))) for begin in begins])
    hann = np.hanning(size)
    amplitudes = np.abs(np.fft.rfft(hann * (parts - parts.mean(axis=1, keepdims=True)))) * 2.0 / hann.sum()
    frequency = np.fft.rfftfreq(size, time[1] - time[0])[1:]
    first = np.arange(0, len(frequency), -(-len(frequency) // LINES))
    level = np.log10(np.maximum(np.maximum.reduceat(amplitudes[:, 1:], first, axis=1), FLOOR))
    return time[begins + size // 2], frequency[first], level.T


def _usable(time: Array, values: Array) -> bool:
    even = len(time) >= LEAST and np.ptp(np.diff(time)) <= 1e-6 * (time[1] - time[0]) + 1e-12
    return bool(even and np.isfinite(values).all())


def _strains(run: Recorded) -> Panels:
    numbers = _needed(run, compensators(run.data), "compensator", "strain")
    found = {reader.number: strain_charts(run, reader) for reader in readers_of(run.data) if reader.number in numbers}
    columns = min(len(found), 2)
    charts = []
    for first in range(0, len(found), columns):
        pair = list(found.items())[first : first + columns]
        charts += [_numbered(number, own[0]) for number, own in pair]
        charts += [Chart("")] * (columns - len(pair))
        charts += [replace(own[1], title=f"Sensor {number}: error", result="") for number, own in pair]
    return Panels(charts, (11.0, 3.75 * -(-len(found) // columns)), columns, heights=(5, 3))


def _sensors(run: Recorded) -> Panels:
    numbers = _needed(run, sensors(run.data), "sensor", "resistance")
    readers = [reader for reader in readers_of(run.data) if reader.number in numbers]
    charts = [_numbered(reader.number, replace(loop_charts(run, reader)[0], steps=None)) for reader in readers]
    columns = min(len(charts), 2)
    return Panels(charts, (9.0, 3.5 * -(-len(charts) // columns)), columns)


def _needed(run: Recorded, components: dict[int, str], role: str, variable: str) -> dict[int, str]:
    """Return components whose variable was recorded, and the strain of the membrane at each of them."""
    require(components, f"there is no {role} 1; there are none.", ResultsError)
    strains, *_ = need(
        run.data, f"{find(run.data, 'membrane')}.strain", *(f"{name}.{variable}" for name in components.values())
    )
    if missing := [number for number in components if number not in strains[strains.dims[1]]]:
        what = f"{strains.name}[{missing[0]}]"
        msg = f"the results lack {what}. Add it to [record] variables in the scenario and run it again."
        raise ResultsError(msg)
    return components


def _numbered(number: int, chart: Chart) -> Chart:
    return replace(chart, title=f"Sensor {number}", result=chart.result.removeprefix(f"sensor {number}, "))


PICTURES = {"strains": _strains, "sensors": _sensors}  # files
