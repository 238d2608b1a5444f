"""Tables 7.1 to 7.5 of the thesis: damages of its test cases, what its networks said of them, and what it trained with.

M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite Sensors,
dissertation, Virginia Tech, 2010, Chapter 7. ``thesis_tables.csv`` has a row for each case: damages [1] of the cases of
Tables 7.1 and 7.2 (``single``), of Table 7.3, and of Tables 7.4 and 7.5 (``multiple``); predictions as printed, in %.
Table 7.1 prints zone 10 in case 16; its prediction and Table 7.2 say 11. In Table 7.4, 91 in zone 14 of case 8 is a misprint
for 0.91.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from ..arrays import Matrix

NOISE = (0.0, 0.02)  # of Section 7.7: uniform, of every sample of strain [1]
Damages: TypeAlias = tuple[dict[int, float], ...]  # damage [1] by zone of each case


@dataclass(frozen=True)
class ThesisTables:
    """Test cases of one training of the thesis.

    Attributes
    ----------
    name : str
        The two tables: without and with noise.
    cases : tuple of int, length n
        Numbers of the cases.
    damages : tuple of dict, length n
        Damage [1] by zone.
    clean, noisy : ndarray, shape (n, 16)
        Damage [%] that the thesis predicts; not a number where it prints none.
    """

    name: str
    cases: tuple[int, ...]
    damages: Damages
    clean: Matrix
    noisy: Matrix

    @property
    def damage(self) -> Matrix:
        """Damages as an array, shape (n, 16) [1]."""
        return as_array(self.damages)


def as_array(damages: Damages) -> Matrix:
    """Return damages by zone as an array, shape (n, 16) [1]."""
    found = np.zeros((len(damages), ZONES))
    for row, damage in zip(found, damages, strict=True):
        for zone, value in damage.items():
            row[zone - 1] = value
    return found


def _rows(table: str) -> Matrix:
    with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return np.array([row[2:] for row in csv.reader(file) if row[0] == table], dtype=float)


def _cases(table: str) -> Damages:
    return tuple({int(k) + 1: float(row[k]) for k in np.flatnonzero(row)} for row in _rows(table))


TABLE_7_3 = _cases("7.3")  # the reference cases of the second training
_CLEAN, _NOISY = _rows("7.1"), _rows("7.2")
ZONES = _CLEAN.shape[1]  # of the membrane of the thesis
_NONE = np.full((1, ZONES), np.nan)
SINGLE_TRAINING = ThesisTables(
    name="Tables 7.1 and 7.2",
    cases=tuple(range(1, 18)),
    damages=_cases("single"),
    clean=np.vstack([_NONE, _CLEAN]),
    noisy=np.vstack([_NONE, _NOISY]),
)
MULTIPLE_TRAINING = ThesisTables(
    name="Tables 7.4 and 7.5", cases=tuple(range(1, 9)), damages=_cases("multiple"), clean=_rows("7.4"), noisy=_rows("7.5")
)
TABLES = (SINGLE_TRAINING, MULTIPLE_TRAINING)
GROUPS = (  # of the test cases: what, tables, and which of them
    ("Tables 7.1 and 7.2, 13 single", SINGLE_TRAINING, slice(1, 14)),
    ("Tables 7.1 and 7.2, 3 multiple", SINGLE_TRAINING, slice(14, 17)),
    ("Tables 7.4 and 7.5, 8 multiple", MULTIPLE_TRAINING, slice(0, 8)),
)
