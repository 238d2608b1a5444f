"""Pages of results: one HTML file each that opens from disk, without a network or a server."""

from .page import PAGE, Page, folded, link, on_page, table, write_page, written

__all__ = ["PAGE", "Page", "folded", "link", "on_page", "table", "write_page", "written"]
