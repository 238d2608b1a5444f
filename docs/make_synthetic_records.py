"""Write the SYNTHETIC datasets as CSV files: ``python docs/make_synthetic_records.py --out FOLDER``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path


def main(words: Sequence[str] | None = None) -> None:
    """Write SYNTHETIC Dataset-1, -2 and -3: strain and resistance of a specimen that exists as equations only."""
    from studies.specimen.datasets import NAMES, dataset
    from studies.specimen.files import write_datasets

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder to write them to")
    try:
        paths = write_datasets(parser.parse_args(words).out)
    except OSError as error:
        sys.exit(f"cannot write there: {error}. Name another folder with --out.")
    for number, path in zip(NAMES, paths, strict=True):
        print(dataset(number).description, file=sys.stderr)
        print(path)


if __name__ == "__main__":
    main()
