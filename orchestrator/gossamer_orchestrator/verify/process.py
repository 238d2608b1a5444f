"""Verify an FMU in processes that it may crash or hang.

The archive is checked here and unpacked; everything that reads or runs its content happens in a process of its own
(``worker``). When that process dies or hangs, the check that it was making has failed, and another process
continues with the next check.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Collection
from contextlib import closing, suppress
from pathlib import Path

from ..errors import FmuError
from ..fmi.archive import unpack
from ..processes import end_all, marked
from .calls import PATIENCE, Watch
from .checks import CHECKS
from .registry import FAILED, NOT_APPLICABLE, PASSED, REMARK, Finding

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
        names = [name for name, check in CHECKS.items() if check.gate or only is None or name in only]
        left = 0
        while names:
            found, more = _run_process(path.resolve(), Path(scratch), limit, names)
            findings, left = findings + found, left + more
            last, names = findings[-1], names[names.index(findings[-1].check) + 1 :]
            if last.verdict == FAILED and CHECKS[last.check].gate:
                why = f"The check {last.check!r} failed."
                findings += [Finding(name, NOT_APPLICABLE, why) for name in names]
                break
    if left:
        why = f"It left {left} running process{'es' * (left > 1)} behind, which verify has ended."
        findings.append(Finding("processes", REMARK, why))
    return findings


def _run_process(path: Path, scratch: Path, limit: float, names: list[str]) -> tuple[list[Finding], int]:
    """Run checks in one process; return its findings, the last one that it died or hung if it did, and what it left."""
    report = scratch / "report"
    report.write_bytes(b"")
    command = [sys.executable, "-m", f"{__package__}.worker", str(path), str(scratch), *names]
    with closing(Watch(scratch / "calls", limit)) as watch:
        code, left = _watch_process(command, scratch, watch)
        called = watch.in_call()
    lines = report.read_text("utf-8").split("\n")[:-1]  # without a line cut short by the end of the process
    findings = [Finding(name, *json.loads(line)) for name, line in zip(names, lines, strict=False)]
    death, verdict = None, FAILED
    if code is None and called:
        death = f"The FMU did not answer within {limit:g} s."
    elif code is None:
        death = f"The check itself took more than {PATIENCE:g} s; no function of the FMU was running."
        verdict = FAILED if CHECKS[names[len(findings)]].gate else REMARK
    elif code < 0:
        name = next((each.name for each in signal.Signals if each == -code), f"signal {-code}")  # some have no name
        death = f"The FMU crashed its process: {name}."
    elif code or not findings:
        death = f"The FMU ended its process with exit code {code:#x}."
    if death is not None and len(findings) < len(names):
        findings.append(Finding(names[len(findings)], verdict, death))
    return findings, left


def _watch_process(command: list[str], scratch: Path, watch: Watch) -> tuple[int | None, int]:
    """Run a worker; return its exit code, None if it made no progress, and how many processes it left behind."""
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=scratch,
        env=marked(scratch),
        start_new_session=True,
    ) as child:
        code: int | None = None
        try:
            while code is None and not watch.is_late():
                with suppress(subprocess.TimeoutExpired):
                    code = child.wait(_POLL)
        finally:
            left = end_all(child, scratch)
    return code, left
