"""Verdicts of slow judges, kept beside the simulations, so that an interrupted assessment goes on where it stopped."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from gossamer_files import replacing

from ..arrays import Matrix
from .judges import Judge, Verdicts

SLOW = 8  # records that are judged, then kept, at a time
PARTS = ("damage", "deviation", "probability", "valid")


def ask(judge: Judge, histories: Matrix, step: float, folder: Path) -> Verdicts:
    """Return the verdicts on n records: at once, or from a slow judge some at a time, those kept from before first.

    Parameters
    ----------
    judge : Judge
        Slow if it has time for some records only.
    histories : ndarray, shape (n, 4, T)
        What it reads.
    step : float
        Sampling step [s].
    folder : Path
        Where verdicts are kept: a file's name is a digest of the judge's identity, the records and the step.
    """
    if judge.most is None:
        return judge(histories, step)
    parts = []
    for begin in range(0, len(histories), SLOW):
        some = np.ascontiguousarray(histories[begin : begin + SLOW])
        key = hashlib.sha256(f"{judge.identity} {step!r} {some.shape} {some.dtype}".encode() + some.tobytes())
        path = folder / f"{key.hexdigest()[:32]}.npz"
        if not path.exists():
            found = judge(some, step)
            with replacing(path) as unfinished:
                np.savez(
                    unfinished, **{name: getattr(found, name) for name in PARTS if getattr(found, name) is not None}
                )
        with np.load(path, allow_pickle=False) as arrays:
            parts.append(dict(arrays))
    return Verdicts(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
