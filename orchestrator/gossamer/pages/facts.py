"""Facts of pages of identifications and assessments: what was read, files, versions, how a sensor was made."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from gossamer_files import digest
from gossamer_models.fitting import Record
from gossamer_models.tables import recognised_table
from gossamer_orchestrator.pages import on_page, table

PACKAGES = ("gossamer", "numpy", "scipy", "casadi")
HOW = (
    "Of more than 5000 samples, curves over time show the smallest and the largest of each of 2500 parts, and loops those "
    "of strain and of resistance, so that no peak is lost. All numbers are of all samples."
)


def names_of(names: Sequence[str]) -> str:
    """Name one or two records; count more."""
    return " and ".join(names) if len(names) < 3 else f"{len(names)} records"


def read_as(records: Sequence[Record]) -> str:
    """Return what was recognised in the files of records as a table."""
    return on_page(recognised_table(records))


def work(files: Mapping[str, str], seconds: float) -> str:
    """Return names of files with their digests, versions, and how long it took [s] as a table."""
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    rows = [(f"SHA-256 of {name}", sha256) for name, sha256 in files.items()]
    rows += [("Versions", f"{versions}, Python {platform.python_version()}"), ("Wall time", f"{seconds:.3g} s")]
    return table((), rows, "Files and versions")


def digests(paths: Sequence[Path]) -> dict[str, str]:
    """Return the digests of files by their names."""
    return {path.name: digest(path) for path in paths}


def provenance(told: Mapping[str, str], without: Sequence[str] = ()) -> str:
    """Return how a sensor was made as a table, ``without`` what stands elsewhere on a page."""
    rows = [(name, text) for name, text in told.items() if text and name not in without]
    return table((), rows, "How the sensor was made")
