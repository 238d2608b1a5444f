"""Run a command many times, kill it at another moment each time, and run it with too little space on the disk.

::

    python disturbed_command.py SEED TIMES COMMAND ...

runs the command in ``complete``, a copy of the folder ``before``, and counts the moments at which a name or a file in this
folder changes. Then it runs it in other copies: in ``killed_0``, ``killed_1``, ... it ends itself with SIGKILL at a moment
drawn from the seed, and a file that is opened then has been emptied, as the system does; in ``full_0``, ... no file may
become larger than a limit.
"""

import errno
import os
import random
import resource
import shutil
import signal
import sys
from pathlib import Path

from gossamer.cli import main as command_line

CHANGES = ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate")
LIMITS = (2_000, 30_000, 300_000)  # [byte]


def run(command, at, limit, report):
    """Run the command in this process and this folder; write the number of moments into ``report``."""
    inside, count = Path.cwd(), 0

    def watch(event, arguments):
        nonlocal count
        if event not in CHANGES or not isinstance(arguments[0], str | bytes):
            return
        if event == "open" and not arguments[2] & (os.O_WRONLY | os.O_RDWR):
            return
        path = Path(os.fsdecode(arguments[0])).absolute()
        if not path.is_relative_to(inside):
            return
        count += 1
        if count == at:
            if event == "open" and path.is_file() and arguments[2] & os.O_TRUNC:
                os.truncate(path, 0)
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)
    if limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    code = 0
    try:
        command_line(command)
    except SystemExit as end:
        code = int(end.code or 0)
    os.write(report, str(count).encode())
    return code


def fork(folder, command, at=0, limit=0):
    """Run the command in another process, which has everything loaded; return how it ended and its moments."""
    shutil.copytree("before", folder)
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        os._exit(run(command, at, limit, writing))
    os.close(writing)
    with os.fdopen(reading) as report:
        text = report.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), int(text or 0)


def main(seed, times, *command):
    """Run the command once, then disturb it."""
    code, total = fork("complete", command)
    times = int(times)
    if code or not total:
        sys.exit(f"the command ended with code {code} after {total} moments")
    moments = [*range(1, total + 1)] * (times // total + 1)  # each of them once before any is taken twice
    for number, at in enumerate(random.Random(int(seed)).sample(moments, times)):
        code, _ = fork(f"killed_{number}", command, at)
        if code != -signal.SIGKILL:
            sys.exit(f"it was not killed at moment {at} of {total}, but ended with code {code}")
    codes = [fork(f"full_{number}", command, limit=limit)[0] for number, limit in enumerate(LIMITS[:times])]
    if codes[0] != 1 or not set(codes) <= {0, 1}:
        sys.exit(f"with little space it ended with codes {codes}: {os.strerror(errno.EFBIG)} was expected")


if __name__ == "__main__":
    main(*sys.argv[1:])
