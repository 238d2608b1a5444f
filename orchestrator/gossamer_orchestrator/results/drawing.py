"""Draw the pictures of a run in processes of their own, which get ready before it ends.

Each takes some 120 MB, so they start late, and pictures of a long run are drawn in this process. They end with it: at once
while they wait for their task, else when they have drawn.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from gossamer_files.pictures import picture

from ..errors import OrchestratorError
from ..processes import start
from .files import NETCDF, UNFINISHED_NETCDF, load_results, stays_on_disk

if TYPE_CHECKING:
    from .report.pictures import Picture

logger = logging.getLogger(__name__)

Share: TypeAlias = tuple[int, int | None]
# of the pictures, for a process each: the first one takes about as long as all others
SHARES: tuple[Share, ...] = ((0, 1), (1, None))
LONG = 60.0  # [s], a run for whose pictures one may wait a little longer


class Drawing:
    """Processes that divide the pictures of a run among themselves; the end of the ``with`` block ends them."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._begun = folder, time.monotonic()
        self._processes: list[subprocess.Popen[str]] = []

    def get_ready(self) -> None:
        """Start the processes, which takes them two seconds, unless that was done or the run is long."""
        if not self._processes and not self._is_long():
            with suppress(OSError):  # too many processes: this one draws what they do not
                self._processes = [_start() for _ in SHARES]

    def _is_long(self) -> bool:
        paths = [self._folder / name for name in (UNFINISHED_NETCDF, NETCDF)]
        results = next((path for path in paths if path.is_file()), None)
        return time.monotonic() - self._begun > LONG or (results is not None and stays_on_disk(results))

    def __enter__(self) -> Drawing:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            with suppress(BrokenPipeError), process:
                process.terminate()

    def begin(self, every: int) -> None:
        """Let them draw the results in the folder, one of so many points, while this process goes on."""
        self.get_ready()
        self._task = {"folder": str(self._folder), "every": every}
        for process, share in zip(self._processes, SHARES, strict=False):
            self._give(process, share)

    def _give(self, process: subprocess.Popen[str], share: Share) -> None:
        assert process.stdin is not None
        with suppress(BrokenPipeError):  # it has ended, as ``finish`` will say
            json.dump(self._task | {"share": share}, process.stdin)
            process.stdin.close()

    def finish(self) -> list[Path]:
        """Wait for the pictures; return the paths of those that were drawn, and warn of what went wrong."""
        from .report.pictures import paths_of

        pages, problems = [], []
        for process, share in zip(tuple(self._processes), SHARES, strict=False):  # or none
            drawn, wrong = self._heard(process, share)
            pages += drawn
            problems += wrong
        if not self._processes:
            try:
                pages = list(_draw(self._task))
            except Exception as error:
                problems = [str(error) or type(error).__name__]
        problems += [page.failure for page in pages if page.failure]
        if problems:
            why = " ".join(dict.fromkeys(problems))
            logger.warning("pictures are missing: %s Draw them again with 'gossamer plot'.", why)
        return paths_of(pages)

    def _heard(self, process: subprocess.Popen[str], share: Share, *, again: bool = True) -> tuple[list[Picture], list[str]]:
        """Return what a process drew, and what went wrong; what it had not begun when it was killed another one draws."""
        from .report.pictures import Picture

        pages: list[Picture] = []
        problems, begun = [], ""
        for line in process.stdout or ():
            try:
                report = json.loads(line)
            except ValueError:  # a library printed it
                continue
            if "error" in report:
                problems.append(report["error"])
            elif "begun" in report:
                begun = report["begun"]
            else:
                pages.append(Picture(**report | {"path": Path(report["path"])}))
                begun = ""
        code = process.wait()
        if code and begun:
            problems.append(f"{begun} ended the process that drew it, with exit code {code}.")
        elif code and not again:
            problems.append(f"a process that draws them ended with exit code {code}.")
        if code and again:
            rest = (share[0] + len(pages) + bool(begun), share[1])
            self._processes.append(_start())
            self._give(self._processes[-1], rest)
            drawn, wrong = self._heard(self._processes[-1], rest, again=False)
            return pages + drawn, problems + wrong
        return pages, problems


def _start() -> subprocess.Popen[str]:
    return start(draw_share, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8")


def draw_share() -> None:
    """Draw the pictures of the task that stands on the standard input as JSON; say what came of each on the standard output.

    It loads what drawing needs at first. Without a task it ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the command
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # leaves no unfinished file
    from .report import pictures  # noqa: F401 (loads what reads results)

    with picture(BytesIO()) as figure:
        figure.subplots().set_yscale("log")  # loads matplotlib, its fonts and its formulas
    try:
        task = json.loads(sys.stdin.read())
    except ValueError:  # no task, or the begin of one: the command was ended
        return
    try:
        for each in _draw(task, lambda path: _say({"begun": path})):
            _say(asdict(each))
    except OrchestratorError as error:
        _say({"error": str(error)})


def _draw(task: dict[str, Any], tell: Callable[[Path], None] = lambda _: None) -> Iterator[Picture]:
    """Draw the share of a task, or all; ``tell`` is called with the path of each picture before it is drawn."""
    from .report.pictures import draw_pictures

    folder = Path(task["folder"])
    data = load_results(folder)
    data = data.isel(time=slice(None, None, task["every"])) if task["every"] > 1 else data
    return draw_pictures(data, folder, "png", folder, slice(*task.get("share", [None])), tell)


def _say(report: dict[str, object]) -> None:
    """Tell the process that waits for the pictures; where it was ended they are drawn all the same."""
    try:
        print(json.dumps(report, default=str), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # where the rest may go, at exit too
