"""Co-simulation of FMUs: scenarios, master, results.

The public names stand in ``__init__.pyi``, which type checkers read too; each is imported when it is first used.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_HOMES = {name.name: line.module for line in _STUB.body if isinstance(line, ast.ImportFrom) for name in line.names}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a public name, so that ``gossamer --help`` loads neither FMPy nor xarray."""
    if name not in _HOMES:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
