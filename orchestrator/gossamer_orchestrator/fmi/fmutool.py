"""Keep fmutool and fmucontainer, of the FMU Manipulation Toolbox, quiet."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from logging.handlers import BufferingHandler


@contextmanager
def collect_errors() -> Iterator[list[str]]:
    """Collect what they log as errors inside the ``with`` block, and show nothing; the list is filled at its end."""
    logger, handler = logging.getLogger("fmu_manipulation_toolbox"), BufferingHandler(sys.maxsize)
    handler.setLevel(logging.ERROR)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    errors: list[str] = []
    try:
        yield errors
    finally:
        errors += [record.getMessage() for record in handler.buffer]
        logger.removeHandler(handler)
        logger.propagate = propagate
