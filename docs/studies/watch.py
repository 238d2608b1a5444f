"""The watch: what it sees, how soon, and how often it is wrong.

``python -m studies.watch [RECORDS] [WORLD ...]`` from the folder ``docs`` prints a line for each world, or some. Records
last 24 first periods of the structure, a window for each period, and begin undamaged; after 12 windows one zone is
damaged at once or in a ramp, so deeply as the world says. ``healthy, `` before any world leaves damage out and counts
alarms. An alarm counts if it comes after damage has begun. The square is bilinear; its records of resistance are those of
``sensor_error``: noise of 0.1 % of the range, sensors whose tables are perturbed until they read 5 % of their range wrong,
beside an offset.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from gossamer_models.membrane import Structure, square_structure
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import MembraneForward, Watch
from gossamer_models.twin.simulation import Place
from numpy.typing import NDArray

from .sensor_error import reader
from .structures import shipped
from .twin import BILINEAR

Array = NDArray[np.float64]
BEFORE, WINDOWS = 12, 24  # windows without damage, and in all
WRONG, EXPLAINED = 0.05, 3.0  # damage [1], and deviations, by which an answer may be off
HEALTHY = "healthy, "
THESIS = 5.8e-3  # deviation of the noise of strain


@dataclass(frozen=True)
class World:
    """Records of one kind.

    Attributes
    ----------
    depth : tuple of float
        Least and largest damage [1].
    noise : float
        Of strain, or as a share of the range of resistance [1].
    ramp : float
        Windows over which damage grows; 0 for a step.
    load, gain : float
        By how much the load is off, up or down, and the deviation of the gains of sensors [1].
    sensors : float or None
        How far sensors are off their model, as a share of their range [1]; None for records of strain.
    structure, truth : callable
        Give the structure of the watch, and that of the records if it is another one.
    step : float
        Sampling step [s].
    """

    depth: tuple[float, float]
    noise: float = 1e-3
    ramp: float = 0.0
    load: float = 0.0
    gain: float = 0.0
    sensors: float | None = None
    structure: Callable[[], Structure] = lambda: square_structure(*BILINEAR)
    truth: Callable[[], Structure] | None = None
    step: float = 3e-4


WORLDS = {
    "step": World((0.1, 0.1), THESIS),
    "ramp": World((0.2, 0.2), THESIS, ramp=6.0),
    "load": World((0.1, 0.1), load=0.03),
    "gains": World((0.1, 0.1), gain=0.05),
    "sensors": World((0.02, 0.02), load=0.03, sensors=0.05),
    "sensors, ramp": World((0.1, 0.1), load=0.03, sensors=0.05, ramp=6.0),
    "mesh": World((0.3, 0.3), THESIS, truth=lambda: square_structure(3 * BILINEAR[0], BILINEAR[1])),
    "order": World((0.1, 0.1), THESIS, structure=square_structure, truth=lambda: square_structure(4, 8)),
    "dish, finer": World(
        (0.2, 0.5),
        1e-4,
        load=0.03,
        structure=lambda: shipped("reflector"),
        truth=lambda: shipped("reflector").finer().finer(),
        step=2.5e-4,
    ),
    "drum": World((0.2, 0.5), 1e-4, load=0.03, structure=lambda: shipped("drum"), step=2.5e-4),
    "dish": World((0.2, 0.5), 1e-4, load=0.03, structure=lambda: shipped("reflector"), step=2.5e-4),
}


def judge(name: str, count: int) -> str:
    """Watch all records of a world; return its line."""
    world, healthy = WORLDS[name.removeprefix(HEALTHY)], name.startswith(HEALTHY)
    random, structure = np.random.default_rng(5), world.structure()
    forward = MembraneForward(structure if world.truth is None else world.truth())
    samples, zones, sensors = round(forward.period / world.step), structure.n_zones, structure.n_sensors
    late, missed, false, wrong, answers, shift, seconds = list[float](), 0, 0, 0, 0, list[float](), 0.0
    sees, untrue = list[float](), 0
    for k in range(count):
        zone, depth = random.integers(zones), 0.0 if healthy else random.uniform(*world.depth)
        onset = (BEFORE + random.uniform()) * samples * world.step
        amplitude = forward.parameters["pressure_amplitude"] * (1.0 + world.load * (-1.0) ** k)
        state, _ = forward.begin(np.zeros(zones), {"pressure_amplitude": amplitude})
        damage = np.zeros((2, samples * WINDOWS, zones))
        since = world.step * np.arange(1, samples * WINDOWS + 1) - onset
        share = np.clip(since / (world.ramp * samples * world.step), 0.0, 1.0) if world.ramp else since > 0.0
        damage[0, :, zone] = depth * share
        both = Place(state, None).take(np.zeros(2, dtype=int))
        strain = forward.advance(both.membrane, damage, {}, world.step)[0]
        if world.sensors is None:
            readings, noise = strain[0] * (1.0 + world.gain * random.standard_normal((sensors, 1))), world.noise
        else:
            at_rest = forward.begin(np.zeros(zones), {})[1]
            readings = reader(world.sensors, k, strain[1], at_rest)(strain)[0]
            noise = world.noise * float(np.ptp(readings, axis=1).mean())
        readings = readings + noise * random.standard_normal(readings.shape)
        watch = Watch(noise, structure, sensor=None if world.sensors is None else default_artifact(), step=world.step)
        begin = time.process_time()
        judged = [watch.advance(part) for part in np.split(readings, WINDOWS, axis=1)]
        seconds += time.process_time() - begin
        alarms = [window.time for window in judged if window.alarm]
        false += sum(healthy or moment < onset for moment in alarms)
        after = [moment - onset for moment in alarms if moment > onset]
        missed += not after
        known = np.median([window.sees for window in judged[1:BEFORE]], axis=0)
        untrue += not after and depth > known[zone]
        sees.append(float(known.max()))
        late += after[:1]
        findings = [window.finding for window in judged if window.finding and window.finding.valid]
        for found in findings if not world.ramp else ():  # of a ramp no answer is known
            off = np.abs(found.damage - depth * np.eye(zones)[zone])
            answers += 1
            wrong += bool(((off > WRONG) & (off > EXPLAINED * found.deviation)).any())
            shift.append(abs(found.onset - onset) / (samples * world.step))
    line = f"{false} false alarms in {count * (WINDOWS if healthy else BEFORE)} healthy windows, "
    if not healthy:
        delay = f"{1e3 * float(np.median(late)):.0f}" if late else "-"
        line += f"{missed} of {count} missed ({untrue} that it says it sees), delay {delay} ms (median), "
        line += f"{wrong} of {answers} answers wrong, "
        line += f"onsets {100.0 * float(np.median(shift)):.2g} % of a period off, " if shift else ""
    line += f"sees {100.0 * float(np.median(sees)):.2g} % in every zone, "
    return line + f"{seconds / count / WINDOWS / forward.period:.1f} times as long as real time"


def main() -> None:
    """Print the lines."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    for name in sys.argv[2:] or [*WORLDS, *(HEALTHY + name for name in WORLDS)]:
        print(f"{name:24} {judge(name, count)}", flush=True)


if __name__ == "__main__":
    main()
