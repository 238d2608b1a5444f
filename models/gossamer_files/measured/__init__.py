"""The one reader of measured tables: who needs a column says which, and gets it in SI with the lines of its samples."""

from .columns import Column, Wanted, find_column, listed, named_column, of_a_run
from .reader import Measured, passes_midnight, read_columns
from .text import header_of
from .units import conversion, factor

__all__ = [
    "Column",
    "Measured",
    "Wanted",
    "conversion",
    "factor",
    "find_column",
    "header_of",
    "listed",
    "named_column",
    "of_a_run",
    "passes_midnight",
    "read_columns",
]
