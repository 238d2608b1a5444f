"""Call the command line in this process, as a shell would."""

from __future__ import annotations

import contextlib
import io
from typing import NamedTuple

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
