"""``gossamer identify``: from measured strain and resistance to a sensor.

The options of columns and of models are fields of classes in ``gossamer_models``: see ``fitting/options.py`` there. They are
looked up when this command runs or explains itself, so that other commands need not import the models.
"""

from __future__ import annotations

import inspect
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer
from rich.console import Console

from ..errors import OrchestratorError
from .command import Command, Result, as_options, note, show, stderr
from .common import PictureForm, check_form, json_file, keep_inputs, model_errors, note_page, save_page
from .recognised import UNITS, print_recognised, print_remarks

if TYPE_CHECKING:
    from gossamer_models.fitting import Record
    from gossamer_models.identify import Identified

    from ..pages import Page


@cache
def field_parameters() -> dict[str, inspect.Parameter]:
    """Return the options of columns and of models, as parameters of a function."""
    from gossamer_models.fitting import Columns
    from gossamer_models.identify import SETTINGS, options

    owners: dict[type, str] = {Columns: "Columns of the records"}
    owners |= {owner: f"Options of the {owner.FAMILY} models" for owner in SETTINGS}
    declared: dict[str, inspect.Parameter] = {}
    for owner, panel in owners.items():
        for field in options(owner):
            having = [each for each in SETTINGS if field.name in {other.name for other in options(each)}]
            defaults = {each.FAMILY: getattr(each, field.name) for each in having}
            declared[field.name] = parameter(owner, field, defaults, panel if len(having) < 2 else None)
    return declared


