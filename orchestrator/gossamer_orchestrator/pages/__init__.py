"""Pages of results: one HTML file each that opens from disk, without a network or a server."""

from .page import PAGE, Page, write_page
from .tables import Html, folded, link, on_page, table, written

__all__ = ["PAGE", "Html", "Page", "folded", "link", "on_page", "table", "write_page", "written"]
