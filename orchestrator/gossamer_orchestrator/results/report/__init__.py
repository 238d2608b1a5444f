"""The page of a run."""

from .page import run_page, write_report

__all__ = ["run_page", "write_report"]
