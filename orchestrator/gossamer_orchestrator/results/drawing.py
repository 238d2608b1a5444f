"""Draw the pictures of a run in processes of their own, which get ready while it goes on.

They end with this process: at once while they wait for their task, else when they have drawn.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

logger = logging.getLogger(__name__)

SHARES = ((0, 1), (1, None))  # of the pictures, for a process each: the first one takes about as long as all others


class Drawing:
    """Processes that divide the pages of a run among themselves; the end of the ``with`` block ends them."""

    def __init__(self) -> None:
        self._processes = [
            subprocess.Popen(
                [sys.executable, "-P", "-m", "gossamer_orchestrator.results.report.pictures"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                text=True,
                encoding="utf-8",
                start_new_session=True,  # Ctrl-C in a terminal is for this process
            )
            for _ in SHARES
        ]

    def __enter__(self) -> Drawing:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            with suppress(BrokenPipeError), process:
                process.terminate()

    def begin(self, folder: Path, every: int) -> None:
        """Let them draw the results in a folder, one of so many points, while this process goes on."""
        for process, share in zip(self._processes, SHARES, strict=True):
            assert process.stdin is not None
            task = {"folder": str(folder), "every": every, "share": share}
            with suppress(BrokenPipeError):  # it has ended, as ``finish`` will say
                json.dump(task, process.stdin)
                process.stdin.close()

    def finish(self) -> list[Path]:
        """Wait for the pictures; return the paths of those that were drawn, and warn of what went wrong."""
        from .report.pictures import Picture, paths_of

        pages, problems = [], []
        for process in self._processes:
            for line in process.stdout or ():
                try:
                    report = json.loads(line)
                except ValueError:  # a library printed it
                    continue
                if "error" in report:
                    problems.append(report["error"])
                else:
                    pages.append(Picture(**report | {"path": Path(report["path"])}))
            if code := process.wait():
                problems.append(f"a process that draws them ended with exit code {code}.")
        problems += [page.failure for page in pages if page.failure]
        if problems:
            why = " ".join(dict.fromkeys(problems))
            logger.warning("pictures are missing: %s Draw them again with 'gossamer plot'.", why)
        return paths_of(pages)
