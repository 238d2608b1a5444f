"""Exchange scenarios with other tools: SSP archives in both directions, and containers in one FMU."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from ..scenario.load import load_scenario
from ..scenario.schema import Scenario
from ..scenario.source import find_scenario


def open_scenario(
    path: Scenario | Path | str, *, step: float | None = None, stop: float | None = None
) -> AbstractContextManager[Scenario]:
    """Read a scenario file or unpack an ``.ssp``, whose FMUs are there inside the ``with`` block only.

    A name without a folder may be that of a shipped scenario, see ``find_scenario``. A scenario stays as it is.

    Raises
    ------
    ScenarioError
        See ``load_scenario`` and ``open_ssp``.
    """
    if isinstance(path, Scenario):
        return nullcontext(path)
    path = find_scenario(str(path))
    if path.suffix == ".ssp":
        from .ssp_reader import open_ssp  # loads pyssp-standard, which a TOML file does not need

        return open_ssp(path, step=step, stop=stop)
    return nullcontext(load_scenario(path, step=step, stop=stop))
