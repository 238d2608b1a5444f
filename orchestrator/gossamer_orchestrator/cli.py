"""The command ``gossamer``: build the FMUs, run scenarios, look at FMUs; ``cli_models`` adds the commands on models.

A command parses, calls one function and prints one result: paths and values on stdout; progress, tables and errors on
stderr. Heavy imports stand inside the commands.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperGroup

from .cli_models import identify, model_errors, train
from .errors import FmuError, OrchestratorError, ResultsError
from .names import suggest
from .scenario_files import find_scenario, open_scenario

if TYPE_CHECKING:
    import xarray as xr

FMUS = Path("out/fmus")
DEMO = ("damaged", "damage_begins")


class _Group(TyperGroup):
    """Print expected errors as their message alone."""

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        try:
            return super().invoke(ctx)
        except OrchestratorError as error:
            for text in (str(error), *getattr(error, "__notes__", ())):
                typer.echo(text, err=True)
            raise typer.Exit(1) from None


app = typer.Typer(
    cls=_Group,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""Structural health monitoring of gossamer membranes with Functional Mock-up Units.

Start with **gossamer demo**, then look at **out/**.
""",
    epilog="Each command explains itself: gossamer run --help",
)

FmuFolder = Annotated[Path, typer.Option("--fmus", help="Folder of the FMUs that scenarios name.", metavar="FOLDER")]


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(version("gossamer"))
        raise typer.Exit


@app.callback()
def _configure(
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Show what is logged, not only warnings.")] = False,
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING,
        format="%(levelname)s %(name)s: %(message)s",
        stream=sys.stderr,
    )


@app.command()
def build(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="FMUs to build: sensor, compensator, membrane, detector. All if none is named."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write them to.", metavar="FOLDER")] = FMUS,
    artifact: Annotated[
        Path | None,
        typer.Option(help="Identified sensor (sensor, compensator) or trained detector to build from.", metavar="FILE"),
    ] = None,
    elements_per_side: Annotated[
        int | None, typer.Option(help="Mesh of the membrane, a multiple of 4; 8 if not given.", metavar="N")
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="Of the compensator: inverse, exact for resistance without noise, or estimator, which survives noise, "
            "delays the strain and says how well it is known.",
            metavar="NAME",
        ),
    ] = None,
    native: Annotated[
        bool, typer.Option("--native", help="Compile C, which runs without Python, instead of packing Python code.")
    ] = False,
    platform: Annotated[
        list[str] | None,
        typer.Option(
            help="With --native: linux64, win64, darwin64, aarch64-linux (FMI 3 only) or all; may be repeated. "
            "This machine's if not given.",
            metavar="NAME",
        ),
    ] = None,
    fmi: Annotated[
        int, typer.Option(help="With --native: version of the standard, 2 or 3.", min=2, max=3, metavar="N")
    ] = 2,
) -> None:
    """Build the FMUs.

    Prints the path of every FMU. Native FMUs need the compiler that make installs, or pip install -e '.[native]'.

    For example:

        gossamer build

        gossamer build --native --platform all

        gossamer build --native --fmi 3 --out out/fmus3

        gossamer build membrane --elements-per-side 16

        gossamer build compensator --method estimator

        gossamer build detector --artifact out/detector/single_damage.json --out somewhere
    """
    options = {"native": native, "fmi": fmi, "platforms": tuple(platform or ())}
    choices = {"artifact": artifact, "elements_per_side": elements_per_side, "method": method}
    paths = _build(out, names, **choices, **options).values()
    for path in paths:
        typer.echo(path)
    _say_kinds(f"FMI {fmi}.0", paths)


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results; out/NAME if not given.", metavar="FOLDER")
    ] = None,
    fmus: FmuFolder = FMUS,
    step: Annotated[float | None, typer.Option(help="Communication step [s] in place of the file's.")] = None,
    stop: Annotated[float | None, typer.Option(help="Last time [s] in place of the file's.")] = None,
    pictures: Annotated[bool, typer.Option(help="Draw pictures of what was recorded.")] = True,
) -> None:
    """Run a scenario.

    Writes results.nc, results.csv and pictures, and prints their paths. An interrupted or failed run keeps what it
    produced.

    For example:

        gossamer build && gossamer run damaged

        gossamer run my_scenario.toml --out out/mine --no-pictures

        gossamer run other.ssp --step 1e-3 --stop 2
    """
    path = find_scenario(scenario)
    _run(path, fmus, Path("out") / path.stem if out is None else out, pictures=pictures, step=step, stop=stop)


