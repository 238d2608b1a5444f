"""Cuts of the training stretch in time order: what to fit, what to judge by; and shorter records for many trial fits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Rows
from ..fitting.records import Record, thin

FITTED = (0.6, 0.8)  # of the training samples of every record; the rest is predicted
MOST_TRIED = 4000  # samples of all records of a trial fit


def cut(train: Sequence[Rows], share: float = FITTED[0]) -> tuple[tuple[Rows, ...], tuple[Rows, ...]]:
    """Return the leading share of the training samples of every record, and the later ones."""
    fitted, held = [], []
    for rows in train:
        places = np.flatnonzero(rows)
        early = np.zeros_like(rows)
        early[places[: round(share * places.size)]] = True
        fitted.append(early)
        held.append(rows & ~early)
    return tuple(fitted), tuple(held)


def shortened(records: Sequence[Record], train: Sequence[Rows]) -> tuple[tuple[Record, ...], tuple[Rows, ...]]:
    """Return records that have too many samples for many trial fits thinned, and their training samples."""
    short = thin(records, MOST_TRIED)
    return short, tuple(np.isin(s.lines, r.lines[rows]) for s, r, rows in zip(short, records, train, strict=True))
