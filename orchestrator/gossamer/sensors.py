"""Sensors that are learnt from measured records, and judged on others."""

from __future__ import annotations

import logging
import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

from gossamer_files.inputs import check_outputs
from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, require

from .arguments import Budget, File, Files, Form, Name, Numbers, call_of, command, several
from .options import ColumnOptions, FitOptions
from .recalibrating import Recalibration, recalibrated_from
from .records import histories, tell_recognised
from .results import Saved, first_of
from .working import TERMINAL, json_file, progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.identify import Identified

SHOWN = 6  # trials of each stage, the best ones

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, repr=False)
class Identification(Saved):
    """A sensor that was identified.

    Attributes
    ----------
    result : gossamer_models.identify.Identified
        Fit, errors and remarks.
    model : str
        Which model was asked for: auto or its name.
    rest : str
        The resistance from which changes count, in words.
    files : list of Path
        The artifact, predictions, pictures and page.
    """

    result: Identified
    model: str
    rest: str

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
            records[record.name] = histories(record, predicted).assign(columns)
        return records

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
        told = [f"To build its FMUs, type '{build}'."] * (isinstance(artifact, SensorArtifact) or artifact.can_step)
        return [*told, *(f"Warning: {text}" for text in self._warnings), *super().hints()]

    def picture(self) -> bytes | None:
        """Return the first picture of resistance over strain."""
        return first_of(self.files, "_loop.png")

    def tables(self) -> list[TableText]:
        """Return trials, errors and rivals."""
        from gossamer_models.tables import error_table, own_table, standing_table, trial_table

        result = self.result
        return [trial_table(result, SHOWN), error_table(result, self.rest), standing_table(result), own_table(result)]

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
            "own_model": [
                {
                    "record": each.record,
                    "strain_nrmse_percent": each.clean,
                    "with_noise_percent": each.noisy,
                    "error_over_stated_deviation": each.stated,
                    "range_over_100_cycles": cycled,
                }
                for each, cycled in zip(result.own, result.cycled, strict=True)
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
    from_twin: bool = False,
    sensor: File | None = None,
    setup: File | None = None,
    origin: str = "not stated",
    pictures: bool = True,
    format: Form = "png",
    **options: Unpack[FitOptions],
) -> Identification | Recalibration:
    """Identify a sensor from measured strain and resistance; or in flight, the sensors of a record that a twin explains.

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
        Of the model auto: seconds after which it tries no more settings, and says so; 300 if not given. Usually all are
        tried in a minute or less, and the answer is then the same on any machine.
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
    from_twin
        The file is a record of resistance in flight, as gossamer twin takes it. Where the twin explains it, its strain is
        the reference, and each sensor is identified again from its own resistance: an artifact for each in the folder of
        out. Beyond the strain of the record the tables stay the old ones.
    sensor
        With from_twin: artifact of the sensors as they were taken to be; the shipped one by default.
    setup
        With from_twin: setup of the membrane; by default the square, or that of the run.
    origin
        Where the data come from, for the provenance.
    pictures
        Draw pictures of the fit, and write report.html, the page of them all.
    format
        Of the pictures.
    **options
        Columns of the records, see ``ColumnOptions``, and options of the models, see ``PreisachOptions``,
        ``FractionalOptions`` and ``CommonOptions``.

    Returns
    -------
    Identification or Recalibration
        Artifact, errors and records; a path of the artifact; displayed in a notebook.

    Examples
    --------
    >>> gossamer.identify("measured.csv", modes=7, relaxations=7, train="0:200", out="out/mine/sensor.json")

    On the command line::

        gossamer identify measurements.csv --out sensor.json

        gossamer identify measurements.csv --modes 7 --relaxations 7 --train 0:200 --out sensor.json

        gossamer build sensor compensator --artifact sensor.json

        gossamer identify measurements.csv --model fractional-sub-model-1 --terms 3 --out sensor.json

        gossamer identify --from-twin flight.csv --sensor old.json --out sensors
    """
    given = {name: value for name, value in locals().items() if name != "options"} | dict(options)
    if from_twin:
        fixed = {"model": model, "budget": budget, "weights": weights, "full_scale": full_scale, **options}
        fixed |= {"train": train != "50%", "rest_resistance": rest_resistance, "own_scales": own_scales}
        if named := [name for name, value in fixed.items() if value not in (None, False)]:
            msg = (
                f"{option(named[0])} is not for {option('from_twin')}, which keeps to the old sensor's model. Leave it out."
            )
            raise OrchestratorError(msg)
        folder = Path(out).with_suffix("") if Path(out).suffix == ".json" else Path(out)
        return recalibrated_from(files, folder, sensor, setup, "" if origin == "not stated" else origin)
    for name, value in (("sensor", sensor), ("setup", setup)):
        require(value is None, f"{option(name)} is for {option('from_twin')}. Leave it out.")
    from gossamer_models.automatic import BUDGET
    from gossamer_models.fitting import Columns
    from gossamer_models.identify import AUTO, identify_files, save_pictures, save_predictions, settings_for
    from gossamer_models.replay import table_path
    from gossamer_models.tables import UNITS

    from .pages.sensors import identification_page

    paths, artifact = [Path(path) for path in several(files)], json_file(out)
    check_outputs([out, artifact, *(table_path(artifact.with_suffix(""), path.name) for path in paths)])
    begun = time.perf_counter()
    chosen: dict[str, Any] = {name: value for name, value in options.items() if value is not None and value is not False}
    columns = {name: chosen.pop(name) for name in ColumnOptions.__annotations__ if name in chosen}
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
    with progress_bar("identify", remaining=False) as bar:  # its share counts settings, which take unlike times

        def tell(text: str, share: float | None = None) -> None:
            logger.info("%s", text)
            bar.update(text=f"{text},")
            if share is not None and model == AUTO:
                bar.update(share, 1.0)

        result = identify_files(
            paths,
            columns=Columns(**columns),
            weights=cast("Sequence[float] | None", weights),
            rest_resistance=rest_resistance,
            settings=settings,
            budget=BUDGET if budget is None else budget,
            command=_provenance(given, [*paths, Path(out)]),
            progress=tell,
            advance=lambda share, text: tell(text, share),
            recognised=tell_recognised,
            train=train,
            full_scale=full_scale,
            own_scales=own_scales,
            origin=origin,
        )
        seconds = time.perf_counter() - begun
        tell("writing the sensor and its predictions")
        result.fit.artifact.write(artifact)
        written = [artifact, *save_predictions(result, artifact.with_suffix(""))]
        tell("drawing")
        written += save_pictures(result, artifact.with_suffix(""), format) if pictures else []
    found_at = "fitted" if rest_resistance is None else "given"
    rest = f"{found_at} {result.fit.rest_resistance:.6g}{UNITS[result.fit.records[0].unit]} at rest"
    if pictures:
        written += save_page(lambda: identification_page(result, artifact, paths, rest, seconds), artifact.with_suffix(""))
    return Identification(result=result, model=model, rest=rest, files=written)


def _provenance(given: Mapping[str, Any], paths: Sequence[Path]) -> str:
    """Return the command or the call that identifies a sensor, files without their folders."""
    if TERMINAL.typed is None:
        return call_of("identify", given)
    names = {str(path): path.name for path in paths} | {f"--out={path}": f"--out={path.name}" for path in paths[-1:]}
    return shlex.join(["gossamer", *(names.get(word, word) for word in TERMINAL.typed)])
