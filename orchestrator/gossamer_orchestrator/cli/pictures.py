"""``gossamer plot`` and ``gossamer export-vtk``: pictures of a run, again or for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .common import Results


def export_vtk(
    results: Results,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder to write to; the folder vtk beside the results by default.", metavar="FOLDER"),
    ] = None,
    frames: Annotated[int, typer.Option(help="Instants of a square membrane, at most.", min=1, metavar="N")] = 60,
) -> None:
    """Write the membranes of a run for ParaView.

    For each membrane NAME.pvd, which ParaView opens, and one .vtu for each instant: displaced nodes, displacement, zones, true
    and estimated damage, largest strain, and wrinkle: 0 taut, 1 wrinkled, 2 slack. Membranes on meshes have the instants that
    the run recorded, [record] frames.

    For example:

        gossamer export-vtk out/sail
    """
    from ..results.files import load_results
    from ..results.shapes import load_shapes
    from ..results.vtk import export_vtk as write

    folder = (results if results.is_dir() else results.parent) / "vtk" if out is None else out
    for path in write(load_results(results), load_shapes(results), folder, frames):
        typer.echo(path)
