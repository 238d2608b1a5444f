"""``gossamer identify``: from measured strain and resistance to a sensor.

The options of columns and of models are fields of classes in ``gossamer_models``: see ``fitting/options.py`` there. They are
looked up when this command runs or explains itself, so that other commands need not import the models.
"""

from __future__ import annotations

import inspect
import sys
from functools import cache
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer

from ..errors import OrchestratorError
from .command import Command, Result, as_options, show, stderr
from .common import keep_inputs, model_errors
from .recognised import print_recognised


@cache
def field_options() -> list[Any]:
    """Return the options of columns and of models, as typer makes them."""
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
    return as_options(declared)


class CommandWithFields(Command):
    """A command that has, besides its own options, those that ``fields`` gives; their values are in ``ctx.obj`` by name."""

    fields = staticmethod(field_options)

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401
        """Return all options."""
        *own, help_option = super().get_params(ctx)
        return [*own, *self.fields(), help_option]

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Call the command."""
        ctx.obj = {each.name: ctx.params.pop(each.name) for each in self.fields()}
        return super().invoke(ctx)


def parameter(owner: type, field: Any, defaults: dict[str, Any], panel: str | None) -> inspect.Parameter:  # noqa: ANN401
    """Return the parameter of a function that typer makes an option of."""
    about, hint = field.metadata, get_type_hints(owner)[field.name]
    kind = next((each for each in get_args(hint) if each is not type(None)), hint)
    text = about["help"]
    if about["models"]:
        text = f"Of {' and '.join(about['models'])}: {text[0].lower()}{text[1:]}"
    if defaults and not isinstance(field.default, bool | str | None):
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
    out: Annotated[Path, typer.Option(help="File to write; pictures go beside it.", metavar="FILE")] = Path(
        "out/identified/sensor.json"
    ),
    model: Annotated[
        str | None,
        typer.Option(help="One of those above; auto if no option of a model is given, else preisach.", metavar="NAME"),
    ] = None,
    budget: Annotated[float, typer.Option(help="Seconds for the choice of auto.", min=1.0)] = 60.0,
    train: Annotated[str, typer.Option(help="What to fit: 0:200 for seconds, 50% for a leading part.")] = "50%",
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
    pictures: Annotated[bool, typer.Option(help="Draw pictures of the fit.")] = True,
) -> Result:
    """Identify a sensor from measured strain and resistance.

    Says first what it read: columns, units, ranges, sampling, gaps. Prints the paths of the artifact, of predicted and
    recovered values as CSV, and of the pictures; errors on training and test stretches as a table.

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

    from .identify_report import print_result, progress_of, result_as_json

    keep_inputs(files, [out])
    console = stderr()
    readers = {each.name: each.metadata["read"] for owner in SETTINGS for each in options(owner)}
    chosen = {
        name: _read(name, value, readers.get(name))
        for name, value in ctx.obj.items()
        if value is not None and value is not False
    }
    columns = {each.name: chosen.pop(each.name) for each in options(Columns) if each.name in chosen}
    names = {str(path): path.name for path in (*files, out)} | {f"--out={out}": f"--out={out.name}"}
    command = shlex.join(["gossamer", *(names.get(argument, argument) for argument in sys.argv[1:])])
    model = model or ("preisach" if chosen else AUTO)
    if model == AUTO and chosen:
        msg = f"--model auto chooses {', '.join(chosen)} itself. Leave the option out, or name another model."
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
            train=train,
            settings=settings,
            budget=budget,
            own_scales=own_scales,
            full_scale=full_scale,
            rest_resistance=rest_resistance,
            command=command,
            origin=origin,
            progress=say,
            advance=advance,
            recognised=lambda records: print_recognised(console, records),
        )
        result.fit.artifact.write(out)
        drawn = save_predictions(result, out.with_suffix(""))
        drawn += save_pictures(result, out.with_suffix("")) if pictures else []
    known = "given" if rest_resistance is not None else "fitted"
    print_result(console, result, f"{known} {result.fit.rest_resistance:.6g} ohm at rest")
    for sentence in result.remarks:
        console.print(sentence, style="yellow", markup=False)
    for path in (out, *drawn):
        show(path)
    return Result({"artifact": out, "files": drawn, **result_as_json(result, model)})


def _read(name: str, value: Any, reader: Any) -> Any:  # noqa: ANN401
    """Return the value of an option, from its text where the option has a reader."""
    try:
        return reader(value) if reader else value
    except ValueError as error:
        msg = f"cannot read --{name.replace('_', '-')} {value!r} {error}"
        raise OrchestratorError(msg) from None
