"""``gossamer twin``: from a record to damage with its standard deviation."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from gossamer_files import replacing

from ..results.files import TWIN
from .command import INVALID, Result, show, stderr
from .common import json_file, keep_inputs, model_errors, note_page, save_page, typed
from .twin_options import (
    NUISANCE_UNITS,
    ElementsOption,
    KindOption,
    NoiseOption,
    OrderOption,
    RecordArgument,
    SensorOption,
    ValuesOption,
    beside,
    file_of,
    name_of,
)

if TYPE_CHECKING:
    from gossamer_models.twin import Answer, ResponseRecord
    from rich.table import Table

logger = logging.getLogger(__name__)
NUISANCES = "offset"
UNITS = dict.fromkeys(("damage", "deviation", "probability", "covariance"), "1") | NUISANCE_UNITS


def twin(
    record: RecordArgument,
    fit: Annotated[
        str | None,
        typer.Option(
            help="What is unknown beside damage: offset, gain, amplitude, frequency, phase, damping, modulus, pressure, "
            "with commas between, or none. By default offset for strain and none for resistance.",
            metavar="NAMES",
        ),
    ] = None,
    kind: KindOption = None,
    noise: NoiseOption = None,
    stop: Annotated[float | None, typer.Option(help="Use the record up to this time [s] only; it costs less.")] = None,
    values: ValuesOption = None,
    sensor: SensorOption = None,
    elements_per_side: ElementsOption = 4,
    order: OrderOption = 4,
    sparse: Annotated[bool, typer.Option(help="Drop the zones that the record does not need.")] = True,
    out: Annotated[
        Path | None, typer.Option(help="JSON file to write; twin.json beside the record by default.", metavar="FILE")
    ] = None,
) -> Result:
    """Fit a simulation to a record: the damage of each zone, with its standard deviation.

    The record begins when the load sets in. A CSV file has the columns time, and strain[1] to strain[4] or resistance[1] to
    resistance[4]; empty cells are gaps. Results of a run bring the parameters of the membrane and of the sensors along.

    For example:

        gossamer run damaged && gossamer twin out/damaged/results.nc

        gossamer twin measured.csv --fit offset,amplitude,frequency,damping --set pressure_amplitude=9500
    """
    console = stderr()
    answer, path, pages, compared = fit_twin(
        record,
        fit=fit,
        kind=kind,
        noise=noise,
        stop=stop,
        values=values,
        sensor=sensor,
        elements_per_side=elements_per_side,
        order=order,
        sparse=sparse,
        out=out,
    )
    console.print(zone_table(answer))
    console.print(summary(answer), highlight=False)
    if compared:
        console.print(compared, highlight=False, markup=False)
    for doubt in answer.doubts:
        console.print(f"{doubt[0].upper()}{doubt[1:]}.", style="bold yellow", highlight=False)
    for each in (path, *pages):
        show(each)
    for page in pages:
        note_page(page)
    return Result(
        {"file": path, "page": next(iter(pages), None), **answer.as_json(), "units": UNITS},
        0 if answer.valid else INVALID,
    )


def fit_twin(
    record: Path,
    *,
    fit: str | None,
    kind: str | None,
    noise: float | None,
    stop: float | None,
    values: list[str] | None,
    sensor: Path | None,
    elements_per_side: int,
    order: int,
    sparse: bool,
    out: Path | None,
) -> tuple[Answer, Path, list[Path], str]:
    """Fit a simulation to a record with the options of the command.

    Returns
    -------
    tuple
        The answer, its file, its page if it was written, and a sentence if only the beginning was compared.
    """
    from gossamer.pages.twin import twin_page
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import Twin

    from ..pages import PAGE
    from ..run.progress import ProgressBar
    from .twin_record import find_record, sensor_of

    console = stderr()
    path = beside(record, TWIN) if out is None else json_file(out)
    keep_inputs([file_of(record), sensor], [out, path])
    with model_errors():
        with console.status("reading"):
            found = find_record(record, kind, noise, stop, values or [])
        logger.info("%d samples of %s, %g s apart", found.record.samples, found.record.kind, found.record.step)
        default = () if found.record.kind == "resistance" else (NUISANCES,)
        nuisances = default if fit is None else tuple(name.strip() for name in fit.split(",") if name.strip() != "none")
        with ProgressBar("fitting", console) as bar:
            bar.update(text="compiling,")
            answer = Twin(
                square_structure(elements_per_side, order, params=found.params),
                sensor=sensor_of(found, sensor),
                sensor_parameters=found.sensor_parameters,
                nuisances=nuisances,
                sparse=sparse,
            ).fit(
                found.record,
                report=lambda seconds, made: bar.update(text=f"{seconds:.3g} s of the record, {made} simulations,"),
            )
        logger.info("%d simulations for %d values", answer.simulations, answer.samples)
        with replacing(path) as unfinished:
            unfinished.write_text(json.dumps(answer.as_json(), indent=1) + "\n", encoding="utf-8")
    compared = _compared(record, found.record, answer.record, stop)
    pages = save_page(lambda: twin_page(name_of(record), answer, compared), path.with_suffix("") / PAGE)
    return answer, path, pages, compared


def _compared(path: Path, given: ResponseRecord, used: ResponseRecord, stop: float | None) -> str:
    """Say which part of a record was compared; nothing if it is all of it."""
    if used.samples >= given.samples:
        return ""
    whole = f"{'a record of' if stop is None else 'the first'} {given.step * given.samples:.3g} s"
    return (
        f"Compared: 0 to {used.step * used.samples:.3g} s of {whole}. For damage that begins later use 'gossamer watch "
        f"{typed(path)}'."
    )


def zone_table(answer: Answer) -> Table:
    """Return a table with one row per zone."""
    from gossamer.pages.twin import zone_cells
    from rich.table import Table

    shown = zone_cells(answer)
    table = Table(*shown.head, title=shown.caption)
    for row, damage in zip(shown.rows, answer.damage, strict=True):
        table.add_row(*row, style="bold" if damage > 0.0 else "dim")
    return table


def summary(answer: Answer) -> str:
    """Say whether an answer is valid, and what else was fitted."""
    from gossamer.pages.twin import nuisance_cells

    verdict = "valid" if answer.valid else "NOT valid"
    first = f"{verdict}: chi2 per sample {answer.chi2_per_sample:.3f}, bound {answer.chi2_bound:.3f}"
    others = [f"{name}: {text}" for name, text in nuisance_cells(answer) if not name.startswith("pressure[")]
    return "\n".join([first, *others])
