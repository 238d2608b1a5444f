"""``gossamer build``: from models to FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from ..errors import FmuError
from ..names import suggest
from .common import FMUS, keep_inputs, model_errors, print_kinds


def build(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="FMUs to build: membrane, sensor, compensator, estimator (a compensator that tolerates noise), "
            "filter (one for any sensor), detector. All of them by default."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write them to.", metavar="FOLDER")] = FMUS,
    artifact: Annotated[
        Path | None,
        typer.Option(
            help="Identified sensor (for sensor, compensator, estimator and filter) or trained detector: its file, or "
            "nominal, wide or single_damage, which ship with Gossamer.",
            metavar="FILE",
        ),
    ] = None,
    scales: Annotated[
        str | None,
        typer.Option(
            help="Of the identified sensor, in place of its own: resistance at rest [ohm], its rise to full scale [ohm] and "
            "full scale [1].",
            metavar="R,R,STRAIN",
        ),
    ] = None,
    elements_per_side: Annotated[
        int | None,
        typer.Option(help="Elements along a side of the membrane, a multiple of 4; 4 by default.", metavar="N"),
    ] = None,
    order: Annotated[
        int | None,
        typer.Option(
            help="Order of the membrane's elements: 1 for bilinear ones, 2 to 12 for spectral ones; 4 by default. 6 halves "
            "the error and takes seven times as long.",
            metavar="N",
        ),
    ] = None,
    law: Annotated[
        str | None,
        typer.Option(
            help="Law of the membrane's material: st_venant_kirchhoff, which carries compression, by default; hencky; "
            "neo_hookean; or relaxed, which wrinkles instead.",
            metavar="NAME",
        ),
    ] = None,
    setup: Annotated[
        Path | None,
        typer.Option(
            help="Membrane on a mesh: TOML file with its material, supports, zones, loads and sensors (docs/setup.md), or "
            "sail, drum, reflector, tube, which ship with Gossamer.",
            metavar="FILE",
        ),
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option(
            help="With --setup: mesh file (.msh of gmsh, or any other that meshio reads) in place of the setup's own.",
            metavar="FILE",
        ),
    ] = None,
    expose: Annotated[
        bool, typer.Option("--expose", help="With --setup: make the displacement of every node a variable.")
    ] = False,
    native: Annotated[
        bool, typer.Option("--native", help="Compile C code, so that the FMU runs without Python.")
    ] = False,
    platform: Annotated[
        list[str] | None,
        typer.Option(
            help="With --native: linux64, win64, darwin64, aarch64-linux (FMI 3 only) or all; may be repeated; "
            "this machine's platform by default.",
            metavar="NAME",
        ),
    ] = None,
    fmi: Annotated[
        int, typer.Option(help="With --native: version of the standard, 2 or 3.", min=2, max=3, metavar="N")
    ] = 2,
) -> None:
    """Build the FMUs.

    Prints the path of every FMU. Native FMUs need the compiler that make installs, or pip install ziglang==0.17.0.

    For example:

        gossamer build

        gossamer build --native --platform all

        gossamer build --native --fmi 3 --out out/fmus3

        gossamer build membrane --order 6

        gossamer build membrane --elements-per-side 8 --order 1

        gossamer build membrane --law relaxed

        gossamer build membrane --setup sail --out out/sail

        gossamer build membrane --setup mine.toml --mesh mine.msh --native

        gossamer build estimator --artifact out/mine/sensor.json

        gossamer build filter --native --artifact out/mine/sensor.json

        gossamer build detector --artifact wide --out somewhere
    """
    options = {"native": native, "fmi": fmi, "platforms": tuple(platform or ())}
    choices = {
        "artifact": artifact,
        "scales": _numbers(scales),
        "elements_per_side": elements_per_side,
        "order": order,
        "law": law,
        "structure": _structure(setup, mesh, expose=expose),
    }
    keep_inputs([artifact, setup, mesh], [out / f"{name}.fmu" for name in names or ()])
    paths = build_fmus(out, names, **choices, **options).values()
    for path in paths:
        typer.echo(path)
    print_kinds(f"FMI {fmi}.0", paths)


def _structure(setup: Path | None, mesh: Path | None, *, expose: bool) -> Any:  # noqa: ANN401
    """Read the setup of a membrane and its mesh, if there is one."""
    if setup is None:
        if mesh is not None or expose:
            msg = "--mesh and --expose need a setup of material and supports. Name its file with --setup."
            raise FmuError(msg)
        return None
    from ..scenario.shipped import find_scenario
    from .setup_file import load_structure

    with model_errors():
        return load_structure(find_scenario(str(setup), "membrane"), mesh, expose=expose)


def _numbers(text: str | None) -> tuple[float, ...] | None:
    try:
        return None if text is None else tuple(float(part) for part in text.split(","))
    except ValueError:
        msg = f"cannot read --scales {text!r} as numbers. Write them with commas: 1000,150,0.2."
        raise FmuError(msg) from None


def build_fmus(folder: Path, names: list[str] | None = None, **options: Any) -> dict[str, Path]:  # noqa: ANN401
    """Build FMUs into a folder, all of them if none is named; a build is reproducible, so it may be repeated."""
    from gossamer_fmus import NAMES, build_all

    for name in names or ():
        if name not in NAMES:
            msg = f"there is no FMU {name!r} to build. {suggest(name, NAMES)}"
            raise FmuError(msg)
    console = Console(stderr=True)
    with model_errors(), console.status("building FMUs") as status:

        def progress(text: str) -> None:
            if console.is_terminal:
                status.update(f"compiling {text}; a first time for a platform takes minutes")
            else:
                typer.echo(f"compiling {text}", err=True)

        return build_all(folder, names or NAMES, progress=progress, **options)