@app.command("export-ssp")
def export_ssp_(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of one that is shipped.")],
    out: Annotated[Path | None, typer.Option(help="File to write; out/NAME.ssp if not given.", metavar="FILE")] = None,
    fmus: FmuFolder = FMUS,
) -> None:
    """Write a scenario and its FMUs as one .ssp for other tools.

    System Structure and Parameterization is the standard in which co-simulation tools exchange connected FMUs. Prints the
    path. What SSP cannot say (events, noise, dropout) is refused.

    For example:

        gossamer build --native && gossamer export-ssp damaged

        gossamer export-ssp my_scenario.toml --out mine.ssp
    """
    from .ssp import export_ssp

    path = find_scenario(scenario)
    with open_scenario(path) as opened:
        typer.echo(export_ssp(opened, fmus, _target(out, path, ".ssp")))
        _say_kinds("packed", (opened.fmu_path(component, fmus) for component in opened.components))


@app.command()
def container(
    scenario: Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")],
    out: Annotated[Path | None, typer.Option(help="File to write; out/NAME.fmu if not given.", metavar="FILE")] = None,
    fmus: FmuFolder = FMUS,
    fmi: Annotated[int, typer.Option(help="Version of FMI outside, 2 or 3.", min=2, max=3)] = 2,
) -> None:
    """Merge a scenario and its FMUs into one FMU.

    Inputs are what the scenario gives from outside, outputs what nobody receives and what is recorded, all named
    component.variable. Prints the path. Events, gain, bias, noise and dropout are refused.

    For example:

        gossamer build --native && gossamer container damaged

        gossamer container damaged --fmi 3 --out monitoring.fmu
    """
    from .container import build_container

    path = find_scenario(scenario)
    with open_scenario(path) as opened:
        typer.echo(build_container(opened, fmus, _target(out, path, ".fmu"), fmi=fmi))
        _say_kinds("packed", (opened.fmu_path(component, fmus) for component in opened.components))


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, results and pictures.", metavar="FOLDER")] = Path("out"),
) -> None:
    """Build the FMUs and run both demonstrations.

    A membrane with 40 % damage in zone 1, and one that is damaged half way through the run: four sensors, four
    compensators and a detector find out. Leaves results and pictures in out/damaged and out/damage_begins.

    For example:

        gossamer demo
    """
    _build(out / "fmus")
    for name in DEMO:
        _run(find_scenario(name), out / "fmus", out / name, pictures=True)


@app.command()
def verify(
    fmus: Annotated[list[Path], typer.Argument(help="FMU files, anybody's.")],
    limit: Annotated[float, typer.Option(help="Time that one check may take [s].")] = 30.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of tables.")] = False,
) -> None:
    """Verify FMUs: archive, model description, binary, and how they behave when they run.

    FMI 2.0 and 3.0 for co-simulation. An FMU runs in a process of its own, so that it may crash or hang. Prints a table per
    FMU; exits 1 if a check failed.

    For example:

        gossamer verify out/fmus/*.fmu
    """
    import json
    from dataclasses import asdict

    from rich.markup import escape
    from rich.table import Table

    from .verify import FAILED, verify

    console = Console(width=None if sys.stdout.isatty() else 160)
    colours = {"passed": "green", "failed": "bold red", "remark": "yellow"}
    reports = {}
    for path in fmus:
        with Console(stderr=True).status(f"verifying {escape(str(path))}"):
            reports[str(path)] = findings = verify(path, limit=limit)
        table = Table("check", "verdict", "why", title=escape(str(path)), expand=False)
        for finding in findings:
            style = colours.get(finding.verdict)
            table.add_row(
                finding.check, f"[{style}]{finding.verdict}" if style else finding.verdict, escape(finding.why)
            )
        if not as_json:
            console.print(table)
    if as_json:
        typer.echo(json.dumps({path: [asdict(f) for f in findings] for path, findings in reports.items()}, indent=1))
    if any(finding.verdict == FAILED for findings in reports.values() for finding in findings):
        raise typer.Exit(1)


