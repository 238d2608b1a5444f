"""``gossamer plot`` and ``gossamer export-vtk``: pictures of a run, again or for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import OrchestratorError
from .command import Result, note, show
from .common import Results

if TYPE_CHECKING:
    import xarray as xr

LARGEST_PICTURE = 200_000  # points


def plot(
    results: Results,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write to; that of the results by default.", metavar="FOLDER")
    ] = None,
    form: Annotated[str, typer.Option("--format", help="png, svg or pdf.", metavar="FORM")] = "png",
) -> Result:
    """Draw the pictures of a run again, from its results.

    For example:

        gossamer plot out/damaged --format svg
    """
    from ..results.files import load_results
    from ..results.plots import save_pictures
    from ..results.plots.save import FORMS

    if form not in FORMS:
        msg = f"there are no pictures of form {form!r}. Choose {', '.join(FORMS[:-1])} or {FORMS[-1]}."
        raise OrchestratorError(msg)
    folder = results if results.is_dir() else results.parent
    paths = save_pictures(every_so_many(load_results(results)), folder if out is None else out, form, folder)
    for path in paths:
        show(path)
    return Result({"files": paths})


def every_so_many(data: xr.Dataset, say: Callable[[str], None] = note) -> xr.Dataset:
    """Return results with few enough points for a picture."""
    stride = -(-data.sizes["time"] // LARGEST_PICTURE)
    if stride > 1:
        say(f"Pictures are drawn of every {stride}th recorded point.")
    return data.isel(time=slice(None, None, stride))


def export_vtk(
    results: Results,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder to write to; the folder vtk beside the results by default.", metavar="FOLDER"),
    ] = None,
) -> Result:
    """Write the membranes of a run for ParaView.

    For each membrane NAME.pvd, which ParaView opens, and one .vtu for each instant: displaced nodes, displacement,
    zones, true and estimated damage, largest strain, and wrinkle: 0 taut, 1 wrinkled, 2 slack. The instants
    are those that the run recorded, [record] frames.

    For example:

        gossamer export-vtk out/damaged
    """
    from ..results.files import load_results
    from ..results.shapes import load_shapes
    from ..results.vtk import export_vtk as write

    folder = (results if results.is_dir() else results.parent) / "vtk" if out is None else out
    paths = write(load_results(results), load_shapes(results), folder)
    for path in paths:
        show(path)
    return Result({"files": paths})
