"""Measured, predicted and recovered values of a record as a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from gossamer_files import replacing

from ..arrays import Rows, Vector
from .records import Record


def table_path(folder: Path, name: str) -> Path:
    """Return where the predictions of a record of a name go."""
    return folder / f"{Path(name).stem}_predicted.csv"


def write_predictions(
    path: Path, record: Record, predicted: Vector, recovered: Mapping[str, Vector], fitted: Rows
) -> Path:
    """Write a record beside what a model makes of it; return the path.

    Parameters
    ----------
    path : Path
        File to write.
    record : Record
        The record.
    predicted : ndarray, shape (m,)
        Resistance [ohm] for its strain.
    recovered : mapping of str to ndarray, shape (m,)
        Further columns [1] by their names: strain from its resistance, and its standard deviation where one is stated. A
        cell is empty where the value is not a number.
    fitted : ndarray of bool, shape (m,)
        Samples that something was fitted to.
    """
    unit = "" if record.unit is None else f" [{record.unit}]"
    names = ("time [s]", "strain [1]", f"resistance{unit}", f"predicted{unit}", *(f"{name} [1]" for name in recovered))
    columns = (record.time, record.strain, record.resistance, predicted, *recovered.values())
    with replacing(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*names, "fitted"])
        for row, used in zip(np.column_stack(columns).tolist(), fitted.tolist(), strict=True):
            writer.writerow([*("" if np.isnan(value) else f"{value:.9g}" for value in row), int(used)])
    return path
