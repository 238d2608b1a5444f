"""Call the command line in this process, as a shell would; wait until one in another process has done some work."""

from __future__ import annotations

import contextlib
import io
import time
from typing import NamedTuple

import psutil
from gossamer.cli import main


class Called(NamedTuple):
    """How a command ended, and what it printed."""

    exit_code: int
    stdout: str
    stderr: str

    @property
    def output(self):
        return self.stdout + self.stderr


def invoke(arguments):
    """Call ``gossamer`` with some arguments."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        try:
            main([str(each) for each in arguments])
        except SystemExit as end:
            code = end.code
    return Called(code, stdout.getvalue(), stderr.getvalue())


def call(*arguments):
    """Call ``gossamer`` with some arguments."""
    return invoke(arguments)


def work(process):
    """Return the processor time [s] of a process and its children, which a busy machine does not stretch."""
    total = 0.0
    for each in (process, *process.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            taken = each.cpu_times()
            total += sum(taken[:2]) + (sum(taken[2:4]) if each is process else 0.0)
    return total


def wait_for_work(pid, seconds):
    """Return the work [s] of a process once it has done so much, or has ended and waits for its parent."""
    done = 0.0
    with contextlib.suppress(psutil.NoSuchProcess):
        process = psutil.Process(pid)
        while process.status() != psutil.STATUS_ZOMBIE:
            done = max(done, work(process))
            if done >= seconds:
                break
            time.sleep(0.03)
    return done
