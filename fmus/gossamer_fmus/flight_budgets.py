"""Measure what a component needs on a Cortex-M7: compiled by Debian's compiler, run by QEMU.

An instruction count is no time: memory that waits, caches and interrupts are not in it.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from gossamer_models import GossamerError

TOOLS = {
    "make": "make",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi and libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
}
PATIENCE = 600.0  # [s]
_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*?(?:\\n(\d+) bytes \((\w+)\)[^"]*)?"')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')


class FlightError(GossamerError, RuntimeError):
    """A component could not be compiled or run for its processor."""


def missing_tools() -> list[str]:
    """Return the Debian packages of what ``budgets`` needs and this machine does not have."""
    missing = [package for tool, package in TOOLS.items() if shutil.which(tool) is None]
    if not missing:
        library = subprocess.run(
            ["arm-none-eabi-gcc", "-print-file-name=rdimon.specs"], capture_output=True, text=True, check=False
        ).stdout
        missing += ["libnewlib-arm-none-eabi"] * ("/" not in library)
    return missing


def require_tools(what: str = "budgets need") -> None:
    """Raise ``FlightError`` where this machine lacks what ``budgets`` needs."""
    if missing := missing_tools():
        msg = f"{what} {', '.join(missing)} (packages of Debian). Install them, or leave that out."
        raise FlightError(msg)


def budgets(folder: Path, name: str) -> dict[str, float]:
    """Compile a component for a Cortex-M7 and run its golden vectors under QEMU.

    Parameters
    ----------
    folder : Path
        As ``flight`` writes it.
    name : str
        Of the component.

    Returns
    -------
    dict
        ``text`` and ``rodata`` [byte] of the component with all that it reads; ``ram`` and ``work`` [byte] of RAM;
        ``stack`` [byte], the bound of ``step`` and ``init`` along the call graph, without functions of the C library;
        ``stack_in_use`` [byte], the most that a run with them painted over, the runner and printf included; ``most`` and
        ``mean`` instructions of a step, ``random`` the most in random states with any samples; ``worst`` error over golden
        vectors, relative to the largest of each result.

    Raises
    ------
    FlightError
        A tool is missing, the code is refused, a frame has no bound, or the golden vectors are not met.
    """
    require_tools()
    with TemporaryDirectory() as temporary:
        copy = Path(temporary) / "flight"
        shutil.copytree(folder, copy)
        run_tool(["make", "-s", "measured.o"], copy)
        sizes = _sections(run_tool(["arm-none-eabi-size", "-A", "measured.o"], copy))
        graph = next(copy.glob("*.ci")).read_text(encoding="utf-8")
        bounds = [stack_bound(graph, f"{name}_{each}") for each in ("init", "step", "slice") if f"{name}_{each}" in graph]
        printed = run_tool(["make", "-s", "qemu"], copy)
    found = {key: float(value) for key, value in re.findall(r"^(\w+) (\S+)$", printed, re.MULTILINE)}
    kept = {key: found[key] for key in ("ram", "work", "most", "mean", "random", "worst", "different")}
    return sizes | {"stack": max(bounds), "stack_in_use": found["stack"]} | kept


def stack_bound(graph: str, begin: str) -> float:
    """Return the largest sum of frames [byte] along a call graph of GCC's ``-fcallgraph-info=su``.

    Raises
    ------
    FlightError
        A function calls itself, or its frame has no bound.
    """
    frames = {title: (int(size or 0), kind) for title, size, kind in _NODE.findall(graph)}
    calls: dict[str, list[str]] = {}
    for caller, called in _EDGE.findall(graph):
        calls.setdefault(caller, []).append(called)

    def deepest(title: str, above: tuple[str, ...]) -> int:
        size, kind = frames.get(title, (0, ""))
        if title in above or title == "__indirect_call" or kind not in ("", "static", "dynamic,bounded"):
            msg = f"the stack of {begin} has no bound: {' > '.join([*above, title])}. Report it as a defect."
            raise FlightError(msg)
        return size + max((deepest(each, (*above, title)) for each in calls.get(title, ())), default=0)

    starts = [title for title in frames if title.split(":")[-1] == begin]
    return float(max(deepest(title, ()) for title in starts))


def _sections(printed: str) -> dict[str, float]:
    sizes = {"text": 0.0, "rodata": 0.0}
    for section, size in re.findall(r"^(\.\S+)\s+(\d+)", printed, re.MULTILINE):
        for kind in sizes:
            sizes[kind] += float(size) * section.startswith(f".{kind}")
        if section.startswith((".data", ".bss")) and int(size):
            msg = f"the component has {size} bytes of global state in {section}. Report it as a defect."
            raise FlightError(msg)
    return sizes


def run_tool(command: Iterable[str], folder: Path, patience: float = PATIENCE) -> str:
    """Run a program in a folder and return what it printed; ``FlightError`` if it fails or takes ``patience`` [s]."""
    words = list(command)
    # a group of its own, so that make and the emulator that it runs end together
    with subprocess.Popen(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        try:
            out, errors = running.communicate(timeout=patience)
        except BaseException as error:
            with suppress(ProcessLookupError):  # it has just ended
                os.killpg(running.pid, signal.SIGKILL)
            if not isinstance(error, subprocess.TimeoutExpired):
                raise
            msg = f"{' '.join(words)} did not end within {patience:g} s. The board may have stopped."
            raise FlightError(msg) from error
    if running.returncode:
        msg = f"{' '.join(words)} failed with code {running.returncode}:\n{(out + errors)[-2000:]}"
        raise FlightError(msg)
    return out
