"""Verify an FMU in processes that it may crash or hang.

The archive is checked here and unpacked; everything that reads or runs its content happens in a process of its own
(``worker``). When that process dies or hangs, the check that it was making has failed, and another process
continues with the next check.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path

from ..errors import FmuError
from ..fmi.archive import check_archive, unpack
from .checks import CHECKS
from .findings import FAILED, NOT_APPLICABLE, PASSED, Finding

LIMIT = 30.0  # [s]


def verify(
    path: Path,
    *,
    only: Collection[str] | None = None,
    limit: float = LIMIT,
    progress: Callable[[Finding], None] = lambda _finding: None,
) -> list[Finding]:
    """Check an FMU, FMI 2.0 or 3.0 for co-simulation.

    Parameters
    ----------
    path : Path
        The FMU. It need not be trusted as an archive, but its code is run.
    only : collection of str, optional
        Names of checks to make, besides those that others depend on; all of them by default.
    limit : float
        Time that one check may take [s]; an FMU that takes longer is stopped.
    progress : callable, optional
        Called with every finding as it is made.

    Returns
    -------
    list of Finding
        One per check. A check that an earlier failure makes meaningless is not applicable.
    """
    findings: list[Finding] = []

    def add(check: str, verdict: str, why: str) -> None:
        findings.append(Finding(check=check, verdict=verdict, why=why))
        progress(findings[-1])

    # The FMU may leave anything behind, and on Windows its library may still be open.
    with tempfile.TemporaryDirectory(prefix="gossamer-", ignore_cleanup_errors=True) as scratch:
        folder = Path(scratch) / "fmu"
        try:
            check_archive(path)
            unpack(path, folder)
        except FmuError as error:
            add("archive", FAILED, str(error))
            return findings
        add("archive", PASSED, f"{sum(p.is_file() for p in folder.rglob('*'))} files, none damaged or misplaced.")
        _run_checks(path.resolve(), Path(scratch), only, limit, add)
    return findings


def _run_checks(
    path: Path, scratch: Path, only: Collection[str] | None, limit: float, add: Callable[[str, str, str], None]
) -> None:
    """Run all checks, in as many processes as it takes."""
    names = [name for name, check in CHECKS.items() if check.gate or only is None or name in only]
    while names:
        found, death = _run_process(path, scratch, limit, names)
        if len(found) < len(names) and death is not None:
            found.append((FAILED, death))
        for verdict, why in found:
            name = names.pop(0)
            add(name, verdict, why)
            if verdict == FAILED and CHECKS[name].gate:
                while names:
                    add(names.pop(0), NOT_APPLICABLE, f"The check {name!r} failed.")


def _run_process(path: Path, scratch: Path, limit: float, names: list[str]) -> tuple[list[tuple[str, str]], str | None]:
    """Run checks in one process; return its findings, and why it ended if some are missing."""
    report, late = scratch / "report", scratch / "late"
    for file in (report, late):
        file.write_bytes(b"")
    command = [sys.executable, "-m", f"{__package__}.worker", str(path), str(scratch), str(limit), *names]
    code: int | None = None
    with suppress(subprocess.TimeoutExpired):
        code = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
            cwd=scratch,
            env=os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(scratch)),
            timeout=limit * (len(names) + 1),
        ).returncode
    lines = report.read_text("utf-8").split("\n")[:-1]  # without a line cut short by the end of the process
    found = [(str(verdict), str(why)) for verdict, why in map(json.loads, lines)]
    death = None
    if code is None or late.stat().st_size:
        death = f"The FMU did not answer within {limit:g} s."
    elif code < 0:
        death = f"The FMU crashed its process: {_signal_name(-code)}."
    elif code or not found:
        death = f"The FMU ended its process with exit code {code:#x}."
    return found, death


def _signal_name(number: int) -> str:
    """Name a signal; real-time signals have no name of their own."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return signal.strsignal(number) or f"signal {number}"
