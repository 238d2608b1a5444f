"""Sensors that are learnt from measured records, and judged on others."""

from __future__ import annotations

import logging
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError

from .arguments import (
    GROUPS,
    Budget,
    Count,
    CountOrNone,
    File,
    Files,
    Folder,
    Form,
    Name,
    Names,
    NumberOrAuto,
    Numbers,
    call_of,
    command,
    count_or_auto,
    number_or_auto,
    numbers,
    several,
    with_commas,
)
from .results import Result, TableText, first_of, hints_of, page_of, print_tables
from .sensor_tables import UNITS, assessment_tables, error_table, recognised_table, standing_table, trial_table
from .terminal import TERMINAL, stderr, talk
from .writing import check_form, json_file, keep_inputs, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.fitting import Record
    from gossamer_models.identify import Identified
    from gossamer_models.review import Judged
    from gossamer_orchestrator.run.progress import ProgressBar

SHOWN = 6  # trials of each stage, the best ones

logger = logging.getLogger(__name__)


class RecordColumns(TypedDict, total=False):
    """Columns of the records.

    Attributes
    ----------
    time
        Column of time; recognised if not given.
    strain
        Column of strain.
    resistance
        Column of resistance.
    time_unit
        s, ms, us, min or h.
    strain_unit
        1, %, permille or ustrain.
    resistance_unit
        ohm, kohm or Mohm; 1 for a signal.
    sampling_step
        Time between samples [s] of a record without time.
    sort
        Sort samples by time instead of refusing them.
    """

    time: Name | None
    strain: Name | None
    resistance: Name | None
    time_unit: str | None
    strain_unit: str | None
    resistance_unit: str | None
    sampling_step: float | None
    sort: bool


class PreisachOptions(TypedDict, total=False):
    """Options of the Preisach models.

    Attributes
    ----------
    modes
        Of preisach: modal functions of mu and of eta. 7 if not given.
    knots
        Of preisach-hats: knots of the hat functions along each axis. 9 if not given.
    relaxations
        Relaxation kernels. 7 if not given.
    tau
        Times of the kernels [s], one per relaxation: 3,100. Fitted if not given.
    exponents
        Exponents of the kernels in (0, 1]: 0.5,0.5. Fitted if not given.
    extension
        Added to the thesis' relaxation: falling (falling strain excites relaxation too), gain (loading changes the gauge
        factor), reversing (both, with either sign: carbon black). Nothing if not given.
    ridge
        Strength of the regularisation, which prefers small densities and relaxation: a number, or auto to choose it by
        predicting the later parts of the training stretch.
    earlier
        The sensor was not at rest when its record began: fit the earlier relaxation too.
    direct_inverse
        Fit a direct inverse from resistance to strain too, for the compensator.
    residual
        Correct the sensor by a small network: training steps, or auto to choose them, or none, by predicting the later parts
        of the training stretch. None if not given.
    least_slope
        Least slope, in the output's range per full scale: limits how much the compensator amplifies noise. 0.02 if not
        given.
    """

    modes: Count | None
    knots: int | None
    relaxations: CountOrNone | None
    tau: Numbers | None
    exponents: Numbers | None
    extension: Name | None
    ridge: NumberOrAuto | None
    earlier: bool
    direct_inverse: bool
    residual: NumberOrAuto | None
    least_slope: float | None


class FractionalOptions(TypedDict, total=False):
    """Options of the fractional models.

    Attributes
    ----------
    terms
        Fractional derivatives or integrals. 5 if not given.
    fading
        Of fractional-model-1: fading integrals. 3 if not given.
    """

    terms: Count | None
    fading: CountOrNone | None


class CommonOptions(TypedDict, total=False):
    """Options of all models.

    Attributes
    ----------
    starts
        Number of starts. 2 for the Preisach models and 12 for the fractional models if not given.
    seed
        Seed of the starts. 0 if not given.
    """

    starts: Count | None
    seed: CountOrNone | None


class FitOptions(RecordColumns, CommonOptions, PreisachOptions, FractionalOptions):
    """Columns of the records, and options of the models."""


GROUPS[FitOptions] = (CommonOptions, RecordColumns, PreisachOptions, FractionalOptions)


