"""Interrupt batches of cases twice while C runs, and print how many numbers of arrays that were made then have changed."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from gossamer_models.batch import Batch
from gossamer_models.batch.kernel import Kernel
from test_batch import toy

CASES, STEPS = 16, 100_000  # a block of eight cases for each of two threads, some 50 ms


def raise_in_the_run(_signal: int, frame: object) -> None:
    """Interrupt the main thread if it waits for C, wherever it waits."""
    while frame is not None:
        if frame.f_code is Kernel.run.__code__:
            raise KeyboardInterrupt
        frame = frame.f_back


def interrupt(pause: float) -> None:
    """Interrupt this process twice."""
    for _ in range(2):
        time.sleep(pause)
        os.kill(os.getpid(), signal.SIGINT)


def main(rounds: int) -> None:
    """Interrupt so many runs, each after another pause."""
    signal.signal(signal.SIGINT, raise_in_the_run)
    batch = Batch(toy(), ["root", "level"])
    interrupted = changed = 0
    for pause in np.linspace(0.005, 0.02, rounds):
        sender = threading.Thread(target=interrupt, args=(pause,))
        sender.start()
        try:
            batch.run(STEPS, 1e-3, {"rate": np.ones(CASES)}, workers=2)
        except KeyboardInterrupt:
            interrupted += 1
        others = [np.full((CASES, 2, STEPS), 7.0) for _ in range(3)]
        sender.join()
        time.sleep(0.1)
        changed += sum(int((each != 7.0).sum()) for each in others)
    print(interrupted, changed)


if __name__ == "__main__":
    main(int(sys.argv[1]))
