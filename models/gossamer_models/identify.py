"""From CSV files to an artifact: the work of the command ``gossamer identify``, and its options."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gossamer_files import digest
from gossamer_files.charts import Chart
from gossamer_files.options import option
from gossamer_files.plots import save_charts
from threadpoolctl import threadpool_limits

from .arrays import Vector
from .automatic import BUDGET, Standing, Trial, choose, defeats, standings
from .errors import ParameterError, require
from .fitting.errors import Errors, nrmse, stretch_errors
from .fitting.reading import Columns, read_records
from .fitting.records import Record, judged_rows, strain_range, thin, training_stretches
from .fractional import FractionalFit, FractionalSettings, fit_fractional
from .fractional.artifact import MODELS as FRACTIONAL
from .fractional.fit import doubts as fractional_doubts
from .plots import ModelledRecord, record_files
from .replay import Recovered, clipped_strain, recover_by_fit, table_path, write_predictions
from .self_test import SelfTest, cycled_doubt, cycled_range, self_test
from .sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from .sensor.fit.align import RelativeScale, align
from .sensor.fit.doubts import doubts as preisach_doubts
from .sensor.fit.doubts import start_errors, undetermined
from .sensor.fit.settings import MODELS as PREISACH
from .sensor.fit.temperature import Warming, fit_warming
from .sensor.plots import FILES as SENSOR_FILES
from .sensor.plots import sensor_files

log = logging.getLogger(__name__)
AUTO: Literal["auto"] = "auto"  # chooses the model by predicting the later parts of the training stretch
WORSE = 1.5  # times the error of the test stretch: that of training is a warning
BEYOND = 1.05  # times the largest strain of training

Fit = PreisachFit | FractionalFit
Settings = PreisachSettings | FractionalSettings

MODELS: dict[str, Callable[..., Settings]] = {
    **{name: partial(PreisachSettings.of, name) for name in PREISACH},
    **{f"fractional-{name}": partial(FractionalSettings, model=name) for name in FRACTIONAL},
}


@dataclass(frozen=True, kw_only=True)
class Identified:
    """Result of an identification.

    Attributes
    ----------
    fit : PreisachFit or FractionalFit
        The fit.
    errors : tuple of Errors
        Training and test stretch of every record.
    remarks : tuple of str
        Repairs of the records, what the data do not determine, and baselines that are better.
    recovered : tuple of Recovered
        What the compensator recovers from each record; empty for a model without one.
    trials : tuple of Trial
        What was tried, if the model was chosen automatically.
    standings : tuple of Standing
        Errors on the test stretches beside those of a static cubic and of a regression on lags.
    scales : tuple of RelativeScale
        Scale of every record, if they have scales of their own; the fit is in the units of the first one.
    warming : Warming or None
        What temperature does to the sensor, where it is clear from the records; the fit is at its reference.
    own : tuple of SelfTest
        What the compensator recovers of what the sensor's model makes of each record; empty for a model without one.
    cycled : tuple of float
        Range of the sensor's output over 100 cycles within the strain of each record, over its range [1]; as ``own``.
    """

    fit: Fit
    errors: tuple[Errors, ...]
    remarks: tuple[str, ...] = ()
    recovered: tuple[Recovered, ...] = ()
    trials: tuple[Trial, ...] = ()
    standings: tuple[Standing, ...] = ()
    scales: tuple[RelativeScale, ...] = ()
    warming: Warming | None = None
    own: tuple[SelfTest, ...] = ()
    cycled: tuple[float, ...] = ()

    def in_its_file(self, k: int) -> tuple[Record, Vector]:
        """Return record k and the resistance predicted for it, shape (m,), in the units of its file."""
        record, predicted = self.fit.records[k], self.fit.predicted[k]
        measured = record.resistance
        if self.scales:
            offset, gain = self.scales[k].offset, self.scales[k].gain
            measured, predicted = offset + gain * measured, offset + gain * predicted
        if self.warming is not None:
            measured, predicted = (self.warming.done(record, each) for each in (measured, predicted))
        return replace(record, resistance=measured), predicted

    def recovered_of(self, k: int) -> dict[str, Recovered]:
        """Return what is recovered from record k, by name; nothing for a model without a compensator."""
        return {"recovered": self.recovered[k]} if self.recovered else {}

    def modelled(self, k: int) -> ModelledRecord:
        """Return what the charts of record k show."""
        record, predicted = self.in_its_file(k)
        compensator = getattr(self.fit.artifact, "compensator", None) or "inverse"
        recovered = {compensator: self.recovered[k]} if self.recovered else {}
        return ModelledRecord(record=record, predicted=predicted, recovered=recovered, first=self.fit.train[k])


def settings_for(model: str, **chosen: Any) -> Settings:  # noqa: ANN401
    """Return how to fit a model.

    Parameters
    ----------
    model : str
        preisach, preisach-hats, fractional-model-1, fractional-sub-model-1 or fractional-sub-model-2.
    **chosen
        Its options, see ``PreisachSettings`` and ``FractionalSettings``; those that are None take the model's defaults.

    Raises
    ------
    ParameterError
        There is no such model, it has no such option, or the options do not fit together.
    """
    given = {name: value for name, value in chosen.items() if value is not None}
    if model == AUTO:
        msg = f"auto chooses {', '.join(given) or 'its settings'} itself. Leave them out, or name another model."
        raise ParameterError(msg)
    require(model in MODELS, f"there is no model {model!r}; choose one of {', '.join((AUTO, *MODELS))}")
    for name in given:
        others = PreisachSettings.OPTIONS.get(name, ()) + FractionalSettings.OPTIONS.get(name, ())
        if model not in others:
            advice = f", or choose {' or '.join(option('model', each) for each in others)}" if others else ""
            msg = f"{model} has no {name.replace('_', ' ')}. Leave {option(name)} out{advice}."
            raise ParameterError(msg)
    return MODELS[model](**given)


def identify_files(
    paths: Sequence[Path],
    *,
    columns: Columns | None = None,
    weights: Sequence[float] | None = None,
    train: str = "50%",
    settings: Settings | Literal["auto"] | None = None,
    budget: float = BUDGET,
    own_scales: bool = False,
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    command: str = "",
    origin: str = "not stated",
    progress: Callable[[str], None] = lambda _: None,
    recognised: Callable[[Sequence[Record]], None] = lambda _: None,
    advance: Callable[[float, str], None] = lambda _share, _text: None,
) -> Identified:
    """Fit a sensor to the records in some files.

    Parameters
    ----------
    paths : sequence of Path
        CSV files, one record each; of more than ``fitting.records.MOST_SAMPLES`` samples together some are left out by
        the rule of ``fitting.records.thin``, and the log says so before the fit.
    columns : Columns or None
        Columns to read, with their units.
    weights : sequence of float or None
        Of the squared errors of each record [1]; None for 1.
    train : str
        Training stretch of every record, see ``training_stretches``.
    settings : PreisachSettings, FractionalSettings, "auto" or None
        Model and settings of the fit, see ``settings_for``; None for the thesis' Preisach model. "auto" chooses them and
        the compensator, see ``automatic.choose``.
    budget : float
        Time [s] for that choice.
    own_scales : bool
        Whether each record has an offset and a gain of its own, see ``sensor.fit.align``; the sensor and its errors are in
        the units of the first one.
    full_scale : float or None
        Strain [1] at the end of the range.
    rest_resistance : float or None
        Resistance [ohm] of the unstrained sensor at rest, where it is known.
    command, origin : str
        For the provenance of the artifact.
    progress : callable
        Called with a sentence on the progress.
    recognised : callable
        Called with the records before anything is fitted; ``Record.summary`` says what was recognised.
    advance : callable
        Called with the share of an automatic choice that is done [1] and a sentence.

    Returns
    -------
    Identified
        Fit and errors; the artifact carries its provenance.
    """
    settings = settings or PreisachSettings()
    progress("reading")
    read = read_records(paths, columns, weights)
    recognised(read)
    records = thin(read)
    for before, record in zip(read, records, strict=True):
        if record is not before:
            log.warning("%s: %s", record.name, record.repairs[-1])
    del read, before  # of ten million rows those that are not fitted would take a fifth of the memory of the fit
    rows = training_stretches(records, train)
    warming = None
    if not isinstance(settings, FractionalSettings) and not own_scales:  # which would read as an effect of temperature
        warming = fit_warming(records, rows, strain_range(records, full_scale))
    if warming is not None and warming.clear:
        records = tuple(map(warming.at_reference, records))
    scales: tuple[RelativeScale, ...] = ()
    if own_scales and len(records) == 1:
        left = option("own_scales", True)
        msg = f"one record has no scale of its own beside others. Name more records, or leave {left} out."
        raise ParameterError(msg)
    if own_scales:
        progress("aligning the records")
        records, scales = align(records, rows, full_scale=strain_range(records, full_scale))
    given: dict[str, Any] = {"full_scale": full_scale, "rest_resistance": rest_resistance}
    fit: Fit
    trials: tuple[Trial, ...] = ()
    if isinstance(settings, str):
        with threadpool_limits(1):  # also for the same bits with any number of threads
            won = choose(records, rows, budget=budget, progress=advance, **given)
        fit, trials = won.fit, won.trials
        chosen = f"Chosen by predicting the later parts of the training stretch: {won.text}."
        doubted = [chosen, *preisach_doubts(fit, chosen=True)]
        trained = max(float(record.strain[part].max()) for record, part in zip(records, rows, strict=True) if part.any())
        if fit.full_scale > BEYOND * trained:
            doubted.append(
                f"Strain from {trained:g} to the full scale {fit.full_scale:g} is in no training stretch, and the choice "
                f"cannot judge it. Name {option('model', 'preisach')}, which extrapolates better, or train on that range."
            )
        if won.untried:
            untried = f"{won.untried} of {won.untried + len(trials)} settings"
            doubted.append(f"{untried} were not tried in {budget:g} s ({option('budget')}).")
        stated = _stated(fit)
    elif isinstance(settings, FractionalSettings):
        fit = fit_fractional(records, rows, settings, progress=progress, **given)
        doubted = list(fractional_doubts(fit))
        stated = {"settings": repr(settings)}
    else:

        def watch(start: str, iteration: int, error: float) -> None:
            progress(f"{start}, step {iteration}: error {error:.3f} % of range")

        fit = fit_preisach(records, rows, settings, watch=watch, **given)
        doubted = list(preisach_doubts(fit))
        if settings.ridge == "auto":
            chosen = f"The ridge {fit.settings.ridge:g} is a mean of those that best predict the later parts of training."
            doubted.insert(0, chosen)
        stated = _stated(fit)
    recovered: tuple[Recovered, ...] = ()
    own: tuple[SelfTest, ...] = ()
    cycled: tuple[float, ...] = ()
    if isinstance(fit, PreisachFit):
        progress("recovering the strain")
        recovered = tuple(recover_by_fit(fit, record) for record in fit.records)
        parts = zip(fit.records, recovered, map(judged_rows, fit.train), strict=True)
        doubted += filter(None, (clipped_strain(record, found, fit.full_scale, rows) for record, found, rows in parts))
        progress("recovering what the sensor's own model gives")
        own = tuple(self_test(fit, record) for record in fit.records)
        doubted += [f"{each.sentence} {each.reason}" for each in own if each.reason]
        cycled = tuple(cycled_range(fit, record) for record in fit.records)
        doubted += filter(None, (cycled_doubt(r.name, size) for r, size in zip(fit.records, cycled, strict=True)))
    strains = [found.strain for found in recovered] or None
    progress("comparing with the records")
    errors = stretch_errors(fit.records, fit.predicted, fit.train, fit.rest_resistance, strains)
    progress("training rivals")
    doubted += [text for found, record in zip(recovered, fit.records, strict=False) if (text := _delayed(found, record))]
    doubted += _worse_in_training(errors)
    table = standings(fit.records, fit.train, fit.predicted, recovered)
    doubted += defeats(table)
    provenance = {
        "data": ", ".join(record.name for record in records),
        "origin": origin,
        "sha256": ", ".join(digest(path) for path in paths),
        "command": command,
        "train": train,
        **stated,
        **{f"{e.record} {e.stretch}": f"E1 {e.e1:.3f} %, NRMSE {e.nrmse:.3f} % of range" for e in errors},
        **{f"{r.name} over 100 cycles": f"{size:.2f} of range" for r, size in zip(records, cycled, strict=False)},
        "doubts": " ".join(doubted),
        **{f"own scale of {r.name}": f"{s.offset:.6g} + {s.gain:.6g} R" for r, s in zip(records, scales, strict=False)},
        **{f"repairs of {record.name}": "; ".join(record.repairs) for record in records if record.repairs},
    }
    repairs = tuple(sentence for record in records for sentence in record.repaired)
    repairs += tuple(
        f"{r.name} has the scale {s.offset:.6g} + {s.gain:.6g} R, where R is of {records[0].name}."
        for r, s in zip(records[1:], scales[1:], strict=False)
    )
    repairs += () if warming is None else (warming.sentence,)
    tested = [e.nrmse / 100.0 for e in errors if e.stretch == "test"]
    artifact: Any = replace(fit.artifact, provenance=provenance)
    if isinstance(fit, PreisachFit):
        artifact = replace(artifact, error=max(tested, default=0.0) or None)
    if isinstance(fit, PreisachFit) and warming is not None and warming.clear:
        artifact = replace(artifact, temperature=warming.effect(fit.rest_resistance, fit.resistance_change))
    fit = replace(fit, artifact=artifact)
    remarks = (*repairs, *doubted)
    return Identified(
        fit=fit,
        errors=errors,
        remarks=remarks,
        recovered=recovered,
        trials=trials,
        standings=table,
        scales=scales,
        warming=warming if warming is not None and warming.clear else None,
        own=own,
        cycled=cycled,
    )


def _delayed(found: Recovered, record: Record) -> str:
    """Say by how much the strain that a compensator recovers is delayed, and how large its error is without."""
    if not found.delay:
        return ""
    now = nrmse(record.strain, found.present, float(np.ptp(record.strain)))
    return (
        f"{record.name}: strain is recovered {found.late(record)} samples late, {found.delay:.3g} s. Without delay, as "
        f"present_strain, its error over the record is {now:.2f} % of range."
    )


def _worse_in_training(errors: Sequence[Errors]) -> list[str]:
    """Say which records are recovered worse where the sensor was fitted than where it was not."""
    strains = {(e.record, e.stretch): e.strain_nrmse for e in errors if e.strain_nrmse is not None}
    return [
        f"{record}: strain is recovered worse where the sensor was fitted, {error:.2f} % of range, than in the test "
        f"stretch, {test:.2f} %: the test is easier than what will come. Look at the training stretch."
        for (record, stretch), error in strains.items()
        if stretch == "train" and (test := strains.get((record, "test"))) is not None and error > WORSE * test
    ]


def _stated(fit: PreisachFit) -> dict[str, str]:
    """Return how a sensor was fitted, for its provenance."""
    return {
        "settings": repr(fit.settings),  # with the ridge chosen
        "full_scale_strain": repr(fit.full_scale),
        "offset": repr(fit.rest_resistance),
        "scale": repr(fit.resistance_change),
        "not determined by the data": undetermined(fit),
        "starts ended at": ", ".join(f"{each:.3f} %" for each in start_errors(fit)),
    }


def save_pictures(result: Identified, folder: Path, form: str = "png") -> list[Path]:
    """Write all pictures that an identified model has, as png, svg or pdf; return their paths."""
    fit = result.fit
    pictures: dict[str, Chart] = {}
    for k in range(len(fit.records)):
        pictures |= record_files(result.modelled(k))
    if isinstance(fit, PreisachFit):
        pictures |= sensor_files(fit.artifact)
        for name in SENSOR_FILES.values() - pictures.keys():
            (folder / f"{name}.{form}").unlink(missing_ok=True)  # of an earlier fit
    return save_charts(pictures, folder, form)


def save_predictions(result: Identified, folder: Path) -> list[Path]:
    """Write predicted resistance and recovered strain of every record as CSV; return the paths."""
    fit, paths = result.fit, []
    for k, record in enumerate(fit.records):
        columns = {f"{name} strain": found.strain for name, found in result.recovered_of(k).items()}
        path = table_path(folder, record.name)
        paths.append(write_predictions(path, *result.in_its_file(k), columns, fit.train[k]))
    return paths
