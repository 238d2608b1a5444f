"""``gossamer identify``: from measured strain and resistance to a sensor."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from ..errors import OrchestratorError
from .common import model_errors

PREISACH, FRACTIONAL = "Options of the Preisach models", "Options of the fractional models"


def identify(
    files: Annotated[list[Path], typer.Argument(help="CSV files with a header line; each is a record of one sensor.")],
    out: Annotated[Path, typer.Option(help="File to write; pictures go beside it.", metavar="FILE")] = Path(
        "out/identified/sensor.json"
    ),
    model: Annotated[str, typer.Option(help="One of those above.", metavar="NAME")] = "preisach",
    train: Annotated[str, typer.Option(help="What to fit: 0:200 for seconds, 50% for a leading part.")] = "50%",
    full_scale: Annotated[
        float | None, typer.Option(help="Strain [1] at the end of the range; the largest if not given.")
    ] = None,
    rest_resistance: Annotated[
        float | None, typer.Option(help="Resistance at rest [ohm] where it is known; fitted if not given.")
    ] = None,
    time: Annotated[str | None, typer.Option(help="Column of time; recognised if not given.", metavar="NAME")] = None,
    strain: Annotated[str | None, typer.Option(help="Column of strain.", metavar="NAME")] = None,
    resistance: Annotated[str | None, typer.Option(help="Column of resistance.", metavar="NAME")] = None,
    time_unit: Annotated[str | None, typer.Option(help="s, ms, us, min or h.")] = None,
    strain_unit: Annotated[str | None, typer.Option(help="1, %, permille or ustrain.")] = None,
    resistance_unit: Annotated[str | None, typer.Option(help="ohm, kohm or megohm.")] = None,
    sampling_step: Annotated[
        float | None, typer.Option(help="Time between samples [s] of a record without time.")
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(help="Of each record's squared errors: 1,0.5 for two files; 1 if not given.", metavar="LIST"),
    ] = None,
    sort: Annotated[bool, typer.Option("--sort", help="Sort samples by time instead of refusing them.")] = False,
    starts: Annotated[
        int | None,
        typer.Option(help="How many starts; 2 for the Preisach, 12 for the fractional models if not given.", min=1),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the starts.", min=0)] = 0,
    origin: Annotated[str, typer.Option(help="Where the data come from, for the provenance.")] = "not stated",
    pictures: Annotated[bool, typer.Option(help="Draw pictures of the fit.")] = True,
    modes: Annotated[
        int | None,
        typer.Option(
            help="Of preisach: modal functions of mu and of eta; 7 if not given.", min=1, rich_help_panel=PREISACH
        ),
    ] = None,
    knots: Annotated[
        int | None,
        typer.Option(
            help="Of preisach-hats: knots of the hat functions along each axis; 9 if not given.",
            rich_help_panel=PREISACH,
        ),
    ] = None,
    relaxations: Annotated[
        int | None, typer.Option(help="Relaxation kernels; 7 if not given.", min=0, rich_help_panel=PREISACH)
    ] = None,
    tau: Annotated[
        str | None,
        typer.Option(
            help="Times of the kernels [s], one per relaxation: 3,100. Fitted if not given.",
            metavar="LIST",
            rich_help_panel=PREISACH,
        ),
    ] = None,
    exponents: Annotated[
        str | None,
        typer.Option(
            help="Exponents of the kernels in (0, 1]: 0.5,0.5. Fitted if not given.",
            metavar="LIST",
            rich_help_panel=PREISACH,
        ),
    ] = None,
    extension: Annotated[
        str | None,
        typer.Option(
            help="Added to the thesis' relaxation: falling (falling strain drives it too), gain (loading changes the gauge "
            "factor) or reversing (both, with either sign: carbon black). Nothing if not given.",
            metavar="NAME",
            rich_help_panel=PREISACH,
        ),
    ] = None,
    ridge: Annotated[
        str | None,
        typer.Option(
            help="How small densities and relaxation are preferred to be: a number, or auto to choose it by predicting the "
            "later parts of the training stretch.",
            metavar="NUMBER",
            rich_help_panel=PREISACH,
        ),
    ] = None,
    earlier: Annotated[
        bool,
        typer.Option(
            "--earlier",
            help="The sensor had not come to rest when its record began; fit what was still relaxing.",
            rich_help_panel=PREISACH,
        ),
    ] = False,
    direct_inverse: Annotated[
        bool,
        typer.Option(
            "--direct-inverse",
            help="Fit the way from resistance to strain too, for the compensator.",
            rich_help_panel=PREISACH,
        ),
    ] = False,
    least_slope: Annotated[
        float | None,
        typer.Option(
            help="Least slope, in output's range per full scale: bounds what the compensator makes of noise; 0.02 if not "
            "given.",
            rich_help_panel=PREISACH,
        ),
    ] = None,
    terms: Annotated[
        int | None,
        typer.Option(help="Fractional derivatives or integrals; 5 if not given.", min=1, rich_help_panel=FRACTIONAL),
    ] = None,
    fading: Annotated[
        int | None,
        typer.Option(
            help="Of fractional-model-1: fading integrals; 3 if not given.", min=0, rich_help_panel=FRACTIONAL
        ),
    ] = None,
) -> None:
    """Identify a sensor from measured strain and resistance.

    Prints the paths of the artifact and of the pictures; errors on training and test stretches as a table.

    Models:

    - preisach: modified Preisach with modal densities. Sensor and compensator.

    - preisach-hats: the same with hat functions, which follow rich records more closely. Sensor and compensator.

    - fractional-sub-model-1: fractional integrals, Eq. (3.21) of the thesis. Sensor.

    - fractional-model-1, fractional-sub-model-2: with phases, Eqs. (3.15) and (3.25). Offline only, no FMUs.

    For example:

        gossamer identify measurements.csv --modes 7 --relaxations 7 --train 0:200 --out sensor.json

        gossamer build sensor compensator --artifact sensor.json

        gossamer identify measurements.csv --model fractional-sub-model-1 --terms 3 --out sensor.json
    """
    import shlex

    from gossamer_models.identification import Columns, choose, identify_files, save_pictures
    from rich.table import Table

    console = Console(stderr=True, width=None if sys.stderr.isatty() else 160)
    columns = Columns(
        time=time,
        strain=strain,
        output=resistance,
        time_unit=time_unit,
        strain_unit=strain_unit,
        output_unit=resistance_unit,
        sampling_step=sampling_step,
        sort=sort,
    )
    names = {str(path): path.name for path in (*files, out)} | {f"--out={out}": f"--out={out.name}"}
    command = shlex.join(["gossamer", *(names.get(argument, argument) for argument in sys.argv[1:])])
    with model_errors(), console.status("reading the records") as status:
        found = identify_files(
            files,
            columns=columns,
            weights=_numbers("--weights", weights),
            train=train,
            settings=choose(
                model,
                starts=starts,
                seed=seed,
                modes=modes,
                knots=knots,
                relaxations=relaxations,
                tau=_numbers("--tau", tau),
                exponents=_numbers("--exponents", exponents),
                extension=extension,
                direct_inverse=direct_inverse or None,
                ridge="auto" if ridge == "auto" else _number("--ridge", ridge),
                earlier=earlier or None,
                least_slope=least_slope,
                terms=terms,
                fading=fading,
            ),
            full_scale=full_scale,
            rest_output=rest_resistance,
            command=command,
            origin=origin,
            progress=status.update,
        )
        out.parent.mkdir(parents=True, exist_ok=True)
        found.fit.artifact.write(out)
        drawn = save_pictures(found, out.with_suffix("")) if pictures else []
    known = "given" if rest_resistance is not None else "fitted"
    caption = f"E1: sum of errors over sum of changes from the {known} {found.rest:.6g} ohm at rest"
    headings = ("record", "stretch", "samples", "E1 [% of change]", "NRMSE [% of range]", "recovered strain, NRMSE")
    table = Table(*headings, caption=caption)
    for e in found.errors:
        recovered = "-" if e.strain_nrmse is None else f"{e.strain_nrmse:.3f}"
        table.add_row(e.record, e.stretch, str(e.samples), f"{e.e1:.3f}", f"{e.nrmse:.3f}", recovered)
    console.print(table)
    for sentence in found.remarks:
        console.print(sentence, style="yellow")
    for path in (out, *drawn):
        typer.echo(path)


def _number(option: str, text: str | None) -> float | None:
    """Read one number; None stays None."""
    numbers = _numbers(option, text)
    if numbers is not None and len(numbers) != 1:
        msg = f"{option} takes one number, not {text!r}."
        raise OrchestratorError(msg)
    return None if numbers is None else numbers[0]


def _numbers(option: str, text: str | None) -> tuple[float, ...] | None:
    """Read a list of numbers; None stays None."""
    try:
        return None if text is None else tuple(float(part) for part in text.split(","))
    except ValueError:
        msg = f"cannot read {option} {text!r} as numbers. Write them with commas: 3,100."
        raise OrchestratorError(msg) from None
