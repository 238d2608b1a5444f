"""The reliability of stated deviations, on pages about detectors, and the colours of their curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gossamer_orchestrator.pages import Chart, curve

COLORS = ("@0", "@1", "@2", "@3", "@4", "@5")


def reliability_chart(observed: Sequence[dict[str, Any]], note: str) -> Chart:
    """Draw curves of the observed over the stated share of damages within an interval; right is the diagonal."""
    return Chart(
        section="Stated deviations",
        title="Observed over stated share of damages within an interval",
        x="stated share [1]",
        y="observed share [1]",
        traces=[
            curve("right", [0.0, 1.0], [0.0, 1.0], "@grey", dash="dot"),
            *(each | {"mode": "lines+markers"} for each in observed),
        ],
        note=f"Below the line the stated deviations are too small. {note}",
        tall=True,
    )
