"""Open a scenario, whichever kind of file it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..scenario.load import load_scenario
from ..scenario.schema import Scenario


@contextmanager
def open_scenario(path: Path, *, step: float | None = None, stop: float | None = None) -> Iterator[Scenario]:
    """Read a scenario file or unpack an ``.ssp``, whose FMUs are there inside the ``with`` block only.

    Raises
    ------
    ScenarioError
        See ``load_scenario`` and ``open_ssp``.
    """
    if path.suffix == ".ssp":
        from .ssp.reader import open_ssp  # loads pyssp-standard, which a TOML file does not need

        with open_ssp(path, step=step, stop=stop) as scenario:
            yield scenario
    else:
        yield load_scenario(path, step=step, stop=stop)
