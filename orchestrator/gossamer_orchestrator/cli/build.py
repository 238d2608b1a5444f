"""``gossamer build``: from models to FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import FmuError
from ..names import suggest
from .command import Result, note, show, stderr
from .common import FMUS, keep_inputs, kinds_of, model_errors


def build(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="FMUs to build: membrane, sensor, compensator, estimator (a compensator that tolerates noise), "
            "filter (one for any sensor), detector: these six by default; framed_membrane (one that a spacecraft carries "
            "and feels), hub (a rigid spacecraft)."
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
    frame: Annotated[
        bool,
        typer.Option(
            "--frame", help="Put the membrane on a frame that flies: build framed_membrane in place of membrane."
        ),
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
) -> Result:
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

        gossamer build membrane --frame --native

        gossamer build estimator --artifact out/mine/sensor.json

        gossamer build filter --native --artifact out/mine/sensor.json

        gossamer build detector --artifact wide --out somewhere
    """
    paths = build_given(
        names,
        out=out,
        artifact=artifact,
        scales=scales,
        platform=platform,
        elements_per_side=elements_per_side,
        order=order,
        law=law,
        setup=setup,
        mesh=mesh,
        expose=expose,
        frame=frame,
        native=native,
        fmi=fmi,
    )
    for path in paths.values():
        show(path)
    note(f"FMI {fmi}.0: {kinds_of(paths.values())}")
    return Result({"fmi": fmi, "native": native, "fmus": paths})


def build_given(
    names: list[str] | None,
    *,
    out: Path,
    artifact: Path | None,
    scales: str | None,
    platform: list[str] | None,
    setup: Path | None,
    mesh: Path | None,
    expose: bool,
    frame: bool,
    **options: Any,  # noqa: ANN401
) -> dict[str, Path]:
    """Build FMUs with the options of the command; return their paths by name."""
    names = _framed(names) if frame else names
    keep_inputs([artifact, setup, mesh], [out / f"{name}.fmu" for name in names or ()])
    given = {"artifact": artifact, "scales": _numbers(scales), "platforms": tuple(platform or ())}
    given["structure"] = _structure(setup, mesh, expose=expose)
    return build_fmus(out, names, **given, **options)


def _structure(setup: Path | None, mesh: Path | None, *, expose: bool) -> Any:  # noqa: ANN401
    """Read the setup of a membrane and its mesh, if there is one."""
    if setup is None:
        if mesh is not None or expose:
            msg = "--mesh and --expose need a setup of material and supports. Name its file with --setup."
            raise FmuError(msg)
        return None
    from ..scenario.source import find_scenario
    from .setup_file import load_structure

    with model_errors():
        return load_structure(find_scenario(str(setup), "membrane"), mesh, expose=expose)


def _framed(names: list[str] | None) -> list[str]:
    """Put the membrane on a frame."""
    if not names or "membrane" not in names:
        msg = "--frame puts the membrane on a frame: name it, as in 'gossamer build membrane --frame'."
        raise FmuError(msg)
    return ["framed_membrane" if name == "membrane" else name for name in names]


def _numbers(text: str | None) -> tuple[float, ...] | None:
    try:
        return None if text is None else tuple(float(part) for part in text.split(","))
    except ValueError:
        msg = f"cannot read --scales {text!r} as numbers. Write them with commas: 1000,150,0.2."
        raise FmuError(msg) from None


def build_fmus(folder: Path, names: list[str] | None = None, **options: Any) -> dict[str, Path]:  # noqa: ANN401
    """Build FMUs into a folder, those of the chain if none is named, and say what is replaced by something else.

    A build is reproducible, so it may be repeated.
    """
    from gossamer_fmus import CHAIN, NAMES, build_all

    for name in names or ():
        if name not in NAMES:
            msg = f"there is no FMU {name!r} to build. {suggest(name, NAMES)}"
            raise FmuError(msg)
    before = {name: _description(folder / f"{name}.fmu") for name in names or CHAIN}
    console = stderr()
    with model_errors(), console.status("building FMUs") as status:

        def progress(text: str) -> None:
            if console.is_terminal:
                status.update(f"compiling {text}; a first time for a platform takes minutes")
            else:
                note(f"compiling {text}")

        paths = build_all(folder, names or CHAIN, progress=progress, **options)
    for name, path in paths.items():
        if before[name] and before[name] != (now := _description(path)):
            note(
                f"{path} is now '{now}' in place of '{before[name]}', which other scenarios may need. --out keeps both."
            )
    return paths


def _description(path: Path) -> str:
    """Return what an FMU says that it is; nothing if there is none that can be read."""
    if not path.is_file():
        return ""
    from ..fmi.file import FmuFile

    try:
        return FmuFile(path, validate=False).description.description or ""
    except FmuError:
        return ""
