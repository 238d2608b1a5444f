"""Start a run and end it before its first step, in a process of its own."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from ..scenario.schema import Given, Scenario
from .child import Task
from .folders import scratch
from .messages import Messages
from .outline import Outline
from .process import Process

logger = logging.getLogger(__name__)


def validate_scenario(
    scenario: Scenario | Path | str,
    fmus: Path | str,
    *,
    step: float | None = None,
    stop: float | None = None,
    values: Mapping[str, Given] | None = None,
    master: str | None = None,
    limit: float | None = None,
    strict: bool = False,
) -> Outline:
    """Check everything that ``run_scenario`` checks before its first step: the scenario, its FMUs, and that these start.

    Parameters
    ----------
    scenario, fmus, step, stop, values, master, limit, strict
        As of ``run_scenario``.

    Returns
    -------
    Outline

    Raises
    ------
    ScenarioError, FmuError, ResultsError, SimulationError
        As ``run_scenario``.
    """
    with ExitStack() as stack:
        temporary = stack.enter_context(scratch())
        messages = stack.enter_context(Messages())
        task = Task(
            scenario=scenario if isinstance(scenario, Scenario) else Path(scenario),
            fmus=Path(fmus),
            step=step,
            stop=stop,
            values=dict(values or {}),
            master=master,
            out=Path(),  # where a run writes its folder by default
            scratch=temporary,
            strict=strict,
            threads=1,
            resume=False,
            observers=pickle.dumps([]),
            level=logger.getEffectiveLevel(),
            only_start=True,
        )
        process = stack.enter_context(Process(task))
        process.watch(limit, None)
        process.end()
        if process.error is not None:
            raise process.error
        assert process.outline is not None
        return replace(process.outline, warnings=messages.texts)
