"""``gossamer assess``: an identified sensor judged on other records, without fitting it."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from .command import Result, show, stderr
from .common import PictureForm, check_form, keep_inputs, model_errors, note_page, save_page
from .identify import CommandWithFields, parameter
from .recognised import print_recognised, print_remarks

if TYPE_CHECKING:
    from gossamer_models.fitting import Record
    from gossamer_models.review import Judged
    from rich.table import Table

    from ..pages import Page
    from .tables import Shown

COMPENSATORS = "inverse (its direct one where it has one), exact, estimator, filter"


@cache
def column_parameters() -> dict[str, inspect.Parameter]:
    """Return the options of columns, as parameters of a function."""
    from gossamer_models.fitting import Columns
    from gossamer_models.identify import options

    return {each.name: parameter(Columns, each, {}, "Columns of the records") for each in options(Columns)}


class CommandWithColumns(CommandWithFields):
    """A command that has, besides its own options, those of columns of records."""

    declared = staticmethod(column_parameters)


def assess(
    ctx: typer.Context,
    sensor: Annotated[Path, typer.Argument(help="Artifact of gossamer identify.")],
    files: Annotated[list[Path], typer.Argument(help="CSV files with a header line, one record each.")],
    compensator: Annotated[
        list[str] | None,
        typer.Option(
            help=f"What recovers strain; may be repeated: {COMPENSATORS}. The one that the artifact names by default.",
            metavar="NAME",
        ),
    ] = None,
    fit_scales: Annotated[
        bool,
        typer.Option(
            "--fit-scales",
            help="Find gain, offset and what was still relaxing of each record in its first stretch, and judge the rest: "
            "for a sensor that was mounted again, is warmer, or has drifted.",
        ),
    ] = False,
    stretch: Annotated[
        str, typer.Option(help="First stretch of each record: 0:200 for seconds, 50% for a leading part.")
    ] = "50%",
    out: Annotated[Path, typer.Option(help="Folder of predictions, pictures and page.", metavar="FOLDER")] = Path(
        "out/assessed"
    ),
    pictures: Annotated[bool, typer.Option(help="Draw pictures, and write report.html, the page of them all.")] = True,
    form: PictureForm = "png",
) -> Result:
    """Judge an identified sensor on other records, without fitting it.

    Says first what it read: columns, units, ranges, sampling, gaps, repairs, and where a record leaves the full scale
    of the sensor: it is judged up to there. Prints errors of resistance and of recovered strain as a table, and the
    paths of predicted and recovered values as CSV, of pictures, and of report.html, the page to look at. Beside the
    sensor stands a static cubic, which is fitted to the first stretch of each record.

    For example:

        gossamer assess sensor.json other.csv

        gossamer assess sensor.json other.csv third.csv --fit-scales --stretch 0:200

        gossamer assess sensor.json other.csv --compensator inverse --compensator estimator --out out/mine
    """
    from ..pages import PAGE

    judged, paths = judge_given(
        sensor,
        files,
        ctx.obj,
        print_recognised,
        compensator=compensator,
        fit_scales=fit_scales,
        stretch=stretch,
        out=out,
        pictures=pictures,
        form=form,
    )
    console = stderr()
    for table in tables(judged, stretch):
        console.print(table)
    remarks = [sentence for each in judged for sentence in each.sentences()]
    print_remarks(console, remarks, [each.record for each in judged])
    for path in paths:
        show(path)
    if out / PAGE in paths:
        note_page(out / PAGE)
    return Result({"files": paths, "errors": [row for each in judged for row in _errors(each)], "remarks": remarks})


def judge_given(
    sensor: Path,
    files: list[Path],
    columns: dict[str, Any],
    show_records: Callable[[Console, Sequence[Record]], None],
    *,
    compensator: list[str] | None,
    fit_scales: bool,
    stretch: str,
    out: Path,
    pictures: bool,
    form: str,
) -> tuple[tuple[Judged, ...], list[Path]]:
    """Judge a sensor on records with the options of the command; return what was found and the files written."""
    from gossamer_models.fitting import Columns
    from gossamer_models.replay import table_path
    from gossamer_models.review import judge_files, save_judged

    from ..pages import PAGE
    from ..run.progress import ProgressBar

    keep_inputs([sensor, *files], [out, *(table_path(out, each.name) for each in files)])
    check_form(form)
    console, begun = stderr(), time.perf_counter()
    with model_errors(), ProgressBar("assess", console) as bar:
        judged = judge_files(
            sensor,
            files,
            columns=Columns(**columns),
            compensators=tuple(compensator or ()),
            own_scales=fit_scales,
            stretch=stretch,
            recognised=lambda records: show_records(console, records),
            progress=lambda text: bar.update(text=text),
        )
        seconds = time.perf_counter() - begun
        paths = save_judged(judged, out, pictures=pictures, form=form)
    if pictures:
        paths += save_page(lambda: _page(judged, sensor, files, stretch, seconds), out / PAGE)
    return judged, paths


def _page(judged: tuple[Judged, ...], sensor: Path, files: list[Path], stretch: str, seconds: float) -> Page:
    """Return the page of an assessment."""
    from gossamer.pages.assess import assessment_page

    return assessment_page(judged, sensor, files, shown_tables(judged, stretch), seconds)


def _errors(judged: Judged) -> list[dict[str, Any]]:
    """Return the errors of one record as JSON; NRMSE over the range of the record [%]."""
    return [
        {
            "record": judged.record.name,
            "stretch": name,
            "samples": int(rows.sum()),
            "resistance_nrmse_percent": judged.forward(rows),
            "resistance_nrmse_of_cubic_percent": judged.forward(rows, judged.cubic),
            "strain_nrmse_percent": {
                kind: judged.strain(rows, found.strain) for kind, found in judged.recovered.items()
            },
            "strain_nrmse_of_cubic_percent": judged.strain(rows, judged.cubic_strain),
            "stated_over_true_deviation": {kind: judged.deviation_ratio(rows, kind) for kind in judged.recovered},
        }
        for name, rows in judged.stretches().items()
    ]


def tables(judged: tuple[Judged, ...], stretch: str) -> list[Table]:
    """Return the errors, and the scales where they were fitted, as tables of the terminal."""
    from .tables import printed

    return [printed(each) for each in shown_tables(judged, stretch)]


def shown_tables(judged: tuple[Judged, ...], stretch: str) -> list[Shown]:
    """Return the errors, and the scales where they were fitted."""
    from .tables import Shown

    fitted = judged[0].scales is not None
    first = (
        "fitted scales and the cubic know" if fitted else "the cubic knows; the sensor knows nothing of these records"
    )
    head = ("record", "stretch", "samples", "resistance", "by a cubic", "recovered by", "strain", "by a cubic")
    errors: list[tuple[str, ...]] = []
    for each in judged:
        for name, rows in each.stretches().items():
            left = (each.record.name, name, str(int(rows.sum())), f"{each.forward(rows):.2f}")
            cubic = f"{each.forward(rows, each.cubic):.2f}"
            for k, (kind, found) in enumerate(each.recovered.items()):
                ratio = each.deviation_ratio(rows, kind)
                right = (kind, f"{each.strain(rows, found.strain):.2f}", f"{each.strain(rows, each.cubic_strain):.2f}")
                errors.append(
                    ((*left, cubic) if k == 0 else ("",) * 5) + (*right, "-" if ratio is None else f"{ratio:.2f}")
                )
    caption = f"Errors: NRMSE in % of range. The first stretch ({stretch}) of a record is what {first}."
    made = [Shown((*head, "stated / true deviation"), errors, caption)]
    if fitted:
        numbers = [
            (each.record.name, (own.gain[0], own.last_gain, own.offset[0], own.last_offset))
            for each in judged
            if (own := each.scales) is not None
        ]
        scales = [(name, *(f"{number:.4g}" for number in four)) for name, four in numbers]
        names = ("record", "gain, first", "relaxed", "offset, first", "relaxed")
        in_ohm = " in ohm" * all(each.record.unit == "ohm" for each in judged)
        made.append(Shown(names, scales, f"Scales of each record{in_ohm}."))
    return made
