"""Write the SYNTHETIC datasets as CSV files: ``python docs/make_synthetic_records.py --out FOLDER``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(add_completion=False)


@app.command()
def _write(out: Annotated[Path, typer.Option(help="Folder to write them to.", metavar="FOLDER")]) -> None:
    """Write SYNTHETIC Dataset-1, -2 and -3: strain and resistance of a specimen that exists as equations only."""
    from studies.specimen.datasets import NAMES, dataset
    from studies.specimen.files import write_datasets

    try:
        paths = write_datasets(out)
    except OSError as error:
        typer.echo(f"cannot write there: {error}. Name another folder with --out.", err=True)
        raise typer.Exit(1) from None
    for number, path in zip(NAMES, paths, strict=True):
        typer.echo(dataset(number).description, err=True)
        typer.echo(path)


if __name__ == "__main__":
    app()
