"""The twin of records of resistance whose sensors are off their identified model.

``python -m studies.sensor_error [RECORDS] [WORLD ...]`` from the folder ``docs`` prints a line for each world, or some:
sensors that keep to their model; tables of the sensors perturbed by smooth random fields until they read 1, 3 and 5 % of
their range (rms, beside an offset) wrong; the virtual specimen. Bilinear square, which the twin knows; 1 to 3 zones
of 5 to 50 %, 0.3 s, noise 0.1 % of the range. ``finer, SENSORS`` and ``finest, SENSORS`` are records of order 8 and 12, for
the default twin; ``off, `` before any world has 3 % less load and 1.3 times the damping that the twin is given. Nothing was
chosen by the worlds ``worn`` and ``finest``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import SensorArtifact, default_artifact
from gossamer_models.twin import Twin
from gossamer_models.twin.simulation import SensorBank
from numpy.typing import NDArray
from scipy.signal import lfilter

from .specimen.flight import calibrated_sensor, flown_resistance
from .twin import BILINEAR, FINER, FINEST, HEAD, STEP, cases, fitted, membrane, strain

Array = NDArray[np.float64]
NOISE = 1e-3  # of the mean range
LENGTH = 0.3  # of the tables' side, of a random field
LEVELS = {"exact": 0.0, "tables 1 %": 0.01, "tables 3 %": 0.03, "tables 5 %": 0.05}
TRUTH = {"finer, ": FINER, "finest, ": FINEST}  # meshes of records that the default twin meets
OFF = "off, "
LOAD = {"pressure_amplitude": 0.97e4, "mass_damping": 26.0}
WORN = "worn"


def perturbed(artifact: SensorArtifact, size: float, seed: int) -> SensorArtifact:
    """Return a sensor whose tables differ by smooth random fields, and whose relaxation differs, relative size [1]."""
    random, (mu, nu) = np.random.default_rng(seed), artifact.tables()
    x = (np.arange(len(mu)) + 0.5) / len(mu)
    K = np.exp(-0.5 * ((x[:, None] - x) / LENGTH) ** 2) + 1e-9 * np.eye(len(mu))
    L = np.linalg.cholesky(K)
    a, b = (L @ random.standard_normal(mu.shape) @ L.T for _ in range(2))
    relaxation = tuple(
        replace(
            term,
            amplitude=term.amplitude * np.exp(size * random.standard_normal()),
            decay_rates=tuple((np.array(term.decay_rates) * np.exp(size * random.standard_normal())).tolist()),
        )
        for term in artifact.relaxation
    )
    up, down = (
        tuple(map(tuple, np.triu(table * np.exp(size * field)).tolist()))
        for table, field in ((mu, a), (nu, 0.7 * a + 0.71 * b))
    )
    return replace(artifact, mu=up, nu=down, relaxation=relaxation, scales=None, provenance={})


def reader(level: float, seed: int, healthy: Array, rest: Array) -> Callable[[Array], Array]:
    """Return four sensors that read wrong by a share of their range, beside an offset: from strain to resistance."""
    own = SensorBank(default_artifact(), 4, rest)
    if level == 0.0:
        return lambda strain: own.read(strain, STEP)[0]
    known, random, banks = own.read(healthy[None], STEP)[0][0], np.random.default_rng(seed), []
    for k in range(4):
        size, field = 0.05, int(random.integers(1 << 30))
        for _ in range(4):
            bank = SensorBank(perturbed(default_artifact(), size, field), 4, rest, own.parameters)
            off = (bank.read(healthy[None], STEP)[0][0, k] - known[k]).std() / np.ptp(known[k])
            if abs(off / level - 1.0) < 0.1:
                break
            size *= level / off
        banks.append(bank)
    return lambda strain: np.stack([bank.read(strain, STEP)[0][:, k] for k, bank in enumerate(banks)], axis=1)


def worn(read: Array) -> Array:
    """Return what sensors read that have lost 4 % of their sensitivity where they were stretched most, and creep by 2 %."""
    moved = read - read[..., :1]
    lost = 0.04 * np.maximum.accumulate(np.abs(moved), axis=-1) / np.ptp(read, axis=-1, keepdims=True)
    decay = np.exp(-STEP / 0.05)
    return np.asarray(read - lost * moved + 0.02 * lfilter([1.0 - decay], [1.0, -decay], moved))


def judge(world: str, count: int) -> str:
    """Fit all records of a world; return its line."""
    damage, given = cases(count, seed=3, most=3), LOAD if world.startswith(OFF) else None
    mesh = next((name for name in TRUTH if name in world), "")
    sensors = world.removeprefix(OFF).removeprefix(mesh)
    model, thirds = membrane(TRUTH.get(mesh, BILINEAR)), 3 if mesh else 1
    histories = strain(np.vstack([np.zeros((1, 16)), damage]), model, 0.0, thirds=thirds, given=given)
    artifact = calibrated_sensor()[0] if sensors == "specimen" else default_artifact()
    twin = Twin(None if mesh else square_structure(*BILINEAR), sensor=artifact)
    rest = twin._sensed.require_bank().parameters["rest_strain"]
    if sensors == "specimen":  # whose records have a noise of their own
        values, noise = flown_resistance(histories[1:], STEP), None
    else:
        values = reader(LEVELS["exact" if sensors == WORN else sensors], 5, histories[0], rest)(histories)
        values = worn(values) if sensors == WORN else values
        noise = NOISE * float(np.ptp(values[0], axis=1).mean())
        values = values[1:] + noise * np.random.default_rng(1).standard_normal(values[1:].shape)
    return fitted(twin, values, damage, "resistance", noise)


def main() -> None:
    """Print the lines."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    print(HEAD)
    for world in sys.argv[2:] or [*LEVELS, "specimen", WORN]:
        print(f"{world:20} {judge(world, count)}", flush=True)


if __name__ == "__main__":
    main()
