"""How good sensors and detectors are on records that they were not made from."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.inputs import check_outputs

from .arguments import Count, File, Files, Folder, Form, Names, Values, command, several
from .options import ColumnOptions
from .plans import judged_on
from .records import histories, tell_recognised
from .results import Result, by_label, first_of
from .working import progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.assessment import AssessmentResults
    from gossamer_models.review import Judged

TWIN_RECORDS, TWIN_SIZES = 6, 3  # records of a condition, sizes of damage in each zone that the twin has time for
UNITS = {"error_all": "% damage", "error_damaged": "% damage", "a50": "1", "a90": "1", "a90_95": "1"}


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
            data = histories(each.record, each.predicted).assign(by)
            records[each.record.name] = data.assign_coords(compensator=list(each.recovered))
        return records

    @property
    def sentence(self) -> str:
        """The errors."""
        each = [f"{one.forward(one.judged()):.3g} % for {one.record.name}" for one in self.judged]
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
        from gossamer_models.tables import assessment_tables

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
    **columns: Unpack[ColumnOptions],
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
        Of the pictures.
    **columns
        Columns of the records, see ``ColumnOptions``.

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
    from gossamer_models.tables import assessment_tables

    from .pages.sensors import assessment_page

    artifact, paths, folder = Path(sensor), [Path(path) for path in several(files)], Path(out)
    check_outputs([folder, *(table_path(folder, each.name) for each in paths)])
    begun = time.perf_counter()
    with progress_bar("assess") as bar:
        judged = judge_files(
            artifact,
            paths,
            columns=Columns(**columns),
            compensators=tuple(several(compensator)),
            own_scales=fit_scales,
            stretch=stretch,
            recognised=tell_recognised,
            progress=lambda text: bar.update(text=text),
        )
        seconds = time.perf_counter() - begun
        written = save_judged(judged, folder, pictures=pictures, form=format)
    if pictures:
        shown = assessment_tables(judged, stretch)
        written += save_page(lambda: assessment_page(judged, artifact, paths, shown, seconds), folder)
    return Assessment(judged=judged, stretch=stretch, files=written)


@dataclass(frozen=True, kw_only=True, repr=False)
class DetectorAssessment(Result):
    """Detectors that were judged under many conditions.

    Attributes
    ----------
    result : gossamer_models.assessment.AssessmentResults
        Everything that was found.
    files : list of Path
        Results, pictures and page.
    """

    result: AssessmentResults
    files: list[Path]
    PLACE = "Files are in {}."

    @property
    def data(self) -> xr.Dataset:
        """By ``detector`` and ``condition``: ``error_all``, ``error_damaged`` [%], shares [1] with the bounds ``_low`` and
        ``_high`` of their 95 % intervals, and the other figures of ``gossamer_models.assessment.Figures``.
        """  # noqa: D205
        rows = (((row.judge, row.condition), _figures(row.figures)) for row in self.result.rows)
        return by_label(("detector", "condition"), rows)

    @property
    def detections(self) -> xr.Dataset:
        """Probability of detection by ``detector``, ``condition`` and ``zone``, 0 for all zones together: ``a50``, ``a90``,
        ``a90_95`` [1], the ``threshold`` of a call and the share of ``false_calls`` [1].
        """  # noqa: D205
        names = ("a50", "a90", "a90_95", "threshold")
        rows = (
            (
                (row.judge, row.condition, row.zone),
                {name: getattr(row, name) for name in names} | {"false_calls": row.false_calls.value},
            )
            for row in self.result.detections
        )
        return by_label(("detector", "condition", "zone"), rows)

    def __fspath__(self) -> str:
        return str(self.files[0].parent)

    @property
    def sentence(self) -> str:
        """How many detectors and conditions there are."""
        from gossamer_orchestrator.words import counted

        sizes = self.data.sizes
        return f"{counted(sizes['detector'], 'detector')} under {sizes['condition']} conditions."

    def picture(self) -> bytes | None:
        """Return errors under each condition."""
        return first_of(self.files, "errors.png")

    def tables(self) -> list[TableText]:
        """Return errors by condition, and probabilities of detection."""
        from gossamer_models.assessment.tables import condition_table, detection_table

        tables = [condition_table(self.result)]
        return [*tables, detection_table(self.result)] if self.result.detections else tables

    def to_json(self) -> dict[str, Any]:
        """Return everything."""
        found = self.result
        return {"files": self.files, "conditions": found.rows, "detections": found.detections, "units": UNITS}


@command
def assess_detector(
    *,
    artifact: Files | None = None,
    setup: File | None = None,
    mesh: File | None = None,
    set: Values | None = None,
    twin: bool = False,
    conditions: Names | None = None,
    noise: float | None = None,
    cases: Count = 400,
    out: Folder = "out/assessment",
) -> DetectorAssessment:
    """Judge detectors, and the twin, under many conditions.

    Simulates records under many conditions (noise, load, material, sensors, another mesh), asks every detector for the
    damage, and compares: errors, false calls, reliability of stated deviations, confusion of zones, and the probability of
    detection against size with a90/95 of each zone, after MIL-HDBK-1823A. Called again, it goes on after an interruption:
    finished simulations are kept, and so is what the twin said.

    Parameters
    ----------
    artifact
        Trained detector: its file, or nominal, wide or single_damage; may be repeated. These three by default.
    setup
        Setup of the membrane in place of the one that the first detector was trained for and carries, or of the square of
        the thesis.
    mesh
        With a setup: mesh file in place of its own.
    set
        Parameter or constant input of a membrane on a mesh, in place of that of the training, NAME=VALUE; may be repeated.
    twin
        The digital twin too, on few records: it takes long.
    conditions
        These alone, by name, and no probability of detection; may be repeated. all: every one; short: eight. Every judge is
        asked about every record then.
    noise
        Standard deviation of the white noise of strain, in place of that of the training or the thesis.
    cases
        Records of each condition; a fifth as many sizes of damage in each zone.
    out
        Folder of results, pictures and simulations.

    Returns
    -------
    DetectorAssessment
        Errors, false calls and probability of detection; a path of the folder; displayed in a notebook.

    Examples
    --------
    >>> gossamer.assess_detector(artifact="mine.json", cases=100).data["error_damaged"].sel(condition="clean")

    On the command line::

        gossamer assess-detector

        gossamer assess-detector --artifact mine.json --twin --cases 100 --out out/mine

        gossamer assess-detector --artifact out/detector/reflector.json

        gossamer assess-detector --twin --conditions short --cases 3 --out out/worlds
    """
    from gossamer_models import assessment
    from gossamer_models.assessment.plots import save_pictures
    from gossamer_models.campaign import Distribution, MeasurementNoise

    from .pages.detectors import assessment_page

    folder, artifacts, only = Path(out), [Path(path) for path in several(artifact)], several(conditions)
    check_outputs(folder / name for name in ("assessment.json", "assessment.npz"))
    with progress_bar("assessment") as bar:
        bar.update(text="reading detectors,")
        plan = judged_on(artifacts, setup, mesh, set)
        square, plan = plan is None, plan or assessment.plan_of_square()
        if noise is not None:
            plan = replace(plan, noise=MeasurementNoise(strain=Distribution(normal=noise)))
        structure = plan.membrane.structure
        judges = [assessment.read_judge(path, structure) for path in artifacts] if artifacts else assessment.shipped_judges()
        records = cases if only else TWIN_RECORDS
        twins = assessment.twin_judges(records, TWIN_SIZES, None if square else plan.membrane) if twin else ()
        zero = assessment.AlwaysZero(zones=structure.n_zones)

        def report(what: str, done: int, total: int) -> None:
            bar.update(done, total, f"{what}: {done} of {total},")

        found = assessment.assess(
            [zero, *judges, *twins], folder / "simulations", cases=cases, plan=plan, only=only, report=report
        )
        files = [*assessment.write_assessment(found, folder), *save_pictures(found, folder)]
    return DetectorAssessment(result=found, files=files + save_page(lambda: assessment_page(found, structure), folder))


def _figures(figures: Any) -> dict[str, float]:  # noqa: ANN401
    """Return figures of merit by name; of a share its value, and its bounds as ``_low`` and ``_high``."""
    found: dict[str, float] = {}
    for name in (each.name for each in fields(figures)):
        value = getattr(figures, name)
        if hasattr(value, "low"):
            found |= {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}
        else:
            found[name] = value
    return found
