"""Run a command many times, kill it at another moment each time, and run it with too little space on the disk.

::

    python disturbed_command.py SEED TIMES COMMAND ...

runs the command in ``complete``, a copy of the folder ``before``, and counts the moments at which a name or a file in this
folder changes. Then it runs it in other copies, where it is killed with SIGKILL: in ``killed_0``, ``killed_2``, ... it ends
itself at such a moment drawn from the seed, and a file that is opened then has been emptied, as the system does; in
``killed_1_0``, ``killed_3_0``, ... it is killed at any time of its life, one in each of equal parts of that; where it has
ended before, in ``killed_1_1`` after half of that, and so on. Times are of the processor, so that they fall alike on a busy
machine. How many were alive stands on the standard output. In ``full_0``, ... no file may become larger than a limit.
"""

import errno
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import warnings
from contextlib import suppress
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))

from command_line import wait_for_work
from gossamer.cli import main as command_line

CHANGES = ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate")
EARLIER = 6  # tries to kill it before it ends, each after half the time
LIMITS = (2_000, 30_000, 300_000)  # [byte]


def run(command, at, limit, report):
    """Run the command in this process and this folder; write the number of moments and what was imported into ``report``."""
    inside, count, before = Path.cwd(), 0, set(sys.modules)

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
    with os.fdopen(report, "w") as file:
        json.dump([count, [name for name in sys.modules if name not in before]], file)
    return code


def fork(folder, command, at=0, limit=0, after=None):
    """Run the command in another process, and kill it after a time [s], if that is given.

    Return how it ended, its moments, the time that it took and its modules.
    """
    shutil.copytree("before", folder)
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        os._exit(run(command, at, limit, writing))
    os.close(writing)
    if after is not None:
        wait_for_work(child, after)
        os.kill(child, signal.SIGKILL)  # a process that has ended can be sent signals until its parent knows of it
    with os.fdopen(reading) as report:
        total, modules = json.loads(report.read() or "[0, []]")
    _, status, usage = os.wait4(child, 0)
    return os.waitstatus_to_exitcode(status), total, usage.ru_utime + usage.ru_stime, modules


def load(modules):
    """Import what the command needs, so that the others begin with their work."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in modules:
            with suppress(ImportError):  # some are made when they are asked for
                importlib.import_module(name)


def main(seed, times, *command):
    """Run the command once, then disturb it."""
    code, total, _, modules = fork("complete", command)
    if code or not total:
        sys.exit(f"the command ended with code {code} after {total} moments")
    load(modules)
    _, total, life, _ = fork("again", command)
    times = int(times)
    moments = [*range(1, total + 1)] * (times // total + 1)  # each of them once before any is taken twice
    draw, anytime, alive = random.Random(int(seed)), times // 2, 0
    for number, at in enumerate(draw.sample(moments, times)):
        if number % 2:
            after, code = life * (number // 2 + draw.random()) / anytime, 0
            for again in range(EARLIER):
                if not code:
                    code, *_ = fork(f"killed_{number}_{again}", command, after=after / 2.0**again)
            if code not in (0, -signal.SIGKILL):
                sys.exit(f"killed at any time it ended with code {code}")
            alive += code != 0
            continue
        code, *_ = fork(f"killed_{number}", command, at)
        if code != -signal.SIGKILL:
            sys.exit(f"it was not killed at moment {at} of {total}, but ended with code {code}")
    print(f"{alive} of {anytime} were alive")
    codes = [fork(f"full_{number}", command, limit=limit)[0] for number, limit in enumerate(LIMITS[:times])]
    if codes[0] != 1 or not set(codes) <= {0, 1}:
        sys.exit(f"with little space it ended with codes {codes}: {os.strerror(errno.EFBIG)} was expected")


if __name__ == "__main__":
    main(*sys.argv[1:])
