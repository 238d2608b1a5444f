"""Verify an FMU in processes that it may crash or hang.

The archive is checked here and unpacked; everything that reads or runs its content happens in a process of its own. When
that process dies or hangs, the check that it was making has failed, and another process continues with the next check.

The time limit holds for the FMU, not for the checks, so what is timed is a call. A counter in shared memory is odd during
one. The process that watches it needs nothing from the other, so it also ends a C function that hangs while it holds
Python's lock, or a process that has stopped itself.
"""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection
from contextlib import suppress
from functools import cache
from pathlib import Path

from ..errors import FmuError
from ..fmi.archive import has_backslashes, unpack
from ..fmi.slave import Log
from ..processes import end_all, shared_memory, signal_name, start
from . import behaviour_checks, reference_check  # noqa: F401 (they register their checks)
from .checks import CHECKS, FAILED, NOT_APPLICABLE, PASSED, REMARK, Finding
from .subject import Calls, Subject

PATIENCE = 600.0  # [s] between calls: XML of any size has been checked by then
_END_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
LIMIT = 30.0  # [s]
_POLL = 0.05  # [s]


def verify(path: Path, *, only: Collection[str] | None = None, limit: float = LIMIT) -> list[Finding]:
    """Check an FMU, FMI 2.0 or 3.0; its behaviour if it is for co-simulation.

    Parameters
    ----------
    path : Path
        The FMU. It need not be trusted as an archive, but its code is run.
    only : collection of str, optional
        Names of checks to make, besides those that others depend on; all of them by default.
    limit : float
        Time that one call of the FMU may take [s]; then its process is ended. Checks themselves may take longer.

    Returns
    -------
    list of Finding
        One per check; one more if the FMU leaves processes behind. A check that an earlier failure makes meaningless is
        not applicable.
    """
    # The FMU may leave anything behind, and on Windows its library may still be open.
    with tempfile.TemporaryDirectory(prefix="gossamer-", ignore_cleanup_errors=True) as scratch:
        folder = Path(scratch) / "fmu"
        try:
            unpack(path, folder)
        except FmuError as error:
            return [Finding("archive", FAILED, str(error))]
        files = sum(p.is_file() for p in folder.rglob("*"))
        findings = [Finding("archive", PASSED, f"{files} files, none damaged or misplaced.")]
        if has_backslashes(path):
            findings = [Finding("archive", REMARK, f"{files} files; their names have '\\' where ZIP has '/'.")]
        names = [name for name, check in CHECKS.items() if check.gate or only is None or name in only]
        left = 0
        while names:
            found, more = _run_process(path.resolve(), Path(scratch), limit, names)
            findings, left = findings + found, left + more
            last, names = findings[-1], names[names.index(findings[-1].check) + 1 :]
            if last.verdict in (FAILED, NOT_APPLICABLE) and CHECKS[last.check].gate:
                why = f"The check {last.check!r} {'failed' if last.verdict == FAILED else 'is not applicable'}."
                findings += [Finding(name, NOT_APPLICABLE, why) for name in names]
                break
    if left:
        why = f"It left {left} running process{'es' * (left > 1)} behind, which verify has ended."
        findings.append(Finding("processes", REMARK, why))
    return findings


def _run_process(path: Path, scratch: Path, limit: float, names: list[str]) -> tuple[list[Finding], int]:
    """Run checks in one process; return its findings, the last one that it died or hung if it did, and what it left."""
    report, calls = scratch / "report", scratch / "calls"
    report.write_bytes(b"")
    with shared_memory(calls, 8, new=True) as counter:
        code, left = _watch(path, scratch, limit, names, counter)
        called = counter[0] % 2 == 1
    lines = report.read_text("utf-8").split("\n")[:-1]  # without a line cut short by the end of the process
    findings = [Finding(name, *json.loads(line)) for name, line in zip(names, lines, strict=False)]
    death, verdict = None, FAILED
    if code is None and called:
        death = f"The FMU did not answer within {limit:g} s."
    elif code is None:
        death = f"The check itself took more than {PATIENCE:g} s; no function of the FMU was running."
        verdict = FAILED if CHECKS[names[len(findings)]].gate else REMARK
    elif code < 0:
        death = f"The FMU crashed its process: {signal_name(code)}."
    elif code or not findings:
        death = f"The FMU ended its process with exit code {code:#x}."
    if death is not None and len(findings) < len(names):
        check = CHECKS[names[len(findings)]]
        if check.misuse:
            death = f"The host breaks a rule of FMI here. {death}"
        findings.append(Finding(names[len(findings)], check.bad if verdict == FAILED else verdict, death))
    return findings, left


def _watch(path: Path, scratch: Path, limit: float, names: list[str], counter: mmap.mmap) -> tuple[int | None, int]:
    """Make checks in a process; return its exit code, None if it made no progress, and how many processes it left behind."""
    files = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    with start(make_checks, str(path), str(scratch), *names, mark=scratch, cwd=scratch, **files) as child:
        code, last, since = None, counter[:], time.monotonic()
        try:
            while code is None and time.monotonic() - since <= (limit if last[0] % 2 else PATIENCE):
                with suppress(subprocess.TimeoutExpired):
                    code = child.wait(_POLL)
                if counter[:] != last:
                    last, since = counter[:], time.monotonic()
        finally:
            left = end_all(child, scratch)
    return code, left


def make_checks(path: str, scratch: str, *names: str) -> None:
    """Make checks as the program of a process that the FMU may crash; stop after a gate that failed.

    A line of JSON per check, verdict and sentence, goes to ``report`` in the folder ``scratch``; ``fmu`` there holds the
    unpacked FMU.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_END_WITH_PARENT, signal.SIGKILL)
    log, calls = Log(), Calls(Path(scratch, "calls"))
    subject = cache(lambda: Subject(Path(path), Path(scratch, "fmu"), log, calls))
    for name in names:
        verdict, why = CHECKS[name](subject, log)
        with Path(scratch, "report").open("a", encoding="utf-8") as report:  # nothing is open while the FMU is called
            report.write(json.dumps([verdict, why]) + "\n")
        log.messages.clear()
        if (verdict in (FAILED, NOT_APPLICABLE) and CHECKS[name].gate) or subject().fatal:
            break
    os._exit(0)  # an FMU's library may crash at the end of a process, which is none of the checks
