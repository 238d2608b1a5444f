"""Make checks as a program, in a process that the FMU may crash.

::

    python -m gossamer_orchestrator.verify.worker FMU FOLDER SECONDS CHECK ...

writes a line of JSON per check, verdict and sentence, to ``FOLDER/report``; ``FOLDER/fmu`` holds the unpacked FMU.
"""

from __future__ import annotations

import faulthandler
import json
import os
import sys
from functools import cache
from pathlib import Path

from ..fmi.slave import Log
from .checks import CHECKS
from .registry import FAILED
from .subject import Subject


def main(path: str, scratch: str, limit: str, *names: str) -> None:
    """Run checks by name; stop after a gate that failed."""
    log = Log()
    subject = cache(lambda: Subject(Path(path), Path(scratch, "fmu"), log))
    # The watchdog needs nothing from Python, so it also ends a hanging C function. It leaves a trace in "late".
    with Path(scratch, "report").open("a", encoding="utf-8") as report, Path(scratch, "late").open("w") as late:
        for name in names:
            faulthandler.dump_traceback_later(float(limit), exit=True, file=late)
            verdict, why = CHECKS[name](subject, log)
            faulthandler.cancel_dump_traceback_later()
            report.write(json.dumps([verdict, why]) + "\n")
            report.flush()
            log.messages.clear()
            if (verdict == FAILED and CHECKS[name].gate) or subject().fatal:
                break
    os._exit(0)  # an FMU's library may crash at the end of a process, which is none of the checks


if __name__ == "__main__":
    main(*sys.argv[1:])