@dataclass(frozen=True, kw_only=True, repr=False)
class Identification(Result):
    """A sensor that was identified.

    Attributes
    ----------
    path : Path
        Its artifact.
    result : gossamer_models.identify.Identified
        Fit, errors and remarks.
    model : str
        Which model was asked for: auto or its name.
    rest : str
        The resistance from which changes count, in words.
    files : list of Path
        The artifact, predictions, pictures and page.
    """

    path: Path
    result: Identified
    model: str
    rest: str
    files: list[Path]

    @property
    def records(self) -> dict[str, xr.Dataset]:
        """By the name of the record: strain [1], resistance and predicted resistance (in ohm, unless the file states a
        signal or no unit) over ``time`` [s], and ``fitted``; where the model has a compensator the recovered strain [1],
        and its stated ``deviation`` [1] if any.
        """  # noqa: D205
        records = {}
        for k, rows in enumerate(self.result.fit.train):
            record, predicted = self.result.in_its_file(k)
            known: dict[str, Any] = {"fitted": rows}
            for name, found in self.result.recovered_of(k).items():
                known |= {name: found.strain} | ({} if found.deviation is None else {"deviation": found.deviation})
            columns = {name: ("time", values, {"units": "1"}) for name, values in known.items()}
            records[record.name] = _histories(record, predicted).assign(columns)
        return records

    @property
    def page(self) -> Path | None:
        """Page of the identification; None where none was written."""
        return page_of(self.files)

    def __fspath__(self) -> str:
        return str(self.path)

    @property
    def sentence(self) -> str:
        """The errors."""
        errors = [f"{each.nrmse:.3g} % on the {each.stretch} stretch of {each.record}" for each in self.result.errors]
        return f"The resistance is predicted with an error (NRMSE) of {', '.join(errors)}."

    @property
    def _warnings(self) -> tuple[str, ...]:
        """Rivals that recover strain better: they stand beside the command to build, which they question."""
        from gossamer_models.automatic import defeats

        return defeats(self.result.standings, ["strain"])

    def doubts(self) -> list[str]:
        """Return remarks, but for the repairs of the records, which were told before, and what stands among the hints."""
        told = {text for record in self.result.fit.records for text in record.repaired}
        return [text for text in self.result.remarks if text not in {*told, *self._warnings}]

    def more(self) -> list[str]:
        """Return all remarks, and where the artifact is."""
        return [*self.result.remarks, f"The artifact is {self.path}."]

    def hints(self) -> list[str]:
        """Return what to type for the FMUs of the sensor, what speaks against it, and the page."""
        from gossamer_models.sensor import SensorArtifact

        artifact = self.result.fit.artifact
        names = ["sensor", *["compensator"] * isinstance(artifact, SensorArtifact)]
        build = shlex.join(["gossamer", "build", *names, "--artifact", str(self), "--out", str(self.path.parent)])
        can_build = isinstance(artifact, SensorArtifact) or artifact.can_step
        told = [f"To build its FMUs, type '{build}'."] if can_build else []
        return [*told, *(f"Warning: {text}" for text in self._warnings), *hints_of(self.files)]

    def picture(self) -> bytes | None:
        """Return the first picture of resistance over strain."""
        return first_of(self.files, "_loop.png")

    def tables(self) -> list[TableText]:
        """Return trials, errors and rivals."""
        return [trial_table(self.result, SHOWN), error_table(self.result, self.rest), standing_table(self.result)]

    def to_json(self) -> dict[str, Any]:
        """Return the errors: NRMSE over the range of the record [%], E1 of the change from rest [%]."""
        result, names = self.result, ("value", "low", "high")
        return {
            "artifact": self.path,
            "files": self.files[1:],
            "model": self.model,
            "rest_resistance_ohm": result.fit.rest_resistance,
            "errors": [
                {
                    "record": e.record,
                    "stretch": e.stretch,
                    "samples": e.samples,
                    "e1_percent": e.e1,
                    "resistance_nrmse_percent": e.nrmse,
                    "strain_nrmse_percent": e.strain_nrmse,
                }
                for e in result.errors
            ],
            "standings": [
                {
                    "record": each.record,
                    "model": each.model,
                    "resistance_nrmse_percent": each.forward and dict(zip(names, each.forward, strict=True)),
                    "strain_nrmse_percent": each.strain and dict(zip(names, each.strain, strict=True)),
                }
                for each in result.standings
            ],
            "remarks": result.remarks,
        }


