"""Draw every page that the results of a run allow, and write it as a picture."""

from __future__ import annotations

import logging
import time
from pathlib import Path
from textwrap import shorten

import xarray as xr
from gossamer_files import replacing

from ...errors import ResultsError
from ..shapes import load_shapes
from . import damage, deflection, sensors

logger = logging.getLogger(__name__)

# by file name: a function that draws into a figure, and the figure's size [inch]
PAGES = sensors.PAGES | damage.PAGES | deflection.PAGES
LONGEST_TITLE = 120  # characters that fit above a picture
FORMS = ("png", "svg", "pdf")
_UNDATED: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}  # the same bytes again
STYLE = Path(__file__).with_name("pictures.mplstyle")


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
        Folder of the shapes of membranes on meshes; ``folder`` by default.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    reasons: list[str] = []
    for name, (draw, size) in (PAGES | deflection.shape_pages(data, load_shapes(shapes or folder))).items():
        begun = time.perf_counter()
        with mpl.rc_context(fname=STYLE):
            figure = Figure(figsize=size)
            FigureCanvasAgg(figure)
            path = folder / f"{name}.{form}"
            try:
                draw(data, figure)
            except ResultsError as error:
                path.unlink(missing_ok=True)  # of an earlier run
                reasons.append(str(error))
                continue
            figure.suptitle(shorten(str(data.attrs.get("title", "")), LONGEST_TITLE), parse_math=False)
            with replacing(path) as unfinished:
                figure.savefig(unfinished, format=form, metadata=_UNDATED.get(form))
            written.append(path)
            logger.info("drew %s in %.1f s", path, time.perf_counter() - begun)
    if not written:
        logger.warning("no pictures: %s", reasons[0])
    return written
