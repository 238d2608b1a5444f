"""Scenarios of two gains."""

from __future__ import annotations

from collections.abc import Callable

import pytest


@pytest.fixture
def two_gains() -> Callable[..., str]:
    """Text of a scenario in which one gain feeds another; their FMUs, and more of the connection, are arguments."""
    return _two_gains


def _two_gains(a: str, b: str, extra: str = "") -> str:
    return (
        f'step = 0.1\nstop = 1.0\n[components]\na = {{ fmu = "{a}", inputs = {{ u = 1500.0, "offset[*]" = 0.0 }} }}\n'
        f'b = {{ fmu = "{b}", inputs = {{ "offset[*]" = 0.0 }} }}\n'
        f'[[connections]]\nfrom = "a.y"\nto = "b.u"\n{extra}'
    )
