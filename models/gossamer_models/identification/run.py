"""From CSV files to an artifact: what the command ``gossamer identify`` calls."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError, ParameterError
from ..fractional import FractionalFit
from ..measures import nrmse
from .fractional import FractionalChoice, fit_fractional
from .judge import recover_strain
from .preisach import Fit, fit_preisach, with_provenance
from .quality import Errors, doubts, errors
from .records import Columns, Record, read_records
from .regressors import DRIVES, GAIN
from .settings import FitSettings

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Identified:
    """What came of an identification.

    Attributes
    ----------
    fit : Fit or FractionalFit
        The fit.
    records : tuple of Record
        What was fitted.
    predicted : tuple of ndarray
        Output of the model at the samples of every record, in its unit.
    train : tuple of ndarray of bool
        Samples of every record that were fitted.
    rest : float
        Output of the unstrained sensor at rest, given or fitted, which E1 counts changes from.
    errors : tuple of Errors
        Training and test stretch of every record.
    remarks : tuple of str
        What was repaired, and what the data do not determine.
    """

    fit: Fit | FractionalFit
    records: tuple[Record, ...]
    predicted: tuple[Vector, ...]
    train: tuple[NDArray[np.bool_], ...]
    rest: float
    errors: tuple[Errors, ...]
    remarks: tuple[str, ...] = ()


MODELS = ("preisach", "preisach-hats")
EXTENSIONS = ("none", "falling", "gain", "reversing")


def settings_for(
    model: str,
    *,
    modes: int = 7,
    relaxations: int = 7,
    extension: str = "none",
    starts: int | None = None,
    seed: int = 0,
    direct_inverse: bool = False,
    tau: tuple[float, ...] | None = None,
    exponents: tuple[float, ...] | None = None,
    knots: int | None = None,
    ridge: float | Literal["auto"] | None = None,
    earlier: bool = False,
    least_slope: float | None = None,
) -> FitSettings:
    """Return the settings of a model by its name.

    Parameters
    ----------
    model : {"preisach", "preisach-hats"}
        The thesis' modal densities, or hat functions, which follow rich measurements more closely.
    modes, relaxations : int
        M (modal densities only) and P.
    extension : {"none", "falling", "gain", "reversing"}
        What is added to the thesis' relaxation. ``falling``: falling strain excites it too, little enough that the exact
        inverse exists. ``gain``: rising strain changes how much the output answers to strain. ``reversing``: all these with
        either sign, so that the output may reverse under steady strain. The last two come with a direct inverse, fixed
        kernels and eta = 1.
    starts, seed : int
        How many starts, and their seed. None for 2, or 1 where the output is linear in all that is fitted.
    direct_inverse : bool
        Whether to fit the way from output to strain as well, for the compensator to use.
    tau, exponents : tuple of float or None
        Times [s] and exponents c [1] of the P kernels, which are then fixed; None to fit them.
    knots : int or None
        Knots of the hat functions along each axis (preisach-hats only); None for 9, which rich records determine.
    ridge : float, "auto" or None
        How small densities and relaxation are preferred to be; "auto" to choose it by predicting the later parts of the
        training stretch; None for the value of the model.
    earlier : bool
        Whether relaxation from before a record may still be under way when it begins.
    least_slope : float or None
        Lower bound of mu on the elastic line, in units of the output's range: noise on the resistance is amplified by no
        more than its inverse. None for 0.02.

    Raises
    ------
    ParameterError
        No such model or extension, or a choice that it does not have.
    """
    for name, known in ((model, MODELS), (extension, EXTENSIONS)):
        if name not in known:
            msg = f"there is no {name!r}; it is one of {', '.join(known)}"
            raise ParameterError(msg)
    if knots is not None and model != "preisach-hats":
        msg = f"{model} has no knots. Choose its modes, or the model preisach-hats."
        raise ParameterError(msg)
    if extension != "none" and relaxations < 1:
        msg = f"the extension {extension} adds to the relaxation, of which there is none. Take 1 relaxation or more."
        raise ParameterError(msg)
    if extension in ("gain", "reversing") and (tau is not None or exponents is not None):
        msg = f"the extension {extension} has fixed kernels of its own. Leave tau and exponents out, or choose another one."
        raise ParameterError(msg)
    common: dict[str, Any] = {"modes": modes, "relaxations": relaxations, "seed": seed}
    common |= {"direct_inverse": direct_inverse, "tau": tau, "exponents": exponents, "earlier": earlier}
    if model == "preisach-hats":
        common |= {"density": "hats", "n_knots": 9, "ridge": 3e-3}
    common["drives"] = {
        "none": DRIVES[:2],
        "falling": DRIVES,
        "gain": (*DRIVES[:2], GAIN),
        "reversing": (*DRIVES, GAIN),
    }[extension]
    if extension in ("gain", "reversing"):
        common |= {
            "invertible": False,
            "eta": (1.0, 1.0),
            "fit_kernels": False,
            "ridge": 3e-3,
            "relaxation_ridge": 3e-3,
        }
    if extension == "reversing":
        common |= {"signed": True, "n_knots": 6, "ridge": 5e-5, "smoothness": 5e-5, "relaxation_ridge": 5e-5}
    if knots is not None:
        common["n_knots"] = knots
    if least_slope is not None:
        common["least_spring"] = least_slope
    if ridge == "auto":
        common["auto_ridge"] = True
    elif ridge is not None:
        common |= {"ridge": ridge, "relaxation_ridge": ridge}
    if starts is None:
        starts = 1 if extension in ("gain", "reversing") else 2
    return FitSettings(starts=starts, **common)


def training_rows(record: Record, train: str) -> NDArray[np.bool_]:
    """Return which samples to fit.

    Parameters
    ----------
    record : Record
        Times from zero.
    train : str
        ``A:B`` for times from A to B [s], either of which may be missing, or ``P%`` for the leading part of the samples.

    Raises
    ------
    DataError
        The text is neither, or no sample lies there.
    """
    try:
        if train.endswith("%"):
            share = 0.01 * float(train[:-1])
            if not 0.0 < share <= 1.0:
                raise ValueError
            rows = np.arange(record.time.size) < round(share * record.time.size)
        else:
            low, high = (float(part) if part.strip() else None for part in train.split(":"))
            rows = np.ones(record.time.size, dtype=bool)
            rows &= record.time >= (0.0 if low is None else low)
            rows &= record.time <= (np.inf if high is None else high)
    except ValueError:
        msg = f"cannot read {train!r} as a training stretch. Write 0:200 for seconds or 50% for a leading part, up to 100%."
        raise DataError(msg) from None
    if not rows.any():
        msg = f"{record.name} runs from 0 to {record.time[-1]:g} s: no sample lies in {train!r}. Name another stretch."
        raise DataError(msg)
    return rows


def identify_files(
    paths: Sequence[Path],
    *,
    columns: Columns | None = None,
    weights: Sequence[float] | None = None,
    train: str = "50%",
    settings: FitSettings | FractionalChoice | None = None,
    full_scale: float | None = None,
    rest_output: float | None = None,
    command: str = "",
    origin: str = "not stated",
    progress: Callable[[str], None] = lambda _: None,
) -> Identified:
    """Fit a sensor to the records in some files.

    Parameters
    ----------
    paths : sequence of Path
        CSV files, one record each.
    columns : Columns or None
        Which columns, in which units.
    weights : sequence of float or None
        Of the squared errors of each record [1]; None for 1.
    train : str
        Training stretch of every record, see ``training_rows``.
    settings : FitSettings, FractionalChoice or None
        Which model and how to fit it, see ``choose``; None for the thesis' Preisach model.
    full_scale : float or None
        Strain [1] at the end of the range.
    rest_output : float or None
        Output of the unstrained sensor at rest, where it is known.
    command, origin : str
        For the provenance of the artifact.
    progress : callable
        Told how far the fit is.

    Returns
    -------
    Identified
        Fit and errors; the artifact carries its provenance.
    """
    settings = settings or FitSettings()
    records = read_records(paths, columns, weights)
    rows = tuple(training_rows(record, train) for record in records)
    given: dict[str, Any] = {"full_scale": full_scale, "rest_output": rest_output}
    fit: Fit | FractionalFit
    if isinstance(settings, FractionalChoice):
        fit, predicted, doubted = fit_fractional(records, rows, settings, progress=progress, **given)
        rest, stated = fit.artifact.rest_resistance, {"settings": repr(settings)}
    else:

        def watch(start: str, iteration: int, error: float) -> None:
            progress(f"{start}, step {iteration}: error {error:.3f} % of range")

        fit = fit_preisach(records, rows, settings, watch=watch, **given)
        predicted, doubted, rest = fit.predicted, doubts(fit, records), fit.offset
        if settings.auto_ridge:
            chosen = f"The ridge {fit.settings.ridge:g} predicts the later parts of the training stretch best."
            doubted = (chosen, *doubted)
        stated = {
            "settings": repr(fit.settings),  # with the ridge chosen
            "full_scale_strain": repr(fit.full_scale),
            "offset": repr(fit.offset),
            "scale": repr(fit.scale),
        }
    found = stretch_errors(records, predicted, rows, rest)
    if isinstance(fit, Fit):
        progress("recovering the strain")
        found = with_strain_errors(found, fit, records)
    provenance = {
        "data": ", ".join(record.name for record in records),
        "origin": origin,
        "sha256": ", ".join(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths),
        "command": command,
        "train": train,
        **stated,
        **{f"{e.record} {e.stretch}": f"E1 {e.e1:.3f} %, NRMSE {e.nrmse:.3f} % of range" for e in found},
        "doubts": " ".join(doubted),
        **{f"repairs of {record.name}": "; ".join(record.repairs) for record in records if record.repairs},
    }
    repairs = tuple(f"{record.name}: {text}." for record in records for text in record.repairs)
    stored: Fit | FractionalFit
    if isinstance(fit, Fit):
        stored = with_provenance(fit, provenance)
    else:
        stored = replace(fit, artifact=replace(fit.artifact, provenance=provenance))
    return Identified(
        fit=stored,
        records=records,
        predicted=predicted,
        train=rows,
        rest=rest,
        errors=found,
        remarks=(*repairs, *doubted),
    )


def stretch_errors(
    records: tuple[Record, ...], predicted: tuple[Vector, ...], train: tuple[NDArray[np.bool_], ...], rest: float
) -> tuple[Errors, ...]:
    """Return the errors of a model on what it was fitted to and on the rest of every record."""
    found = []
    for record, output, rows in zip(records, predicted, train, strict=True):
        size = float(np.ptp(record.output))
        for stretch, part in (("train", rows), ("test", ~rows)):
            if part.any():
                found.append(errors(record.name, stretch, record.output[part], output[part], rest=rest, size=size))
    return tuple(found)


def with_strain_errors(found: tuple[Errors, ...], fit: Fit, records: tuple[Record, ...]) -> tuple[Errors, ...]:
    """Return errors with those of the strain that the compensator recovers from the measured output."""
    strains: dict[tuple[str, str], float] = {}
    for record, rows in zip(records, fit.train, strict=True):
        recovered, size = recover_strain(fit, record), float(np.ptp(record.strain))
        for stretch, part in (("train", rows), ("test", ~rows)):
            strains[record.name, stretch] = nrmse(record.strain[part], recovered[part], size)
    return tuple(replace(each, strain_nrmse=strains[each.record, each.stretch]) for each in found)
