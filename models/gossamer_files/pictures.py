"""Pictures: one style for all, drawn without a display, and written whole.

Colours are those of Okabe and Ito, which colour-blind readers can tell apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from . import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
GREY = "#9a9a9a"
_STYLE = Path(__file__).with_name("pictures.mplstyle")
_METADATA: dict[str, dict[str, str | None]] = {  # the same bytes again
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}


@contextmanager
def style() -> Iterator[None]:
    """Draw in the style of all pictures; nothing that a user or a program set before has a say."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rc_file(_STYLE, use_default_template=False)
        yield


@contextmanager
def picture(target: Path | BytesIO, size: tuple[float, float] | None = None) -> Iterator[Figure]:
    """Yield a new figure in the style of all pictures; write it when the ``with`` block ends well.

    Parameters
    ----------
    target : Path or BytesIO
        A file, whose ending is the form, png, svg or pdf; or where to put the bytes of a PNG.
    size : tuple of float, optional
        Width and height [inch].

    Raises
    ------
    OSError
        The file cannot be written; what was there is still there.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with style():
        figure = Figure(figsize=size)
        FigureCanvasAgg(figure)
        yield figure
        if isinstance(target, BytesIO):
            figure.savefig(target)
            return
        with replacing(target) as unfinished:
            figure.savefig(unfinished, metadata=_METADATA[target.suffix[1:]])


def axes_or_new(ax: Axes | None) -> Axes:
    """Return the axes given, or those of a new figure."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.figure().add_subplot()
