"""SYNTHETIC datasets as CSV files, in the columns that ``gossamer identify`` recognises."""

from __future__ import annotations

import csv
from pathlib import Path

from .datasets import NAMES, Dataset, dataset

TRUTH = "SYNTHETIC resistance without noise [ohm]"
COLUMNS = ("time [s]", "strain [1]", "resistance [ohm]", TRUTH)


def write_datasets(folder: Path) -> tuple[Path, ...]:
    """Write Dataset-1, -2 and -3.

    Parameters
    ----------
    folder : Path
        Folder to write to; created if needed.

    Returns
    -------
    tuple of Path
        ``synthetic_dataset_1.csv`` and so on.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return tuple(write_dataset(dataset(number), folder / f"synthetic_dataset_{number}.csv") for number in NAMES)


def write_dataset(record: Dataset, path: Path) -> Path:
    """Write a record with every digit, so that reading restores every bit; the last column is for evaluation."""
    rows = zip(
        record.time.tolist(), record.strain.tolist(), record.resistance.tolist(), record.noise_free.tolist(), strict=True
    )
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        table.writerows(rows)
    return path