@command
def identify(
    files: Files,
    *,
    out: File = "out/identified/sensor.json",
    model: Name | None = None,
    budget: Budget | None = None,
    train: str = "50%",
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    weights: Numbers | None = None,
    own_scales: bool = False,
    origin: str = "not stated",
    pictures: bool = True,
    format: Form = "png",
    **options: Unpack[FitOptions],
) -> Identification:
    """Identify a sensor from measured strain and resistance.

    Says first what it read: columns, units, ranges, sampling, gaps, repairs. Writes the artifact, predicted and recovered
    values as CSV, pictures, and report.html, the page to look at.

    Models:

    - auto: chooses sensor, relaxation, regularisation, direct inverse and compensator by predicting the later parts of the
      training stretch. Sensor and compensator; gossamer build takes the compensator that was chosen.
    - preisach: modified Preisach with modal densities. Sensor and compensator.
    - preisach-hats: the same with hat functions, which follow rich records more closely. Sensor and compensator.
    - fractional-sub-model-1: fractional integrals, Eq. (3.21) of the thesis. Sensor.
    - fractional-model-1, fractional-sub-model-2: with phases, Eqs. (3.15) and (3.25). Offline only, no FMUs.

    Parameters
    ----------
    files
        CSV files with a header line; each is a record of one sensor.
    out
        File to write; pictures and page go beside it.
    model
        One of those above; auto if no option of a model is given, else preisach.
    budget
        Of the model auto: seconds after which it tries no more settings; 60 if not given. The few that it must try, the last
        fit, the checks and the pictures take half a minute more, or longer for long records.
    train
        What to fit: 0:200 for seconds from the first sample, 50% for a leading part; the rest is a test.
    full_scale
        Strain [1] at the end of the range; the largest if not given.
    rest_resistance
        Resistance at rest [ohm] where it is known; fitted if not given.
    weights
        Of each record's squared errors: 1,0.5 for two files; 1 if not given.
    own_scales
        Each record has its own offset and gain: re-mounted, another temperature, drift.
    origin
        Where the data come from, for the provenance.
    pictures
        Draw pictures of the fit, and write report.html, the page of them all.
    format
        Of the pictures: png, svg or pdf.
    **options
        Columns of the records, see ``RecordColumns``, and options of the models, see ``PreisachOptions``,
        ``FractionalOptions`` and ``CommonOptions``.

    Returns
    -------
    Identification
        Artifact, errors and records; a path of the artifact; displayed in a notebook.

    Examples
    --------
    >>> gossamer.identify("measured.csv", modes=7, relaxations=7, train="0:200", out="out/mine/sensor.json")

    On the command line::

        gossamer identify measurements.csv --out sensor.json

        gossamer identify measurements.csv --modes 7 --relaxations 7 --train 0:200 --out sensor.json

        gossamer build sensor compensator --artifact sensor.json

        gossamer identify measurements.csv --model fractional-sub-model-1 --terms 3 --out sensor.json
    """
    given = {name: value for name, value in locals().items() if name != "options"} | dict(options)
    from gossamer_models.automatic import BUDGET
    from gossamer_models.fitting import Columns
    from gossamer_models.identify import AUTO, identify_files, save_pictures, save_predictions, settings_for
    from gossamer_orchestrator.run.progress import ProgressBar

    from .pages.identify import identification_page

    paths, artifact = [Path(path) for path in several(files)], json_file(out)
    keep_inputs(paths, [out, artifact])
    check_form(format)
    begun = time.perf_counter()
    chosen = {name: _read(name, value) for name, value in options.items() if value is not None and value is not False}
    columns = {name: chosen.pop(name) for name in RecordColumns.__annotations__ if name in chosen}
    model = model or ("preisach" if chosen else AUTO)
    if model == AUTO and chosen:
        what = f"{option('model', AUTO)} chooses {', '.join(chosen)} itself."
        msg = f"{what} Leave the option out, or name another model."
        raise OrchestratorError(msg)
    if model != AUTO and budget is not None:
        what = f"{option('budget')} is the time for the choice of {option('model', AUTO)}, and {model} chooses nothing."
        msg = f"{what} Leave one of the two out."
        raise OrchestratorError(msg)
    settings: Any = AUTO if model == AUTO else settings_for(model, **chosen)
    with ProgressBar(
        "identify", stderr(), remaining=False
    ) as bar:  # its share counts settings, which take unlike times
        say, advance = _progress(bar, moves=model == AUTO)
        result = identify_files(
            paths,
            columns=Columns(**columns),
            weights=None if weights is None else _read("weights", weights),
            rest_resistance=rest_resistance,
            settings=settings,
            budget=BUDGET if budget is None else budget,
            command=_provenance(given, [*paths, Path(out)]),
            progress=say,
            advance=advance,
            recognised=_tell_recognised,
            train=train,
            full_scale=full_scale,
            own_scales=own_scales,
            origin=origin,
        )
        seconds = time.perf_counter() - begun
        result.fit.artifact.write(artifact)
        written = [artifact, *save_predictions(result, artifact.with_suffix(""))]
        written += save_pictures(result, artifact.with_suffix(""), format) if pictures else []
    found_at = "fitted" if rest_resistance is None else "given"
    rest = f"{found_at} {result.fit.rest_resistance:.6g}{UNITS[result.fit.records[0].unit]} at rest"
    if pictures:
        written += save_page(
            lambda: identification_page(result, artifact, paths, rest, seconds), artifact.with_suffix("")
        )
    return Identification(path=artifact, result=result, model=model, rest=rest, files=written)


