"""Packages whose public names stand in ``__init__.pyi``, which type checkers read, and are imported when first used."""

from __future__ import annotations

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def public_names(package: str, file: str) -> tuple[dict[str, str], Callable[[str], Any]]:
    """Return the module that each public name of a package comes from, and the package's ``__getattr__``.

    Parameters
    ----------
    package, file : str
        Its ``__name__`` and ``__file__``; ``__init__.pyi`` beside the latter imports every name from its home.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    lines = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    homes = {each.name: f"{package}." * bool(line.level) + str(line.module) for line in lines for each in line.names}

    def find(name: str) -> Any:  # noqa: ANN401
        if name not in homes:
            msg = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(msg)
        return getattr(import_module(homes[name]), name)

    return homes, find
