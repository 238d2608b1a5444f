"""A process that draws pages of a run.

::

    python -P -m gossamer_orchestrator.results.plots.child

loads what drawing needs, reads its task as JSON from the standard input, and writes what came of each page to the standard
output, a line of JSON each. Without a task it ends.
"""

from __future__ import annotations

import json
import signal
import sys
from dataclasses import asdict
from io import BytesIO
from pathlib import Path

from gossamer_files.pictures import picture

from ...errors import OrchestratorError
from ..files import load_results
from .save import draw_pages


def main() -> None:
    """Draw the pages of the task that stands on the standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the command
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # leaves no unfinished file
    with picture(BytesIO()) as figure:
        figure.subplots().set_yscale("log")  # loads matplotlib, its fonts and its formulas
    text = sys.stdin.read()
    if not text:
        return
    task = json.loads(text)
    folder = Path(task["folder"])
    try:
        data = load_results(folder).isel(time=slice(None, None, task["every"]))
        for page in draw_pages(data, folder, "png", folder, slice(*task["share"])):
            print(json.dumps(asdict(page), default=str), flush=True)
    except OrchestratorError as error:
        print(json.dumps({"error": str(error)}))


if __name__ == "__main__":
    main()