def _progress(bar: ProgressBar, *, moves: bool) -> tuple[Callable[[str], None], Callable[[float, str], None]]:
    """Return what to call with a sentence, and with the share that is done and a sentence."""

    def say(text: str) -> None:
        logger.info("%s", text)
        bar.update(text=f"{text},")

    def advance(share: float, text: str) -> None:
        say(text)
        if moves:
            bar.update(share, 1.0)

    return say, advance


def _provenance(given: Mapping[str, Any], paths: Sequence[Path]) -> str:
    """Return the command or the call that identifies a sensor, files without their folders."""
    if TERMINAL.typed is None:
        return call_of("identify", given)
    names = {str(path): path.name for path in paths} | {f"--out={path}": f"--out={path.name}" for path in paths[-1:]}
    return shlex.join(["gossamer", *(names.get(word, word) for word in TERMINAL.typed)])


def _read(name: str, value: Any) -> Any:  # noqa: ANN401
    """Return the value of an option, from its text where it may be one."""
    readers: dict[str, Callable[[str], Any]] = {"ridge": number_or_auto, "residual": count_or_auto}
    readers |= dict.fromkeys(("tau", "exponents", "weights"), numbers)
    if name not in readers:
        return value
    text = with_commas(value)
    try:
        return readers[name](text)
    except ValueError as error:
        msg = f"cannot read {option(name)} {text!r} {error}"
        raise OrchestratorError(msg) from None


def _tell_recognised(records: Sequence[Record]) -> None:
    """Tell columns, units, ranges, sampling and gaps of records, how they were repaired, and what a user should confirm."""
    console = talk()
    print_tables(console, [recognised_table(records)])
    for record in records:
        confirm = [f"{record.name}: {text}" for text in (record.summary.remarks if record.summary else ())]
        for text in (*record.repaired, *confirm):
            console.print(text, style="yellow", markup=False)
            if not TERMINAL.talks and text in confirm:
                logger.info("%s", text)


def _histories(record: Record, predicted: Any) -> xr.Dataset:  # noqa: ANN401
    """Return a record and its predicted resistance over time."""
    import xarray as xr

    unit = record.unit or "not stated"
    columns = {
        "strain": (record.strain, "1"),
        "resistance": (record.resistance, unit),
        "predicted": (predicted, unit),
    }
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        coords={"time": ("time", record.time, {"units": "s", "long_name": "time"})},
        attrs={"record": record.name},
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Assessment(Result):
    """A sensor that was judged on other records.

    Attributes
    ----------
    judged : tuple of gossamer_models.review.Judged
        One for each record.
    stretch : str
        First stretch of each record.
    files : list of Path
        Predictions, pictures and page.
    """

    judged: tuple[Judged, ...]
    stretch: str
    files: list[Path]

    @property
    def records(self) -> dict[str, xr.Dataset]:
        """By the name of the record: strain [1], resistance and predicted resistance (in ohm, unless the file states a
        signal or no unit) over ``time`` [s]; recovered strain and its stated deviation [1] by ``compensator``.
        """  # noqa: D205
        import numpy as np

        records = {}
        for each in self.judged:
            unknown = np.full(each.record.time.shape, np.nan)
            deviations = [unknown if one.deviation is None else one.deviation for one in each.recovered.values()]
            found = {"recovered": [one.strain for one in each.recovered.values()], "deviation": deviations}
            by = {name: (("compensator", "time"), np.array(values), {"units": "1"}) for name, values in found.items()}
            data = _histories(each.record, each.predicted).assign(by)
            records[each.record.name] = data.assign_coords(compensator=list(each.recovered))
        return records

    @property
    def page(self) -> Path | None:
        """Page of the assessment; None where none was written."""
        return page_of(self.files)

    @property
    def sentence(self) -> str:
        """The errors."""
        each = [
            f"{one.forward(one.stretches().get('judged', one.first)):.3g} % for {one.record.name}"
            for one in self.judged
        ]
        return f"The resistance is predicted with an error (NRMSE) of {', '.join(each)}."

    def more(self) -> list[str]:
        """Return what was found out about the sensor."""
        return [text for each in self.judged for text in each.sentences()]

    def doubts(self) -> list[str]:
        """Return what was found out about the sensor, but for the repairs of its records, which were told before."""
        told = {text for each in self.judged for text in each.record.repaired}
        return [text for text in self.more() if text not in told]

    def picture(self) -> bytes | None:
        """Return the first picture of resistance over strain."""
        return first_of(self.files, "_loop.png")

    def tables(self) -> list[TableText]:
        """Return the errors, and the scales where they were fitted."""
        return assessment_tables(self.judged, self.stretch)

    def to_json(self) -> dict[str, Any]:
        """Return the errors: NRMSE over the range of the record [%]."""
        errors = [
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
            for judged in self.judged
            for name, rows in judged.stretches().items()
        ]
        return {"files": self.files, "errors": errors, "remarks": self.more()}


