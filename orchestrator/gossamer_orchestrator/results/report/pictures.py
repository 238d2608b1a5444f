"""The pictures of a run as files: charts of its page, and the membrane in space."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from gossamer_files.charts import Chart, Panels, draw_panels
from gossamer_files.pictures import picture

from ...errors import OrchestratorError, ResultsError, writing
from ..dataset import compensators, find, need, sensors
from ..judgements import doubts, judge
from ..readers import readers_of
from ..shapes import ShapeHistory
from .damage import DamageHistory, history_charts, zone_charts
from .membrane import deflection_chart, deflection_map, plot_shape
from .recorded import Recorded
from .sensors import loop_charts, strain_charts

logger = logging.getLogger(__name__)

IN_SPACE = (9.0, 6.5)  # [inch]


@dataclass(frozen=True)
class Picture:
    """What came of a picture.

    Attributes
    ----------
    path : Path
        Its file.
    seconds : float
        How long it took [s].
    why_not : str
        What was not recorded, so that there is nothing to draw; else empty.
    failure : str
        What went wrong, a sentence; else empty.
    """

    path: Path
    seconds: float
    why_not: str = ""
    failure: str = ""


def save_pictures(data: xr.Dataset, folder: Path, form: str = "png", shapes: Path | None = None) -> list[Path]:
    """Draw what the recorded variables allow, without a display; return the paths.

    If that is nothing, one line of the log says why.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    folder : Path
        Where to write.
    form : {"png", "svg", "pdf"}
        Form of the files.
    shapes : Path, optional
        Folder of the run, where the shapes of membranes on meshes and ``watch.json`` are; ``folder`` by default.

    Raises
    ------
    ResultsError
        Some pictures could not be drawn or written; the others are.
    """
    drawn = list(draw_pictures(data, folder, form, shapes or folder))
    paths = paths_of(drawn)
    if failures := [each.failure for each in drawn if each.failure]:
        raise ResultsError("\n".join(failures))
    return paths


def draw_pictures(
    data: xr.Dataset, folder: Path, form: str, shapes: Path, share: slice = slice(None)
) -> Iterator[Picture]:
    """Draw a share of the pictures, with the arguments of ``save_pictures``; one that fails keeps none from being drawn."""
    run = Recorded(data, shapes)
    in_space = {name: history for name, history in run.shapes.items() if f"{name}.w" not in data}
    names = ["deflection"] if len(in_space) == 1 else [f"deflection_{name}" for name in in_space]
    pictures = PICTURES | dict(zip(names, (partial(_shape, each) for each in in_space.values()), strict=True))
    title = str(data.attrs.get("title", ""))
    for name, make in list(pictures.items())[share]:
        begun, path, why_not, failure = time.perf_counter(), folder / f"{name}.{form}", "", ""
        try:
            made = make(run)
            size = made.size if isinstance(made, Panels) else IN_SPACE
            with writing(path), picture(path, size) as figure:
                if isinstance(made, Panels):
                    draw_panels(replace(made, title=title), figure)
                else:
                    plot_shape(made, title, figure)
        except ResultsError as error:
            why_not = str(error)
            with suppress(OSError):
                path.unlink()  # of an earlier run
        except OrchestratorError as error:
            failure = str(error)
        except Exception as error:
            failure = f"{path} was not drawn: {type(error).__name__}: {error}."
            logger.debug("%s", failure, exc_info=True)
        yield Picture(path, time.perf_counter() - begun, why_not, failure)


def paths_of(pictures: Iterable[Picture]) -> list[Path]:
    """Return the paths of the pictures that were drawn, and log them; if there is none, log why."""
    paths, reasons = [], []
    for each in pictures:
        if each.why_not:
            reasons.append(each.why_not)
        elif not each.failure:
            paths.append(each.path)
            logger.info("drew %s in %.1f s", each.path, each.seconds)
    if reasons and not paths:
        logger.warning("no pictures: %s", reasons[0])
    return paths


def _shape(history: ShapeHistory, _: Recorded) -> ShapeHistory:
    return history


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
    if not components:
        msg = f"there is no {role} 1; there are none."
        raise ResultsError(msg)
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


def _deflection(run: Recorded) -> Panels:
    return Panels([deflection_map(run), deflection_chart(run)], (11.0, 4.4), 2)


def _damage(run: Recorded) -> Panels:
    last, judged = judge(run.data), DamageHistory(run)
    k, known = (
        int(np.searchsorted(each, last.time + 1e-12, side="right")) - 1 for each in (judged.time, judged.true_time)
    )
    charts = zone_charts(judged, [(last.time, k, known)])
    first = replace(charts[0], title=f"{charts[0].title.removesuffix(' [%]')}, judged at t = {last.time:.4f} s")
    later = "" if run.ended[-1].valid else doubts(run.data, run.ended)[0]
    return Panels([replace(first, result=later), *charts[1:]], (5.5 * len(charts), 4.9), len(charts))


def _history(run: Recorded) -> Panels:
    need(run.data, f"{find(run.data, 'detector')}.damage")
    judged = DamageHistory(run)
    if len(run.ended) < 2 and len(judged.true_time) < 2:
        msg = "a single window under constant damage has no history."
        raise ResultsError(msg)
    return Panels(history_charts(judged), (9.0, 4.8))


# by file name; the slowest first
PICTURES: dict[str, Callable[[Recorded], Panels | ShapeHistory]] = {
    "strains": _strains,
    "sensors": _sensors,
    "deflection": _deflection,
    "damage": _damage,
    "damage_history": _history,
}
