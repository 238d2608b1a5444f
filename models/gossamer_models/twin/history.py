"""Inspections of one structure over time: damage by date, what was withheld, and how fast it grows.

Symbols: ``d`` inspections, ``z`` zones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files import read_json

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError, require

MONTH = 365.25 / 12.0  # days
SURE = 3.0  # deviations from which on growth is told


@dataclass(frozen=True, kw_only=True)
class InspectionHistory:
    """Inspections in the order of their dates.

    Attributes
    ----------
    dates : tuple of date
        When they were made.
    zones : tuple of str
        Names.
    damage, deviation : ndarray, shape (d, z)
        Damage [1] with its deviation; not a number where it was withheld or is not determined.
    low, high : ndarray, shape (d, z)
        Bounds, 95 % [1]; not a number where they were withheld.
    valid : ndarray of bool, shape (d,)
        Which can be used.
    doubts : tuple of tuple of str
        Why not, and what else was said.
    faults : mapping of str to ndarray of shape (d, 2)
        Share of each fault [1] with its deviation; not a number where none was weighed.
    drift : mapping of str to ndarray of shape (d, 2)
        Gain of each sensor, or how far it is off its model [1], with its deviation.
    """

    dates: tuple[date, ...]
    zones: tuple[str, ...]
    damage: Matrix
    deviation: Matrix
    low: Matrix
    high: Matrix
    valid: Rows
    doubts: tuple[tuple[str, ...], ...]
    faults: Mapping[str, Matrix]
    drift: Mapping[str, Matrix]

    @classmethod
    def read(cls, folder: Path) -> InspectionHistory:
        """Read the answers of twins whose file names begin with their dates, such as ``2027-01-15.json``.

        Raises
        ------
        DataError
            There are none, one is no answer, or they are of different zones.
        """
        dated = dict[date, Path]()
        for path in sorted(folder.glob("*.json")):
            try:
                day = date.fromisoformat(path.stem[:10])
            except ValueError:
                continue
            require(
                day not in dated, f"{path.name} has the date of {dated.get(day, path).name}. Keep one of them.", DataError
            )
            dated[day] = path
        advice = "Write them with 'gossamer twin record.csv --out folder/2027-01-15.json'"
        require(dated, f"{folder} holds no answers whose names begin with a date. {advice}.", DataError)
        return cls.of({day: _content(dated[day]) for day in sorted(dated)})

    @classmethod
    def of(cls, answers: Mapping[date, Mapping[str, Any]]) -> InspectionHistory:
        """Gather answers as they were written, by date.

        Raises
        ------
        DataError
            They are of different zones.
        """
        days = sorted(answers)
        zones = tuple(answers[days[0]]["zones"])
        for day in days:
            text = f"the inspection of {day} has other zones than that of {days[0]}. Keep those of one structure in a folder"
            require(tuple(answers[day]["zones"]) == zones, f"{text}.", DataError)
        each = [answers[day] for day in days]
        shape, bounds = (len(days), len(zones)), np.full((len(days), len(zones), 2), np.nan)
        damage, deviation = np.full(shape, np.nan), np.full(shape, np.nan)
        for k, answer in enumerate(each):
            if answer["valid"] and answer["damage"] is not None:
                damage[k] = [math.nan if value is None else value for value in answer["damage"]]
                deviation[k], bounds[k] = answer["deviation"], answer["bounds"]
        deviation[np.isnan(damage)] = np.nan
        return cls(
            dates=tuple(days),
            zones=zones,
            damage=damage,
            deviation=deviation,
            low=bounds[..., 0],
            high=bounds[..., 1],
            valid=np.array([bool(answer["valid"]) for answer in each]),
            doubts=tuple(tuple(answer["doubts"]) for answer in each),
            faults=_gathered([_faults(answer) for answer in each]),
            drift=_gathered([_drift(answer) for answer in each]),
        )

    @property
    def months(self) -> Vector:
        """Months since the first inspection, shape (d,)."""
        return np.array([(day - self.dates[0]).days / MONTH for day in self.dates])

    @property
    def growth(self) -> Matrix:
        """Growth of each zone [1/month] with its deviation, shape (z, 2); not a number with fewer than two values.

        Weighted least squares of a line; inspections that build on each other share what they know, so that the deviation
        is rather too large.
        """
        found = np.full((len(self.zones), 2), np.nan)
        for k, (values, sigma) in enumerate(zip(self.damage.T, self.deviation.T, strict=True)):
            there = np.isfinite(values)
            if there.sum() < 2:
                continue
            t, w = self.months[there], np.maximum(sigma[there], 1e-9) ** -2.0
            away = t - np.average(t, weights=w)
            found[k] = np.sum(w * away * values[there]) / np.sum(w * away**2), np.sum(w * away**2) ** -0.5
        return found

    def sentences(self) -> list[str]:
        """Say which zones and faults are there, and which zones grow."""
        said = []
        for name, values, (rate, sigma) in zip(self.zones, self.damage.T, self.growth, strict=True):
            if rate > SURE * sigma:
                text = f"{name} grows by {100.0 * rate:.2g} ± {100.0 * sigma:.1g} points a month"
                last = values[np.isfinite(values)][-1]
                said.append(f"{text}, to {100.0 * last:.3g} % at the last inspection")
        for name, found in self.faults.items():
            if np.isfinite(found[-1, 0]) and found[-1, 0] > 0.0:
                said.append(f"{name} by {100.0 * found[-1, 0]:.2g} ± {100.0 * found[-1, 1]:.1g} % at the last inspection")
        return said


def _content(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = read_json(path)
        missing = {"zones", "damage", "deviation", "bounds", "valid", "doubts"} - content.keys()
    except (OSError, ValueError, AttributeError) as error:
        msg = f"{path} is no answer of a twin: {error}. Write one with 'gossamer twin', or take it out of the folder."
        raise DataError(msg) from error
    msg = f"{path} is no answer of a twin: it lacks {', '.join(sorted(missing))}. Take it out of the folder."
    require(not missing, msg, DataError)
    return content


def _faults(answer: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    return {each["name"]: (each["share"], each["deviation"]) for each in answer.get("faults") or ()}


def _drift(answer: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    gains = {
        f"gain of sensor {name[5:-1]}": tuple(value) for name, value in answer["nuisances"].items() if name[:5] == "gain["
    }
    off = {
        f"sensor {k} off its model": (share, 0.0)
        for k, share in enumerate(answer.get("sensor_errors") or (), 1)
        if share is not None
    }
    return gains | off


def _gathered(rows: list[dict[str, tuple[float, float]]]) -> dict[str, Matrix]:
    """Return pairs by name, shape (d, 2); not a number where there was none."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, (math.nan, math.nan)) for row in rows]) for name in names}