@command
def assess(
    sensor: File,
    files: Files,
    *,
    compensator: Names | None = None,
    fit_scales: bool = False,
    stretch: str = "50%",
    out: Folder = "out/assessed",
    pictures: bool = True,
    format: Form = "png",
    **columns: Unpack[RecordColumns],
) -> Assessment:
    """Judge an identified sensor on other records, without fitting it.

    Says first what it read: columns, units, ranges, sampling, gaps, repairs, and where a record leaves the full scale of the
    sensor: it is judged up to there. Writes predicted and recovered values as CSV, pictures, and report.html, the page to
    look at. Beside the sensor stands a static cubic, which is fitted to the first stretch of each record.

    Parameters
    ----------
    sensor
        Artifact of an identification.
    files
        CSV files with a header line, one record each.
    compensator
        What recovers strain; may be repeated: inverse (its direct one where it has one), exact, estimator, filter. The one
        that the artifact names by default.
    fit_scales
        Find gain, offset and what was still relaxing of each record in its first stretch, and judge the rest: for a sensor
        that was mounted again, is warmer, or has drifted.
    stretch
        First stretch of each record: 0:200 for seconds, 50% for a leading part.
    out
        Folder of predictions, pictures and page.
    pictures
        Draw pictures, and write report.html, the page of them all.
    format
        Of the pictures: png, svg or pdf.
    **columns
        Columns of the records, see ``RecordColumns``.

    Returns
    -------
    Assessment
        Errors and records; displayed in a notebook.

    Examples
    --------
    >>> gossamer.assess("out/mine/sensor.json", "other.csv", fit_scales=True)

    On the command line::

        gossamer assess sensor.json other.csv

        gossamer assess sensor.json other.csv third.csv --fit-scales --stretch 0:200

        gossamer assess sensor.json other.csv --compensator inverse --compensator estimator --out out/mine
    """
    from gossamer_models.fitting import Columns
    from gossamer_models.replay import table_path
    from gossamer_models.review import judge_files, save_judged
    from gossamer_orchestrator.run.progress import ProgressBar

    from .pages.assess import assessment_page

    artifact, paths, folder = Path(sensor), [Path(path) for path in several(files)], Path(out)
    keep_inputs([artifact, *paths], [folder, *(table_path(folder, each.name) for each in paths)])
    check_form(format)
    begun = time.perf_counter()
    with ProgressBar("assess", stderr()) as bar:
        judged = judge_files(
            artifact,
            paths,
            columns=Columns(**columns),
            compensators=tuple(several(compensator)),
            own_scales=fit_scales,
            stretch=stretch,
            recognised=_tell_recognised,
            progress=lambda text: bar.update(text=text),
        )
        seconds = time.perf_counter() - begun
        written = save_judged(judged, folder, pictures=pictures, form=format)
    if pictures:
        shown = assessment_tables(judged, stretch)
        written += save_page(lambda: assessment_page(judged, artifact, paths, shown, seconds), folder)
    return Assessment(judged=judged, stretch=stretch, files=written)
