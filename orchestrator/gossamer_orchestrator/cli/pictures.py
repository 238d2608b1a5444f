"""``gossamer plot`` and ``gossamer export-vtk``: pictures of a run, again or for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .command import Result, note, show
from .common import PictureForm, Results, check_form

if TYPE_CHECKING:
    import xarray as xr

LARGEST_PICTURE = 200_000  # points


def plot(
    results: Results,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write to; that of the results by default.", metavar="FOLDER")
    ] = None,
    form: PictureForm = "png",
) -> Result:
    """Draw the pictures of a run again, from its results.

    For example:

        gossamer plot out/damaged --format svg
    """
    paths = plot_given(results, out=out, form=form, say=note)
    for path in paths:
        show(path)
    return Result({"files": paths})


def plot_given(results: Path, *, out: Path | None, form: str, say: Callable[[str], None]) -> list[Path]:
    """Draw the pictures of a run with the options of the command; return their paths."""
    from ..results.files import load_results
    from ..results.report import save_pictures

    check_form(form)
    folder, data = results if results.is_dir() else results.parent, load_results(results)
    drawn = data.isel(time=slice(None, None, stride_of(data, say)))
    return save_pictures(drawn, folder if out is None else out, form, folder)


def stride_of(data: xr.Dataset, say: Callable[[str], None]) -> int:
    """Return of how many recorded points one is drawn, so that a picture has few enough; say so if it is not 1."""
    stride = -(-data.sizes["time"] // LARGEST_PICTURE)
    if stride > 1:
        say(f"Pictures are drawn of one in {stride} recorded points.")
    return stride


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
    paths = vtk_given(results, out=out)
    for path in paths:
        show(path)
    return Result({"files": paths})


def vtk_given(results: Path, *, out: Path | None) -> list[Path]:
    """Write the membranes of a run with the options of the command; return the files."""
    from ..results.files import load_results
    from ..results.shapes import load_shapes
    from ..results.vtk import export_vtk as write

    folder = (results if results.is_dir() else results.parent) / "vtk" if out is None else out
    return write(load_results(results), load_shapes(results), folder)
