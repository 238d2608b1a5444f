"""The hostile FMU, and scenarios in which it stands beside one that is told nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from gossamer_orchestrator import Scenario, parse_scenario
from hostile import build


@pytest.fixture(scope="session")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the hostile FMU, with one output and with twenty."""
    pytest.importorskip("ziglang", reason="the hostile FMU needs the compiler ziglang")
    folder = tmp_path_factory.mktemp("hostile")
    build(folder / "hostile.fmu")
    build(folder / "wide.fmu", outputs=20)
    return folder


@pytest.fixture
def beside() -> Callable[..., Scenario]:
    """Scenario of a good and a bad component: the bad one's parameters, its name, and more keys of the scenario."""

    def make(parameters: str = "", name: str = "bad", more: str = "", stop: float = 0.1) -> Scenario:
        return parse_scenario(
            f'step = 0.001\nstop = {stop}\n[components.good]\nfmu = "hostile"\ninputs = {{ u = 1.0 }}\n'
            f'[components.{name}]\nfmu = "hostile"\nparameters = {{ {parameters} }}\ninputs = {{ u = 0.0 }}\n{more}'
        )

    return make
