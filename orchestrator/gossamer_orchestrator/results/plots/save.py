"""Draw every page that the results of a run allow, and write it as a picture."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten

import xarray as xr
from gossamer_files.pictures import picture

from ...errors import OrchestratorError, ResultsError, writing
from ..files import read_watch
from ..shapes import load_shapes
from . import damage, deflection, sensors

logger = logging.getLogger(__name__)

LONGEST_TITLE = 120  # characters that fit above a picture


@dataclass(frozen=True)
class Drawn:
    """What came of a page.

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
    pages = list(draw_pages(data, folder, form, shapes or folder))
    paths = paths_of(pages)
    if failures := [page.failure for page in pages if page.failure]:
        raise ResultsError("\n".join(failures))
    return paths


def draw_pages(data: xr.Dataset, folder: Path, form: str, shapes: Path, share: slice = slice(None)) -> Iterator[Drawn]:
    """Draw a share of the pages, with the arguments of ``save_pictures``; one that fails keeps none from being drawn."""
    # by file name: a function that draws into a figure, and the figure's size [inch]; the slowest first
    pages = sensors.PAGES | deflection.PAGES | damage.damage_pages(read_watch(shapes))
    pages |= deflection.shape_pages(data, load_shapes(shapes))
    for name, (draw, size) in list(pages.items())[share]:
        begun, path, why_not, failure = time.perf_counter(), folder / f"{name}.{form}", "", ""
        try:
            with writing(path), picture(path, size) as figure:
                draw(data, figure)
                figure.suptitle(shorten(str(data.attrs.get("title", "")), LONGEST_TITLE), parse_math=False)
        except ResultsError as error:
            why_not = str(error)
            with suppress(OSError):
                path.unlink()  # of an earlier run
        except OrchestratorError as error:
            failure = str(error)
        except Exception as error:
            failure = f"{path} was not drawn: {type(error).__name__}: {error}."
            logger.debug("%s", failure, exc_info=True)
        yield Drawn(path, time.perf_counter() - begun, why_not, failure)


def paths_of(pages: Iterable[Drawn]) -> list[Path]:
    """Return the paths of the pages that were drawn, and log them; if there is none, log why."""
    paths, reasons = [], []
    for page in pages:
        if page.why_not:
            reasons.append(page.why_not)
        elif not page.failure:
            paths.append(page.path)
            logger.info("drew %s in %.1f s", page.path, page.seconds)
    if reasons and not paths:
        logger.warning("no pictures: %s", reasons[0])
    return paths
