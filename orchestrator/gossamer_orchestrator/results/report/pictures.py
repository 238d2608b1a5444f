"""The pictures of a run as files: charts of its page, and the membrane in space."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import xarray as xr
from gossamer_files.pictures import picture
from gossamer_files.plots import Panels, draw_panels

from ...errors import OrchestratorError, ResultsError, writing
from ...pages import PAGE
from ..readers import Recorded
from ..shapes import ShapeHistory, load_shapes
from . import damage, membrane, sensors

logger = logging.getLogger(__name__)

IN_SPACE = (9.0, 6.5)  # [inch]
FORMS = ("png", "svg", "pdf")


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
    data: xr.Dataset,
    folder: Path,
    form: str,
    shapes: Path,
    share: slice = slice(None),
    tell: Callable[[Path], None] = lambda _: None,
) -> Iterator[Picture]:
    """Draw a share of the pictures, with the arguments of ``save_pictures``; one that fails keeps none from being drawn.

    ``tell`` is called with the path of each before it is drawn.
    """
    run = Recorded(data, shapes)
    in_space = {name: history for name, history in run.shapes.items() if f"{name}.w" not in data}
    names = ["deflection"] if len(in_space) == 1 else [f"deflection_{name}" for name in in_space]
    pictures = PICTURES | dict(zip(names, (partial(_shape, each) for each in in_space.values()), strict=True))
    title = str(data.attrs.get("title", ""))
    for name, make in list(pictures.items())[share]:
        begun, path, why_not, failure = time.perf_counter(), folder / f"{name}.{form}", "", ""
        tell(path)
        try:
            made = make(run)
            size = made.size if isinstance(made, Panels) else IN_SPACE
            with writing(path), picture(path, size) as figure:
                if isinstance(made, Panels):
                    draw_panels(replace(made, title=title), figure)
                else:
                    membrane.plot_shape(made, title, figure)
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


def remove_drawn(folder: Path) -> None:
    """Remove the page and the pictures of earlier results."""
    names = list(PICTURES)
    with suppress(ResultsError):
        names += [f"deflection_{name}" for name in load_shapes(folder)]
    for path in (folder / PAGE, *(folder / f"{name}.{form}" for name in names for form in FORMS)):
        path.unlink(missing_ok=True)


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


# by file name; the slowest first
PICTURES: dict[str, Callable[[Recorded], Panels | ShapeHistory]] = {
    **sensors.PICTURES,
    **membrane.PICTURES,
    **damage.PICTURES,
}
