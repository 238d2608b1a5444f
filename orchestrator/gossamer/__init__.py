"""Gossamer in Python: what the command line does, with its names and options, and results to look at.

>>> import gossamer
>>> run = gossamer.run("damaged", set={"membrane.damage[1]": 0.3})
>>> run.data["detector.damage"].isel(time=-1)

The public names stand in ``__init__.pyi``, which type checkers read too; each is imported when it is first used.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_HOMES = {name.name: line for line in _STUB.body if isinstance(line, ast.ImportFrom) for name in line.names}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a public name, so that ``import gossamer`` loads nothing else."""
    if name not in _HOMES:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    home = _HOMES[name]
    return getattr(import_module(f"{'.' * home.level}{home.module}", __name__), name)


def __dir__() -> list[str]:
    """List the public names, so that editors and notebooks complete them."""
    return __all__
