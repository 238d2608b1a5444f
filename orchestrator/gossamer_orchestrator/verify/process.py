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
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from ..errors import FmuError
from ..fmi.archive import unpack
from .checks import CHECKS
from .registry import FAILED, NOT_APPLICABLE, PASSED, Finding

LIMIT = 30.0  # [s]


def verify(path: Path, *, only: Collection[str] | None = None, limit: float = LIMIT) -> list[Finding]:
    """Check an FMU, FMI 2.0 or 3.0 for co-simulation.

    Parameters
    ----------
    path : Path
        The FMU. It need not be trusted as an archive, but its code is run.
    only : collection of str, optional
        Names of checks to make, besides those that others depend on; all of them by default.
    limit : float
        Time that one check may take [s]; an FMU that takes longer is stopped.

    Returns
    -------
    list of Finding
        One per check. A check that an earlier failure makes meaningless is not applicable.
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
        while names:
            findings += _run_process(path.resolve(), Path(scratch), limit, names)
            last, names = findings[-1], names[names.index(findings[-1].check) + 1 :]
            if last.verdict == FAILED and CHECKS[last.check].gate:
                why = f"The check {last.check!r} failed."
                return findings + [Finding(name, NOT_APPLICABLE, why) for name in names]
    return findings


def _run_process(path: Path, scratch: Path, limit: float, names: list[str]) -> list[Finding]:
    """Run checks in one process; return its findings, the last one that it died or hung if it did."""
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
    findings = [Finding(name, *json.loads(line)) for name, line in zip(names, lines, strict=False)]
    death = None
    if code is None or late.stat().st_size:
        death = f"The FMU did not answer within {limit:g} s."
    elif code < 0:
        name = next((each.name for each in signal.Signals if each == -code), f"signal {-code}")  # some have no name
        death = f"The FMU crashed its process: {name}."
    elif code or not findings:
        death = f"The FMU ended its process with exit code {code:#x}."
    if death is not None and len(findings) < len(names):
        findings.append(Finding(names[len(findings)], FAILED, death))
    return findings
