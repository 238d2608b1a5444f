"""Gossamer in Python: what the command line does, with its names and options, and results to look at.

>>> import gossamer
>>> run = gossamer.run("damaged", set={"membrane.damage[1]": 0.3})
>>> run.data["detector.damage"].isel(time=-1)
"""

from __future__ import annotations

from gossamer_files.lazy import public_names

HOMES, __getattr__ = public_names(__name__, __file__)

__all__ = list(HOMES)


def __dir__() -> list[str]:
    """List the public names, so that editors and notebooks complete them."""
    return __all__
