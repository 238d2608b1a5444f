"""What the page of a sweep needs of each case; of histories, few are in memory at a time.

Symbols: ``n`` rows of a case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from gossamer_orchestrator.errors import ResultsError
from gossamer_orchestrator.results.dataset import find_all
from gossamer_orchestrator.results.files import load_results
from gossamer_orchestrator.results.judgements import Judgement, windows
from gossamer_orchestrator.run.sweep import Case, is_finished
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """The scalar that a page draws.

    Attributes
    ----------
    variable : str
        What recorded it.
    element : int or None
        Which element of the variable, from 0; None if it is a scalar.
    unit : str
        As it was recorded.
    """

    variable: str
    element: int | None
    unit: str

    @property
    def text(self) -> str:
        """Name, with the unit in brackets."""
        index = "" if self.element is None else f"[{self.element + 1}]"
        return f"{self.variable}{index} [{self.unit}]"

    def of(self, data: xr.Dataset) -> Array:
        """Return its values, shape (n,); empty if the case did not record it."""
        if self.variable not in data.data_vars:
            return np.zeros(0)
        table = data[self.variable].to_numpy().reshape(data.sizes["time"], -1)
        return np.asarray(table[:, self.element or 0], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Ended:
    """A case, how it ended, and what it recorded.

    Attributes
    ----------
    case : Case
        Number and values.
    text : str
        The attribute ``ended`` of its results, or what the run said.
    detector : bool
        Whether it has a detector.
    judgement : Judgement or None
        The last valid one; None without any.
    numbers : dict of str to float
        Last value, largest size and RMS of the scalar that is drawn; empty if there is none.
    """

    case: Case
    text: str
    detector: bool = False
    judgement: Judgement | None = None
    numbers: dict[str, float]

    @property
    def finished(self) -> bool:
        """Whether it came to its end."""
        return is_finished(self.text)


def read_cases(
    cases: Sequence[Case], texts: Sequence[str], folder: Path, variable: str | None
) -> tuple[list[Ended], Drawn | None]:
    """Read all cases, one after the other.

    Parameters
    ----------
    cases, texts : sequence of Case and of str
        All cases, and how each ended.
    folder : Path
        Folder of the sweep.
    variable : str or None
        Variable to draw, of an array the element that is largest in the first case; None for the first scalar that changes.

    Returns
    -------
    list of Ended, and Drawn or None
        The cases, and what is drawn; None if no case recorded a scalar.
    """
    ended, what = [], None
    for case, text in zip(cases, texts, strict=True):
        try:
            with load_results(folder / case.name) as data:
                what = what or _choose(data, variable)
                detector = bool(find_all(data, "detector"))
                ended.append(
                    Ended(
                        case=case,
                        text=text,
                        detector=detector,
                        judgement=_last_valid(data) if detector else None,
                        numbers={} if what is None else _numbers(what.of(data)),
                    )
                )
        except ResultsError:  # the text says why there are none
            ended.append(Ended(case=case, text=text, numbers={}))
    return ended, what


def read_history(ended: Ended, what: Drawn, folder: Path) -> tuple[Array, Array]:
    """Return times [s] and values of what is drawn of a case, shape (n,)."""
    with load_results(folder / ended.case.name) as data:
        return data["time"].to_numpy(), what.of(data)


def _choose(data: xr.Dataset, variable: str | None) -> Drawn | None:
    over_time = {
        str(name): each
        for name, each in data.data_vars.items()
        if each.dims[:1] == ("time",) and each.size and each.dtype.kind in "fiub"  # numbers and truth values
    }
    if variable is None:
        scalars = [name for name, each in over_time.items() if each.ndim == 1]
        changing = (name for name in scalars if np.ptp(data[name].to_numpy().astype(float)) > 0.0)
        variable = next(changing, scalars[0] if scalars else None)
    if variable not in over_time:
        return None
    values = over_time[variable]
    table = np.abs(values.to_numpy().astype(float).reshape(values.shape[0], -1))
    element = None if values.ndim == 1 else int(np.nan_to_num(table).max(axis=0).argmax())
    return Drawn(variable=variable, element=element, unit=str(values.attrs.get("units", "1")))


def _numbers(values: Array) -> dict[str, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return {}
    return {"last": float(known[-1]), "largest": float(np.abs(known).max()), "RMS": float(np.sqrt(np.mean(known**2)))}


def _last_valid(data: xr.Dataset) -> Judgement | None:
    try:
        return next((window for window in reversed(windows(data)) if window.valid), None)
    except ResultsError:
        return None  # damage was not recorded
