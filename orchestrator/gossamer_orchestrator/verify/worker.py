"""Make checks as a program, in a process that the FMU may crash.

::

    python -m gossamer_orchestrator.verify.worker FMU FOLDER CHECK ...

writes a line of JSON per check, verdict and sentence, to ``FOLDER/report``, and counts calls in ``FOLDER/calls``, see
``Calls``; ``FOLDER/fmu`` holds the unpacked FMU.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
from functools import cache
from pathlib import Path

from ..fmi.slave import Log
from .calls import Calls
from .checks import CHECKS
from .registry import FAILED
from .subject import Subject

_END_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux


def main(path: str, scratch: str, *names: str) -> None:
    """Run checks by name; stop after a gate that failed."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_END_WITH_PARENT, signal.SIGKILL)
    log, calls = Log(), Calls(Path(scratch, "calls"))
    subject = cache(lambda: Subject(Path(path), Path(scratch, "fmu"), log, calls))
    with Path(scratch, "report").open("a", encoding="utf-8") as report:
        for name in names:
            verdict, why = CHECKS[name](subject, log)
            report.write(json.dumps([verdict, why]) + "\n")
            report.flush()
            log.messages.clear()
            if (verdict == FAILED and CHECKS[name].gate) or subject().fatal:
                break
    os._exit(0)  # an FMU's library may crash at the end of a process, which is none of the checks


if __name__ == "__main__":
    main(*sys.argv[1:])
