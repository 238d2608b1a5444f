"""Co-simulation of FMUs: scenarios, master, results. ``import gossamer_orchestrator`` loads neither FMPy nor xarray."""

from __future__ import annotations

from gossamer_files.lazy import public_names

_HOMES, __getattr__ = public_names(__name__, __file__)

__all__ = list(_HOMES)
