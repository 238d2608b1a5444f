"""How sentences name an option: as Python writes it, or as the command line does, which sets it for its processes."""

from __future__ import annotations

import os

STYLE = "GOSSAMER_OPTIONS"  # environment variable
DASHES = "dashes"


def option(name: str, value: object = None) -> str:
    """Return an option with its value, if any: ``strain_unit='%'`` in Python, ``--strain-unit %`` on the command line."""
    if os.environ.get(STYLE) != DASHES:
        return f"{name}={'' if value is None else repr(value)}"
    flag = name.replace("_", "-")
    if isinstance(value, bool):
        return f"--{'' if value else 'no-'}{flag}"
    return f"--{flag}" if value is None else f"--{flag} {value}"
