"""The program ``gossamer``: the command line, and how the signals that ask for its end do end it.

They all do what Ctrl-C does: a command is interrupted, says so, and leaves whole files. After that nothing holds it up, such
as a thread that is still at work.
"""

import os
import signal
import sys
from contextlib import suppress

INTERRUPTED = 130  # exit code


def main() -> None:
    """Run the command line; exit with its code."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:  # not under nohup
            signal.signal(number, signal.default_int_handler)
    try:
        from .cli import main as command_line

        command_line()
    except SystemExit as end:
        if end.code != INTERRUPTED:
            raise
    except KeyboardInterrupt:  # before the command began, or again while it ended
        with suppress(KeyboardInterrupt):
            print("Interrupted.", file=sys.stderr)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
