"""Pages of results: one HTML file each that opens from disk, without a network or a server."""

from .charts import SCRIPT, Chart, band, bars, curve, drawn, heat, points, with_interval
from .page import PAGE, Page, write_page
from .tables import folded, table

__all__ = [
    "PAGE",
    "SCRIPT",
    "Chart",
    "Page",
    "band",
    "bars",
    "curve",
    "drawn",
    "folded",
    "heat",
    "points",
    "table",
    "with_interval",
    "write_page",
]
