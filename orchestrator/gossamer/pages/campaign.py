"""The page of a campaign: what was drawn, histories of strain, cases that failed, provenance."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files.charts import Array, Chart, band, bars, curve, section
from gossamer_models.campaign import Summary
from gossamer_orchestrator.pages import Page, folded, table

BAND_CASES = 400  # that a band is made of, at most
CURVES = 3  # cases with a curve of their own
BINS = 30
FAILED = 100  # rows of the table
SPREAD = (5.0, 50.0, 95.0)  # [%] of the band and of the line in it
HISTORIES = ("strain", "resistance", "compensated_strain")


def campaign_page(name: str, data: xr.Dataset, summary: Summary) -> Page:
    """Describe a campaign.

    Parameters
    ----------
    name : str
        Its title, or the name of its file.
    data : xarray.Dataset
        From ``read_campaign``.
    summary : Summary
        What this run of it did.
    """
    campaign = json.loads(data.attrs["campaign"])
    sound = data.isel(case=np.flatnonzero(~data["failed"].to_numpy()))
    failed = f"{summary.failed} of {summary.cases} cases failed; their histories are not a number."
    this_run = "All cases were there before this run."
    if summary.simulated:
        rate = summary.simulated / summary.seconds
        this_run = f"This run simulated {summary.simulated} of them in {summary.seconds:.1f} s, {rate:.3g} cases a second."
    steps, step, stop = round(campaign["stop"] / campaign["step"]), campaign["step"], campaign["stop"]
    histories = f"Histories of {steps} samples, {step:g} s apart, until {stop:g} s."
    return Page(
        title=f"Campaign: {name}",
        kind="invalid" if summary.failed else "none",
        sentence=failed if summary.failed else f"All {summary.cases} cases are simulated.",
        more=[this_run, _damage(campaign), _varied(campaign, data), histories],
        charts=[*section("What was drawn", [*_damage_charts(data), *_quantity_charts(data)]), *_history_charts(sound)],
        facts=[_failed_table(data), _about(data, campaign)],
        how="Histories are without gain and noise of the sensors, which the seed determines and the store does not hold.",
    )


def _damage(campaign: Mapping[str, Any]) -> str:
    damage = campaign["damage"]
    seed = f"Seed {campaign['seed']}, {campaign['sampling']} sampling"
    if damage["cases"]:
        return f"{seed}. Damages are a list of {len(damage['cases'])}."
    (fewest, most), (low, high) = damage["zones"], damage["depth"]
    healthy = f"; {100.0 * damage['healthy']:g} % of the cases are healthy" if damage["healthy"] else ""
    return f"{seed}. {fewest} to {most} zones lose {100.0 * low:g} to {100.0 * high:g} % of their stiffness{healthy}."


def _varied(campaign: Mapping[str, Any], data: xr.Dataset) -> str:
    parts = []
    for name, vary in campaign["vary"].items():
        low, high = vary["range"] or vary["factor"]
        unit = data[name].attrs.get("units", "1") if name in data.data_vars else "1"
        parts.append(f"{name} from {low:g} to {high:g} {unit}" if vary["range"] else f"{name} times {low:g} to {high:g}")
    return f"Varied: {', '.join(parts)}." if parts else "Load, material and sensors are the same in all cases."


def _damage_charts(data: xr.Dataset) -> list[Chart]:
    damage = data["damage"].to_numpy()
    there = damage > 0.0
    zones, per_case = np.arange(1, damage.shape[1] + 1), there.sum(axis=1)
    counts = np.bincount(per_case)
    whole = {"xaxis": {"dtick": 1}, "showlegend": False}
    number, by_zone = bars("cases", np.arange(len(counts)), counts), bars("cases", zones, there.sum(axis=0))
    charts = [
        Chart("Damaged zones of a case", "zones", "cases", [number], layout=whole),
        Chart("Cases with damage in a zone", "zone", "cases", [by_zone], layout=whole),
    ]
    if there.any():
        charts.append(_histogram("Damage of damaged zones", "damage [%]", 100.0 * damage[there], "damaged zones"))
    return charts


def _quantity_charts(data: xr.Dataset) -> list[Chart]:
    """Draw how each other quantity that differs from case to case is distributed."""
    charts = []
    for name in map(str, data.data_vars):
        values = data[name]
        if name in ("damage", "failed") or "time" in values.dims or not np.ptp(values.to_numpy()):
            continue
        x = f"{name} [{values.attrs.get('units', '1')}]"
        charts.append(_histogram(values.attrs.get("long_name", name), x, values.to_numpy().ravel(), "cases"))
    return charts


def _histogram(title: str, x: str, values: Array, what: str) -> Chart:
    counts, edges = np.histogram(values, BINS)
    traces = [bars(what, (edges[1:] + edges[:-1]) / 2.0, counts)]
    return Chart(title, x, what, traces, layout={"bargap": 0.03, "showlegend": False})


def _history_charts(data: xr.Dataset) -> list[Chart]:
    """Draw where most cases lie over time, and a few of them, for each sensor."""
    charts, count = [], data.sizes["case"]
    if not count:
        return []
    some = np.unique(np.linspace(0, count - 1, min(count, BAND_CASES)).round().astype(int))
    few = np.unique(np.linspace(0, len(some) - 1, min(len(some), CURVES)).round().astype(int))
    time, numbers = data["time"].to_numpy(), data["case"].to_numpy()[some]
    for name in (name for name in HISTORIES if name in data):
        values, unit = data[name].isel(case=some).to_numpy().astype(float), data[name].attrs["units"]
        factor, unit = (100.0, "%") if unit == "1" else (1.0, unit)
        low, middle, high = factor * np.percentile(values, SPREAD, axis=0)
        for sensor in range(values.shape[1]):
            traces = [*band("5 to 95 % of the cases", time, low[sensor], high[sensor], "@grey")]
            traces.append(curve("median", time, middle[sensor], "@ink", width=1))
            traces += [
                curve(f"case {numbers[k]}", time, factor * values[k, sensor], f"@{color}", width=1)
                for color, k in enumerate(few)
            ]
            quantity, note = name.replace("_", " "), f"Band and median of {len(some)} of {count} cases, evenly chosen."
            chart = Chart(f"Sensor {sensor + 1}", "time [s]", f"{quantity} [{unit}]", traces, note=note, linked="time")
            charts += section(f"{quantity.capitalize()} over time", [chart])
    return charts


def _failed_table(data: xr.Dataset) -> str:
    """Return what was drawn for the cases that failed."""
    failed = np.flatnonzero(data["failed"].to_numpy())
    if not failed.size:
        return ""
    names = [str(name) for name, each in data.data_vars.items() if each.dims == ("case",) and name != "failed"]
    rows: list[Sequence[object]] = []
    for k in failed[:FAILED]:
        case = data.isel(case=int(k))
        damage = case["damage"].to_numpy()
        zones = ", ".join(f"{z + 1}: {100.0 * damage[z]:.1f} %" for z in np.flatnonzero(damage))
        rows.append((int(case["case"]), zones or "none", *(f"{float(case[name]):.6g}" for name in names)))
    some = f", the first {FAILED}" if failed.size > FAILED else ""
    advice = (
        "<p>A case fails when its simulation leaves the finite numbers. The store does not say when; simulate the case "
        "alone to see it.</p>"
    )
    return table(("case", "damage by zone", *names), rows, f"Cases that failed{some}") + advice


def _about(data: xr.Dataset, campaign: Mapping[str, Any]) -> str:
    identity, versions = data.attrs["identity"], data.attrs["versions"]
    rows = [
        ("Cases", data.sizes["case"]),
        ("Seed", campaign["seed"]),
        ("Digest of the campaign", data.attrs["sha256"]),
        ("Gossamer", identity["gossamer"]),
        ("Simulated by", identity["kernels"]),
        ("Versions", ", ".join(f"{name} {number}" for name, number in versions.items())),
    ]
    keys = [(name, value) for name, value in identity.items() if not name.startswith("model.")]
    models = [(name.removeprefix("model."), value) for name, value in identity.items() if name.startswith("model.")]
    parts = (("All keys", keys, "Keys of the campaign"), ("Models", models, "Digests of the models"))
    return table((), rows, "The campaign") + "".join(folded(name, table((), each, what)) for name, each, what in parts)
