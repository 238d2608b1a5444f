"""What the digital twin saw that watched a run: ``watch.json`` beside its results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

WATCH = "watch.json"
LARGE = 2.0  # chi2 per sample of a window that the twin does not explain
TWIN = "twin.json"  # beside results too: what ``gossamer twin`` found; its page is in the folder ``twin``


def read_watch(folder: Path) -> dict[str, Any] | None:
    """Read what the twin found, if it watched the run."""
    try:
        content = json.loads((folder / WATCH).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
