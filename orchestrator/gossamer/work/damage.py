"""Find damage in records, and make and judge what finds it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from gossamer_orchestrator.results.places import zone_places
from rich.console import Console

from ..results.damage import Campaign, DetectorAssessment, SensorPlacement, TrainedDetector, TwinAnswer, Watching

RATIO = {"units": "1"}
PERCENT = ("all_zones", "damaged_zones", "error_all", "error_damaged")  # the others are ratios


def twin(record: Path, **options: Any) -> TwinAnswer:  # noqa: ANN401
    """Fit a simulation to a record."""
    from gossamer_orchestrator.cli.twin import fit_twin

    answer, path, pages, compared = fit_twin(record, **options)
    values = {name: ("zone", getattr(answer, name), RATIO) for name in ("damage", "deviation", "probability")}
    data = xr.Dataset(
        values | {"covariance": (("zone", "other_zone"), answer.covariance, RATIO)},
        coords=_zones(answer.damage.size) | {"other_zone": np.arange(1, answer.damage.size + 1)},
        attrs={"valid": int(answer.valid), "chi2_per_sample": answer.chi2_per_sample, "chi2_bound": answer.chi2_bound},
    )
    return TwinAnswer(path=path, page=next(iter(pages), None), answer=answer, compared=compared, data=data)


def watch(record: Path, **options: Any) -> Watching:  # noqa: ANN401
    """Watch a record as if it arrived live."""
    from gossamer_models.membrane import square_structure
    from gossamer_orchestrator.cli.watch import watch_given

    report, path = watch_given(record, console=Console(quiet=True), **options)
    found = report.findings
    by_zone = {name: np.array([getattr(each, name) for each in found]) for name in ("damage", "deviation")}
    seconds, zones = {"units": "s"}, square_structure().n_zones
    data = xr.Dataset(
        {"score": ("time", report.scores, RATIO), "misfit": ("time", report.misfits, RATIO)}
        | {name: (("onset", "zone"), each.reshape(len(found), zones), RATIO) for name, each in by_zone.items()}
        | {"onset_deviation": ("onset", [each.onset_deviation for each in found], seconds)},
        coords=_zones(zones)
        | {"time": ("time", report.times, seconds), "onset": ("onset", [each.onset for each in found], seconds)},
    )
    return Watching(path=path, report=report, data=data)


def campaign(campaign: str, **options: Any) -> Campaign:  # noqa: ANN401
    """Simulate the cases of a campaign."""
    from gossamer_models.campaign import read_campaign
    from gossamer_orchestrator.cli.campaign import campaign_given

    summary, folder, title, pages = campaign_given(campaign, **options)
    page = next(iter(pages), None)
    return Campaign(folder=folder, page=page, title=title, summary=summary, data=read_campaign(folder))


def train(source: str | None, **options: Any) -> TrainedDetector:  # noqa: ANN401
    """Train a detector on simulated damage."""
    from gossamer_orchestrator.cli.train import train_given

    artifact, path, rows, pages = train_given(source, **options)
    data = _by(("cases",), (((kind,), row) for kind, row in rows.items()))
    return TrainedDetector(path=path, page=next(iter(pages), None), artifact=artifact, held_out=rows, data=data)


def assess_detector(artifact: list[Path] | None, **options: Any) -> DetectorAssessment:  # noqa: ANN401
    """Judge detectors under many conditions."""
    from gossamer_orchestrator.cli.assess_detector import assess_given

    found, files = assess_given(artifact, **options)
    data = _by(("detector", "condition"), (((row.judge, row.condition), _figures(row.figures)) for row in found.rows))
    names = ("a50", "a90", "a90_95", "threshold")
    detections = _by(
        ("detector", "condition", "zone"),
        (
            (
                (row.judge, row.condition, row.zone),
                {name: getattr(row, name) for name in names} | {"false_calls": row.false_calls.value},
            )
            for row in found.detections
        ),
    )
    return DetectorAssessment(result=found, data=data, detections=detections, files=files)


def place_sensors(setup: Path | None, **options: Any) -> SensorPlacement:  # noqa: ANN401
    """Choose where strain sensors let damage be found best."""
    from gossamer_orchestrator.cli.place_sensors import place_given

    found, files = place_given(setup, **options)
    placements = {name: each for name in ("own", "chosen") if (each := getattr(found, name)) is not None}
    groups = [zone.group for zone in found.structure.setup.zones]
    sensors = found.chosen.sensors
    names, metres = ("a90", "deviation"), {"units": "m"}
    data = xr.Dataset(
        {name: (("placement", "zone"), [getattr(each, name) for each in placements.values()], RATIO) for name in names}
        | {
            "point": (("sensor", "axis"), [each.point for each in sensors], metres),
            "direction": (("sensor", "axis"), [each.direction for each in sensors], RATIO),
        },
        coords={
            "placement": list(placements),
            "zone": np.arange(1, len(groups) + 1),
            "group": ("zone", groups),
            "sensor": np.arange(1, len(sensors) + 1),
            "axis": list("xyz"),
        },
        attrs={"noise": found.noise, "samples": round(options["stop"] / options["step"])},
    )
    return SensorPlacement(
        path=next(each for each in files if each.suffix == ".toml"), result=found, data=data, files=files
    )


def _zones(count: int) -> dict[str, Any]:
    """Return the coordinates of the zones of a square membrane with sides of length 1."""
    return zone_places(math.isqrt(count), 1.0, RATIO) | {"zone": np.arange(1, count + 1)}


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


def _by(dims: tuple[str, ...], rows: Iterable[tuple[tuple[Any, ...], Mapping[str, float]]]) -> xr.Dataset:
    """Return rows of values by name along their keys, in the order of the rows; not a number where there is none."""
    listed = list(rows)
    labels = {dim: list(dict.fromkeys(key[k] for key, _ in listed)) for k, dim in enumerate(dims)}
    arrays: dict[str, Any] = {}
    for key, values in listed:
        place = tuple(labels[dim].index(label) for dim, label in zip(dims, key, strict=True))
        for name, value in values.items():
            empty = np.full([len(each) for each in labels.values()], math.nan)
            arrays.setdefault(name.replace(" ", "_"), empty)[place] = value
    units = {name: {"units": "%" if name in PERCENT else "1"} for name in arrays}
    return xr.Dataset({name: (dims, values, units[name]) for name, values in arrays.items()}, coords=labels)
