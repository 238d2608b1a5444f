"""The twin of the setups that ship, measured against what was asked of it.

``python -m studies.twin_of_setups [CASES] [NAME ...]`` from the folder ``docs`` prints a table. Random cases have 1 to 3
zones of 5 to 50 %; every sample, or reading of a load state, has white noise of 1e-4 of strain; offsets are unknown.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from gossamer.descriptions import load_structure
from gossamer_models.twin import MembraneForward, ResponseRecord, StaticRecord, Twin
from numpy.typing import NDArray

Array = NDArray[np.float64]
NOISE = 1e-4  # of strain
STEP, STEPS = 2.4e-4, 400
READINGS = 10  # of a load state
TIME = STEP * np.arange(1, STEPS + 1)
TENSION, PRESSURE = (values.ravel() for values in np.meshgrid([0.9, 1.2], [0.1, 0.3, 0.6, 1.0]))
MEMBRANES = Path(__file__).parents[2] / "orchestrator" / "membranes"


@dataclass(frozen=True)
class World:
    """Loads of a setup, and what was asked of its twin."""

    asked: str
    loads: dict[str, Array] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    static: bool = False


WORLDS = {
    "reflector": World("0.2 / 1, z 0.7 to 1.3, 10 s"),
    "tube": World(
        "0.2 / 1, z 0.7 to 1.3, 10 s",
        {
            "base_acceleration[1]": 20.0 * np.sin(2.0 * np.pi * 60.0 * TIME),
            "base_acceleration[2]": 40.0 * np.sin(2.0 * np.pi * 25.0 * TIME),
            "base_acceleration[3]": 40.0 * np.sin(2.0 * np.pi * 40.0 * TIME),
        },
        {"pressure_amplitude": 0.0},
    ),
    "sail": World("0.6 / 4, 10 s", {"boom_x": TENSION, "boom_y": TENSION, "pressure": PRESSURE}, static=True),
}


def cases(count: int, zones: int) -> Array:
    """Draw damages, shape (count, zones)."""
    random, found = np.random.default_rng(3), np.zeros((count, zones))
    for k, row in enumerate(found):
        damaged = random.choice(zones, 1 + k % 3, replace=False)
        row[damaged] = random.uniform(0.05, 0.5, damaged.size)
    return found


def measure(name: str, count: int) -> str:
    """Fit the records of a world; return a line of the table."""
    world, structure = WORLDS[name], load_structure(MEMBRANES / f"{name}.toml")
    forward = MembraneForward(structure, world.parameters)
    damage = cases(count, structure.n_zones)
    strain = (
        forward.states(damage, {}, world.loads)
        if world.static
        else forward.strain(damage, {}, world.loads, STEPS, STEP)
    )
    twin, errors, z, valid, seconds = Twin(forward), np.zeros_like(damage), [], 0, 0.0
    state = np.repeat(np.arange(strain.shape[-1]), READINGS if world.static else 1)
    for k, true in enumerate(damage):
        values = strain[k][:, state]
        values = values + NOISE * np.random.default_rng(100 + k).standard_normal(values.shape)
        record = (
            StaticRecord(
                values=values,
                noise=NOISE,
                inputs=world.loads,
                state=state,
                names=tuple(map(str, range(strain.shape[-1]))),
            )
            if world.static
            else ResponseRecord(step=STEP, values=values, noise=NOISE, inputs=world.loads)
        )
        begun = time.process_time()
        answer = twin.fit(record)
        seconds += time.process_time() - begun
        errors[k] = answer.damage - true
        kept = answer.damage > 0.0
        z.extend((errors[k] / answer.deviation)[kept])
        valid += answer.valid
    size = 100.0 * np.abs(errors)
    return (
        f"{name:10} {np.ptp(strain, axis=-1).max():.2g}  {size.mean():.2f} / {size[damage > 0.0].mean():.2f}  "
        f"{np.sqrt(np.mean(np.square(z))):.2f}  {valid:3} of {count:3}  {seconds / count:.1f} s   asked: {world.asked}"
    )


if __name__ == "__main__":
    wanted = sys.argv[2:] or list(WORLDS)
    print("setup; largest swing of strain; error [% damage], all / damaged zones; z rms; valid; CPU time a fit")
    for each in wanted:
        print(measure(each, int(sys.argv[1]) if len(sys.argv) > 1 else 24), flush=True)
