"""The digital twin, measured against what was asked of it.

``python -m studies.twin [CASES] [ROW ...]`` from the folder ``docs`` prints a table; rows by name, all by default. Random
cases have 1 to 4 zones of 5 to 50 %, records last 0.3 s, noise is the thesis' U(0, 0.02) of strain or 0.1 % of the change
of resistance at full scale. Other worlds take minutes for eight cases: orders 8 and 12 with a third of the step, order 8
by Runge and Kutta, Hencky's law, and the virtual specimen in place of the sensors, which the twin knows from one record.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from gossamer_models.batch import Batch
from gossamer_models.membrane import MembraneParams, membrane_model, square_structure
from gossamer_models.membrane.square import stretch
from gossamer_models.sensor import default_artifact
from gossamer_models.step_model import StepModel
from gossamer_models.twin import ResponseRecord, Twin
from gossamer_models.twin.simulation import SensorBank
from numpy.typing import ArrayLike, NDArray

from .runge_kutta import runge_kutta_membrane
from .specimen.flight import calibrated_sensor, flown_resistance

Array = NDArray[np.float64]
STEP, STEPS = 3e-4, 1000
NOISE = 0.02  # of strain, uniform from 0 [1]
RESISTANCE_NOISE = 1e-3  # of the change at full scale
HEAD = "error [% damage], all / damaged zones, worst; z rms, share within 1.96; valid; chi2 per sample; CPU time a fit"


@dataclass(frozen=True)
class Row:
    """One line of the table: which records, which twin, what was asked."""

    asked: str
    make: Callable[[Array], Array]
    twin: Callable[[], Twin]
    kind: Literal["strain", "resistance"] = "strain"
    noise: float | None = NOISE / np.sqrt(12.0)
    step: float = STEP


def cases(count: int, seed: int = 7, most: int = 4) -> Array:
    """Draw damages of one to some zones, shape (count, 16)."""
    random = np.random.default_rng(seed)
    damage = np.zeros((count, 16))
    for row in damage:
        zones = random.choice(16, random.integers(1, most + 1), replace=False)
        row[zones] = random.uniform(0.05, 0.5, zones.size)
    return damage


def strain(
    damage: Array,
    model: StepModel,
    noise: float = NOISE,
    load: bool = False,
    thirds: int = 1,
    given: Mapping[str, float] | None = None,
    every: int | None = None,
) -> Array:
    """Simulate strain with noise, shape (n, 4, steps); with load, damping, modulus and gain varied if asked, or as given.

    A step is simulated in one or three; a sample is a step, or as many of these parts as asked.
    """
    random = np.random.default_rng(len(damage))
    start: dict[str, ArrayLike] = {"damage": damage, **(given or {})}
    gain: Array = np.ones((len(damage), 4, 1))
    if load:
        u = random.uniform(-1.0, 1.0, (4, len(damage)))
        start["pressure_amplitude"] = 1e4 * (1.0 + 0.1 * u[0])
        start["pressure_frequency"] = 7.9 * (1.0 + 0.05 * u[1])
        start["mass_damping"] = 20.0 * 2.0 ** u[2]
        start["youngs_modulus"] = 1e7 * (1.0 + 0.02 * u[3])
        gain = 1.0 + 0.02 * random.uniform(-1.0, 1.0, gain.shape)
    found = Batch(model, model.elements("strain")).run(thirds * STEPS, STEP / thirds, start, every=every or thirds).results
    return np.asarray(gain * found + noise * random.random(found.shape))


def membrane(mesh: tuple[int, int], law: str = "st_venant_kirchhoff") -> StepModel:
    """Return a membrane by elements per side and order."""
    return membrane_model(square_structure(*mesh, law))


def resistance(damage: Array, mesh: tuple[int, int]) -> Array:
    """Simulate resistance with noise, shape (n, 4, steps)."""
    histories = strain(damage, membrane(mesh), 0.0)
    sensors = SensorBank(default_artifact(), histories.shape[1], stretch(MembraneParams()) - 1.0)
    found = sensors.read(histories, STEP)[0]
    scale = RESISTANCE_NOISE * sensors.parameters["full_scale_resistance_change"][:, None]
    return np.asarray(found + scale * np.random.default_rng(1).standard_normal(found.shape))


BILINEAR, DEFAULT, FINER, FINEST = (8, 1), (4, 4), (4, 8), (4, 12)


def finest(noise: float) -> Row:
    """Return a row of records of order 12, which no error was learned from, with noise of a standard deviation."""
    return Row("", lambda d: strain(d, membrane(FINEST), np.sqrt(12.0) * noise, thirds=3), Twin, noise=noise)


ROWS = {
    "bilinear": Row(
        "0.15 / 0.65, z 0.8 to 1.2, 0.5 s",
        lambda d: strain(d, membrane(BILINEAR)),
        lambda: Twin(square_structure(*BILINEAR)),
    ),
    "default": Row(
        "0.15 / 0.65, z 0.8 to 1.2, 2.5 s", lambda d: strain(d, membrane(DEFAULT)), lambda: Twin(discrepancy=None)
    ),
    "default, learned": Row("", lambda d: strain(d, membrane(DEFAULT)), Twin),
    "all zones": Row("", lambda d: strain(d, membrane(BILINEAR)), lambda: Twin(square_structure(*BILINEAR), sparse=False)),
    "clean": Row(
        "0.000", lambda d: strain(d, membrane(BILINEAR), 0.0), lambda: Twin(square_structure(*BILINEAR)), noise=1e-6
    ),
    "load": Row("0.3 / 1.5", lambda d: strain(d, membrane(BILINEAR), load=True), lambda: Twin(square_structure(*BILINEAR))),
    "resistance": Row(
        "0.03 / 0.1",
        lambda d: resistance(d, BILINEAR),
        lambda: Twin(square_structure(*BILINEAR), sensor=default_artifact()),
        kind="resistance",
        noise=None,
    ),
    "other world, plain": Row("", lambda d: strain(d, membrane(FINER), thirds=3), lambda: Twin(discrepancy=None)),
    "other world": Row("0.8 / 2", lambda d: strain(d, membrane(FINER), thirds=3), Twin),
    "finest, 1e-3": finest(1e-3),
    "finest, 1e-4": finest(1e-4),
    "samples of 1 ms": Row(
        "", lambda d: strain(d, membrane(FINER), np.sqrt(12.0) * 1e-3, thirds=3, every=10), Twin, noise=None, step=1e-3
    ),
    "other integrator": Row("0.8 / 2", lambda d: strain(d, runge_kutta_membrane(*FINER)), Twin),
    "other law": Row("", lambda d: strain(d, membrane(DEFAULT, "hencky")), Twin),
    "other sensor": Row(
        "",
        lambda d: flown_resistance(strain(d, membrane(DEFAULT), 0.0), STEP),
        lambda: Twin(sensor=calibrated_sensor()[0], discrepancy=None),
        kind="resistance",
        noise=None,
    ),
}


def judge(row: Row, damage: Array) -> str:
    """Fit all cases of a row; return its line of the table."""
    return fitted(row.twin(), row.make(damage), damage, row.kind, row.noise, row.step)


def fitted(
    twin: Twin, records: Array, damage: Array, kind: Literal["strain", "resistance"], noise: float | None, step: float = STEP
) -> str:
    """Fit a record for each row of damage; return a line of the table."""
    clock = time.process_time()
    answers = [twin.fit(ResponseRecord(step=step, values=values, kind=kind, noise=noise)) for values in records]
    seconds = (time.process_time() - clock) / len(records)
    error, damaged = np.array([a.damage for a in answers]) - damage, damage > 0.0
    size, z = 100.0 * np.abs(error), (error / np.array([a.deviation for a in answers]))[damaged]
    return (
        f"{size.mean():7.3f} / {size[damaged].mean():6.3f}  {size.max():6.2f}  {np.sqrt(np.mean(z**2)):5.2f} "
        f"{100 * np.mean(np.abs(z) < 1.96):5.0f} %  {sum(a.valid for a in answers):3d} of {len(answers):3d}  "
        f"{np.mean([a.chi2_per_sample for a in answers]):6.3f}  {seconds:6.2f} s"
    )


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 16
    print(HEAD)
    for name in sys.argv[2:] or ROWS:
        print(f"{name:20} {judge(ROWS[name], cases(count))}   asked: {ROWS[name].asked or '-'}", flush=True)


if __name__ == "__main__":
    main()