@app.command()
def info(
    fmu: Annotated[Path, typer.Argument(help="An FMU file.")],
    locals_: Annotated[bool, typer.Option("--locals", help="List local variables too.")] = False,
) -> None:
    """Show an FMU's parameters, inputs and outputs.

    For example:

        gossamer info out/fmus/sensor.fmu
    """
    from rich.markup import escape
    from rich.table import Table

    from .fmu import FmuFile

    file = FmuFile(fmu)
    table = Table(title=f"{file.name}: {file.description.description or file.description.modelName}", expand=False)
    for heading in ("variable", "causality", "unit", "start", "min", "max", "description"):
        table.add_column(heading, overflow="fold", no_wrap=heading in ("variable", "causality"))
    for causality in ("parameter", "input", "output", *(("local",) if locals_ else ())):
        for name in file.names(causality):
            v = file.variables[name]
            cells = (name, causality, file.unit(name), v.start, v.min, v.max, v.description)
            table.add_row(*(escape(str(cell)) if cell is not None else "" for cell in cells))
        table.add_section()
    Console(width=None if sys.stdout.isatty() else 160).print(table)


app.command()(train)
app.command()(identify)


def _say_kinds(what: str, paths: Iterable[Path]) -> None:
    """Print on stderr, as one line, what FMUs run in and on which platforms."""
    from .archive import describe_fmu

    kinds: dict[str, list[str]] = {}
    for path in dict.fromkeys(paths):
        kinds.setdefault(describe_fmu(path), []).append(path.stem)
    typer.echo(f"{what}: " + "; ".join(f"{', '.join(names)} ({kind})" for kind, names in kinds.items()), err=True)


def _target(out: Path | None, scenario: Path, ending: str) -> Path:
    """Return the file to write, which must not be the scenario itself."""
    target = Path("out") / f"{scenario.stem}{ending}" if out is None else out
    if target.resolve() == scenario.resolve():
        msg = f"{target} is the scenario itself. Name another file with --out."
        raise OrchestratorError(msg)
    return target


def _build(folder: Path, names: list[str] | None = None, **options: Any) -> dict[str, Path]:  # noqa: ANN401
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


def _run(
    scenario: Path, fmus: Path, out: Path, *, pictures: bool, step: float | None = None, stop: float | None = None
) -> None:
    """Run one scenario, write everything, and show what the detector found."""
    from .progress import ProgressBar
    from .results import CSV, NETCDF
    from .run import run_scenario

    try:
        data = run_scenario(scenario, fmus, out, step=step, stop=stop, observers=[ProgressBar(scenario.stem)])
    except KeyboardInterrupt:
        typer.echo(f"Interrupted; results until then are in {out}.", err=True)
        raise typer.Exit(130) from None
    typer.echo(out / NETCDF)
    typer.echo(out / CSV)
    if pictures:
        from .plots import save_pictures

        for path in save_pictures(data, out):
            typer.echo(path)
    _show(data)


def _show(data: xr.Dataset) -> None:
    """Print what the detector found as tables on stderr, if there is a detector."""
    from .report import doubts, history_table, windows, zone_table

    console = Console(stderr=True)
    try:
        ended = windows(data)
    except ResultsError:
        return
    if len(ended) > 1:
        console.print(history_table(ended))
    for judgement in [window for window in ended if window.valid][-1:]:
        console.print(zone_table(judgement))
    for sentence in doubts(data, ended):
        console.print(sentence, style="bold yellow", highlight=False)
