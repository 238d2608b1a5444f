"""A page of a run: one HTML file that opens from disk, without a network or a server."""

from .page import PAGE, write_report

__all__ = ["PAGE", "write_report"]
