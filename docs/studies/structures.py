"""The twin of other structures than the square, measured against what was asked.

``python -m studies.structures [CASES] [ROW ...]`` from the folder ``docs`` prints a table; rows by name, all by default, and
the first line says which there are. Random cases have 1 to 3 damaged zones of 5 to 50 %; strain has white noise of 1e-4 a
sample, resistance of 0.1 % of its change at full scale; offsets are unknown. Records of motion have 400 samples, the sail
has 8 states of 10 readings. ``*_finer`` are records of a mesh of four times the elements, which the twin does not know,
``*_healthy`` those less a healthy record of that mesh. ``*_24`` have 24 zones and 16 sensors, chosen by place-sensors.
``tube_strain`` has as much noise of strain as that of ``tube_resistance`` is, by the swings of both at each sensor.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from gossamer_models.membrane import Structure, Zone, make_structure
from gossamer_models.placement import place_sensors
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import Answer, LoadTable, MembraneForward, MeshErrors, ResponseRecord, StaticRecord, Twin
from gossamer_models.twin.simulation import SensedForward
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAMPLES, READINGS = 400, 10
NOISE = 1e-4  # of strain, a sample [1]
STEP = 2.4e-4  # [s]
RESISTANCE_NOISE = 1e-3  # of the change of resistance at full scale
QUIET = {"pressure_amplitude": 0.0}
TUBE = {"base_acceleration[2]": (40.0, 25.0), "base_acceleration[3]": (40.0, 40.0), "base_acceleration[1]": (20.0, 60.0)}


def shipped(name: str) -> Structure:
    """Return the structure of a setup that ships."""
    from gossamer.descriptions import load_structure

    return load_structure(Path(__file__).parents[2] / "orchestrator" / "membranes" / f"{name}.toml", None)


@dataclass(frozen=True)
class Row:
    """One line of the table: the structure of the twin, that of the record, the load, what was asked."""

    asked: str
    structure: Callable[[], Structure]
    step: float = 0.0  # [s]; 0 for states
    load: Callable[[Array], Mapping[str, Array]] = lambda _: {}  # inputs at times [s], or in states
    parameters: Mapping[str, float] = field(default_factory=dict)
    finer: bool = False  # whether the record is of a mesh of four times the elements
    healthy: bool = False  # whether a healthy record of the structure is taken from it
    read: Literal["strain", "resistance", "as by resistance"] = "strain"  # of sensors with hysteresis; or with their noise


def shaken(time: Array) -> dict[str, Array]:
    """Shake the base of the tube along three axes."""
    return {name: a * np.sin(2.0 * np.pi * f * time) for name, (a, f) in TUBE.items()}


def pulled(_: Array) -> dict[str, Array]:
    """Pull the sail taut and press on it, in eight states."""
    tension, pressure = np.meshgrid([0.9, 1.2], [0.1, 0.3, 0.6, 1.0])
    return {"boom_x": tension.ravel(), "boom_y": tension.ravel(), "pressure": pressure.ravel()}


def divided(name: str, sensors: int, other: Callable[[Zone], Zone]) -> Structure:
    """Return a shipped structure with other zones, and with sensors that are chosen for them."""
    structure = shipped(name)
    setup = replace(structure.setup, zones=(other(structure.setup.zones[0]),))
    structure = make_structure(setup, structure.mesh)
    load, table = ({}, None) if name == "reflector" else (QUIET, table_of(shaken))
    chosen = place_sensors(structure, load, sensors, loads=table, noise=NOISE).chosen.sensors
    return make_structure(replace(setup, sensors=chosen), structure.mesh)


def table_of(load: Callable[[Array], Mapping[str, Array]]) -> LoadTable:
    """Return the loads of a record as a table that place-sensors takes."""
    time = STEP * np.arange(SAMPLES + 1.0)
    return LoadTable(values={name: tuple(values) for name, values in load(time).items()}, time=tuple(time))


def damages(count: int, zones: int, seed: int = 3) -> Array:
    """Draw damages, shape (count, zones)."""
    random = np.random.default_rng(seed)
    damage = np.zeros((count, zones))
    for k, row in enumerate(damage):
        some = random.choice(zones, 1 + k % 3, replace=False)
        row[some] = random.uniform(0.05, 0.5, some.size)
    return damage


def records(row: Row, structure: Structure, damage: Array) -> list[ResponseRecord]:
    """Simulate one record for each row of damages, shape (m, zones), of the structure of the truth."""
    random = np.random.default_rng(len(damage))
    forward = MembraneForward(structure.finer() if row.finer else structure, row.parameters)
    times = row.step * np.arange(1.0, SAMPLES + 1.0)
    load = {name: np.asarray(values) for name, values in row.load(times).items()}
    if row.step:
        read = forward.strain(damage, {}, load, SAMPLES, row.step)
        kind: Literal["strain", "resistance"] = "strain"
        noise = np.full(structure.n_sensors, NOISE)
        if row.read != "strain":
            sensed = SensedForward(forward, default_artifact())
            ohm, noise = sensed.resistance(read, row.step), RESISTANCE_NOISE * sensed.scale("resistance")[1][:, 0]
            if row.read == "resistance":
                read, kind = ohm, "resistance"
            else:
                noise = noise * np.ptp(read, axis=(0, 2)) / np.ptp(ohm, axis=(0, 2))
        noisy = read + noise[:, None] * random.standard_normal(read.shape)
        return [ResponseRecord(step=row.step, values=y, noise=noise, inputs=load, kind=kind) for y in noisy]
    strain = np.repeat(forward.states(damage, {}, load), READINGS, axis=2)
    noisy = strain + NOISE * random.standard_normal(strain.shape)
    count = strain.shape[2] // READINGS
    state, names = np.repeat(np.arange(count), READINGS), tuple(str(k + 1) for k in range(count))
    return [StaticRecord(values=y, noise=NOISE, inputs=load, state=state, names=names) for y in noisy]


def measure(name: str, row: Row, count: int) -> str:
    """Return one line of the table."""
    structure = row.structure()
    damage = damages(count, structure.n_zones)
    made = records(row, structure, damage)
    twin = Twin(
        structure,
        parameters=row.parameters,
        mesh_error=MeshErrors(structure, row.parameters) if row.finer else None,
        healthy=records(row, structure, np.zeros((1, structure.n_zones)))[0] if row.healthy else None,
        sensor=default_artifact() if row.read == "resistance" else None,
    )
    answers, begun = list[Answer](), time.process_time()
    for record in made:
        answers.append(twin.fit(record))
    seconds = (time.process_time() - begun) / count
    found = np.array([a.damage for a in answers])
    deviation = np.array([a.deviation for a in answers])
    valid = np.array([a.valid for a in answers])
    error, kept, damaged = np.abs(found - damage), found > 0.0, damage > 0.0
    z = (error / np.maximum(deviation, 1e-12))[kept | (damaged & (deviation > 0.0))]
    wrong = valid[:, None] & (error > 0.05) & (error > 3.0 * deviation)
    told = np.array([a.determined for a in answers])
    low, high = np.moveaxis(np.array([a.bounds for a in answers]), 2, 0)
    within = ((low - 1e-12 <= damage) & (damage <= high + 1e-12))[valid]
    missed = damaged & ~kept & (damage > 2.0 * deviation)
    swing = np.mean([np.ptp(record.values) for record in made])
    return (
        f"| {name} | {structure.n_zones}, {structure.n_sensors} | {row.asked} | {100 * error.mean():.2f} / "
        f"{100 * error[damaged].mean():.2f} | {100 * error.max():.1f} | {np.sqrt(np.mean(z**2)):.2f} | {missed.sum()} / "
        f"{(kept & ~damaged).sum()} | {valid.sum()} of {count} | {(wrong & told).any(axis=1).sum()}, "
        f"{wrong.any(axis=1).sum()} | {100 * within.mean():.1f}, {100 * within[damaged[valid]].mean():.0f} | "
        f"{seconds:.1f} | {swing:.2g} |"
    )


HEAD = (
    "| record | zones, sensors | asked: error all / damaged [%] | all / damaged [%] | largest [%] | rms z | missed / false |"
    " valid | wrong and valid: determined, any | within the 95 % bounds, all, damaged zones [%] | CPU a fit [s] | swing of"
    " strain [1] |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)
ROWS = {
    "dish": Row("0.2 / 1", lambda: shipped("reflector"), STEP),
    "tube": Row("0.2 / 1", lambda: shipped("tube"), STEP, shaken, QUIET),
    "sail": Row("0.6 / 4", lambda: shipped("sail"), 0.0, pulled),
    "dish_finer": Row("1 / 3", lambda: shipped("reflector"), STEP, finer=True),
    "dish_healthy": Row("1 / 3", lambda: shipped("reflector"), STEP, finer=True, healthy=True),
    "dish_24": Row(
        "0.5 / 3",
        lambda: divided("reflector", 16, lambda z: replace(z, rings=(0.2, 0.5, 0.75), sectors=(1, 5, 8, 10))),
        STEP,
    ),
    "tube_24": Row("0.5 / 3", lambda: divided("tube", 16, lambda z: replace(z, sectors=4, slices=6)), STEP, shaken, QUIET),
    "tube_resistance": Row("2 x tube_strain", lambda: shipped("tube"), STEP, shaken, QUIET, read="resistance"),
    "tube_strain": Row("", lambda: shipped("tube"), STEP, shaken, QUIET, read="as by resistance"),
}


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    wanted = sys.argv[2:] or ROWS
    print(f"rows: {', '.join(ROWS)}; {count} records each\n\n{HEAD}", flush=True)
    for name in wanted:
        print(measure(name, ROWS[name], count), flush=True)


if __name__ == "__main__":
    main()
