"""Pages of results: one HTML file each that opens from disk, without a network or a server."""

from .charts import SCRIPT, Chart, band, bars, curve, drawn, heat, names_from_top, points, with_interval
from .page import PAGE, Page, write_page
from .tables import Html, folded, link, table
from .words import written

__all__ = [
    "PAGE",
    "SCRIPT",
    "Chart",
    "Html",
    "Page",
    "band",
    "bars",
    "curve",
    "drawn",
    "folded",
    "heat",
    "link",
    "names_from_top",
    "points",
    "table",
    "with_interval",
    "write_page",
    "written",
]