class CommandWithFields(Command):
    """A command that has the options that ``declared`` gives besides its own; their values are in ``ctx.obj`` by name."""

    declared = staticmethod(field_parameters)

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401
        """Return all options."""
        *own, help_option = super().get_params(ctx)
        return [*own, *_made(self.declared), help_option]

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Call the command."""
        ctx.obj = {name: ctx.params.pop(name) for name in self.declared()}
        return super().invoke(ctx)


@cache
def _made(declared: Callable[[], dict[str, inspect.Parameter]]) -> list[Any]:
    return as_options(declared())


def parameter(owner: type, field: Any, defaults: dict[str, Any], panel: str | None) -> inspect.Parameter:  # noqa: ANN401
    """Return the parameter of a function that typer makes an option of."""
    about, hint = field.metadata, get_type_hints(owner)[field.name]
    kind = next((each for each in get_args(hint) if each is not type(None)), hint)
    text = about["help"]
    if about["models"]:
        text = f"Of {' and '.join(about['models'])}: {text[0].lower()}{text[1:]}"
    if defaults and not isinstance(field.default, bool | str | None) and "if not given" not in text:
        several = len(set(defaults.values())) > 1
        values = [
            f"{value:g} for the {family} models" if several else f"{value:g}" for family, value in defaults.items()
        ]
        text += f" {' and '.join(values if several else values[:1])} if not given."
    how = typer.Option(
        f"--{field.name.replace('_', '-')}",
        help=text,
        metavar=about["metavar"],
        min=about["least"],
        rich_help_panel=panel,
    )
    value: Any = bool if kind is bool else (str if about["read"] else kind) | None
    default = False if kind is bool else None
    return inspect.Parameter(
        field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[value, how]
    )


def identify(
    ctx: typer.Context,
    files: Annotated[list[Path], typer.Argument(help="CSV files with a header line; each is a record of one sensor.")],
    out: Annotated[Path, typer.Option(help="File to write; pictures and page go beside it.", metavar="FILE")] = Path(
        "out/identified/sensor.json"
    ),
    model: Annotated[
        str | None,
        typer.Option(help="One of those above; auto if no option of a model is given, else preisach.", metavar="NAME"),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            help="Of --model auto: seconds after which it tries no more settings; 60 if not given. The few that it must "
            "try, the last fit, the checks and the pictures take half a minute more, or longer for long records.",
            min=1.0,
        ),
    ] = None,
    train: Annotated[
        str,
        typer.Option(
            help="What to fit: 0:200 for seconds from the first sample, 50% for a leading part; the rest is a test."
        ),
    ] = "50%",
    full_scale: Annotated[
        float | None, typer.Option(help="Strain [1] at the end of the range; the largest if not given.")
    ] = None,
    rest_resistance: Annotated[
        float | None, typer.Option(help="Resistance at rest [ohm] where it is known; fitted if not given.")
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(help="Of each record's squared errors: 1,0.5 for two files; 1 if not given.", metavar="LIST"),
    ] = None,
    own_scales: Annotated[
        bool,
        typer.Option(
            "--own-scales", help="Each record has its own offset and gain: re-mounted, another temperature, drift."
        ),
    ] = False,
    origin: Annotated[str, typer.Option(help="Where the data come from, for the provenance.")] = "not stated",
    pictures: Annotated[
        bool, typer.Option(help="Draw pictures of the fit, and write report.html, the page of them all.")
    ] = True,
    form: PictureForm = "png",
) -> Result:
    """Identify a sensor from measured strain and resistance.

    Says first what it read: columns, units, ranges, sampling, gaps, repairs. Prints the paths of the artifact, of predicted
    and recovered values as CSV, of the pictures, and of report.html, the page to look at; errors on training and test
    stretches as a table.

    Models:

    - auto: chooses sensor, relaxation, regularisation, direct inverse and compensator by predicting the later parts of the
    training stretch. Sensor and compensator; gossamer build takes the compensator that was chosen.

    - preisach: modified Preisach with modal densities. Sensor and compensator.

    - preisach-hats: the same with hat functions, which follow rich records more closely. Sensor and compensator.

    - fractional-sub-model-1: fractional integrals, Eq. (3.21) of the thesis. Sensor.

    - fractional-model-1, fractional-sub-model-2: with phases, Eqs. (3.15) and (3.25). Offline only, no FMUs.

    For example:

        gossamer identify measurements.csv --out sensor.json

        gossamer identify measurements.csv --modes 7 --relaxations 7 --train 0:200 --out sensor.json

        gossamer build sensor compensator --artifact sensor.json

        gossamer identify measurements.csv --model fractional-sub-model-1 --terms 3 --out sensor.json
    """
    import shlex

    names = {str(path): path.name for path in (*files, out)} | {f"--out={out}": f"--out={out.name}"}
    result, chosen, paths = identify_given(
        files,
        ctx.obj,
        shlex.join(["gossamer", *(names.get(argument, argument) for argument in sys.argv[1:])]),
        print_recognised,
        out=out,
        model=model,
        budget=budget,
        train=train,
        full_scale=full_scale,
        rest_resistance=rest_resistance,
        weights=weights,
        own_scales=own_scales,
        origin=origin,
        pictures=pictures,
        form=form,
    )
    from gossamer_models.automatic import defeats

    from ..pages import PAGE
    from .identify_report import print_result, result_as_json

    console = stderr()
    print_result(console, result, rest_of(result, rest_resistance))
    warnings = defeats(result.standings, ["strain"])
    print_remarks(console, [text for text in result.remarks if text not in warnings], result.fit.records)
    for path in paths:
        show(path)
    if (command := _command_to_build(result, paths[0])) is not None:
        note(f"To build its FMUs, type '{command}'.")
    for sentence in warnings:  # beside the command to build, which they question
        console.print(f"Warning: {sentence}", style="bold red", markup=False)
    if paths[-1].name == PAGE:
        note_page(paths[-1])
    return Result({"artifact": paths[0], "files": paths[1:], **result_as_json(result, chosen)})


def identify_given(
    files: list[Path],
    fields: dict[str, Any],
    command: str,
    show_records: Callable[[Console, Sequence[Record]], None],
    *,
    out: Path,
    model: str | None,
    budget: float | None,
    weights: str | None,
    rest_resistance: float | None,
    pictures: bool,
    form: str,
    **more: Any,  # noqa: ANN401
) -> tuple[Identified, str, list[Path]]:
    """Identify a sensor with the options of the command; return the result, its model, and the files, the artifact first.

    Parameters
    ----------
    files : list of Path
        Records.
    fields : dict
        Options of columns and of models, by name; those that are None or False are not given.
    command : str
        For the provenance of the artifact.
    show_records : callable
        Shows what was recognised in the records, before anything is fitted.
    out, model, budget, weights, rest_resistance, pictures, form, **more
        The command's own.
    """
    from gossamer_models.automatic import BUDGET
    from gossamer_models.fitting import Columns
    from gossamer_models.fitting.options import numbers
    from gossamer_models.identify import (
        AUTO,
        SETTINGS,
        identify_files,
        options,
        save_pictures,
        save_predictions,
        settings_for,
    )

    from ..pages import PAGE
    from .identify_report import progress_of

    artifact = json_file(out)
    keep_inputs(files, [out, artifact])
    check_form(form)
    console, begun = stderr(), time.perf_counter()
    readers = {each.name: each.metadata["read"] for owner in SETTINGS for each in options(owner)}
    chosen = {
        name: _read(name, value, readers.get(name))
        for name, value in fields.items()
        if value is not None and value is not False
    }
    columns = {each.name: chosen.pop(each.name) for each in options(Columns) if each.name in chosen}
    model = model or ("preisach" if chosen else AUTO)
    if model == AUTO and chosen:
        msg = f"--model auto chooses {', '.join(chosen)} itself. Leave the option out, or name another model."
        raise OrchestratorError(msg)
    if model != AUTO and budget is not None:
        msg = f"--budget is the time for the choice of --model auto, and {model} chooses nothing. Leave one of the two out."
        raise OrchestratorError(msg)
    settings: Any = AUTO
    if model != AUTO:
        with model_errors():
            settings = settings_for(model, **chosen)
    with model_errors(), progress_of(console, bar=model == AUTO) as (say, advance):
        result = identify_files(
            files,
            columns=Columns(**columns),
            weights=None if weights is None else _read("weights", weights, numbers),
            rest_resistance=rest_resistance,
            settings=settings,
            budget=BUDGET if budget is None else budget,
            command=command,
            progress=say,
            advance=advance,
            recognised=lambda records: show_records(console, records),
            **more,
        )
        seconds = time.perf_counter() - begun
        result.fit.artifact.write(artifact)
        drawn = save_predictions(result, artifact.with_suffix(""))
        drawn += save_pictures(result, artifact.with_suffix(""), form) if pictures else []
    if pictures:
        rest = rest_of(result, rest_resistance)
        drawn += save_page(lambda: _page(result, artifact, files, rest, seconds), artifact.with_suffix("") / PAGE)
    return result, model, [artifact, *drawn]


def _command_to_build(result: Identified, out: Path) -> str | None:
    """Return what to type for the FMUs of a sensor; None for a model that works offline only."""
    import shlex

    from gossamer_models.sensor import SensorArtifact

    artifact = result.fit.artifact
    names = ["sensor"]
    if isinstance(artifact, SensorArtifact):
        names.append("compensator")
    elif not artifact.can_step:
        return None
    return shlex.join(["gossamer", "build", *names, "--artifact", str(out), "--out", str(out.parent)])


def _page(result: Identified, out: Path, files: list[Path], rest: str, seconds: float) -> Page:
    """Return the page of an identification."""
    from gossamer.pages.identify import identification_page

    return identification_page(result, out, files, rest, seconds)


def rest_of(result: Identified, given: float | None) -> str:
    """Say from which resistance changes count."""
    unit = UNITS[result.fit.records[0].unit]
    return f"{'fitted' if given is None else 'given'} {result.fit.rest_resistance:.6g}{unit} at rest"


def _read(name: str, value: Any, reader: Any) -> Any:  # noqa: ANN401
    """Return the value of an option, from its text where the option has a reader."""
    try:
        return reader(value) if reader else value
    except ValueError as error:
        msg = f"cannot read --{name.replace('_', '-')} {value!r} {error}"
        raise OrchestratorError(msg) from None
