"""Faults that are no torn zones: whether a twin names the right one, and how sure it is.

``python -m studies.faults [CASES] [NOISE] [--finer] [--sail]`` from the folder ``docs`` prints a line for each case and for
each fault, and at the end how sure the first explanations were, and how often right. The shipped dish on a rim of springs,
calibrated on two healthy records: 5 % less gas, or the rim half as stiff; the shipped sail in eight load states, calibrated
on one: a boom that pulls 10 % less. Without and with 20 % damage in a zone. Strain noise 1e-4 unless it is given.
``--finer``: the truth has finer elements than the twin.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from gossamer_models.membrane import Structure, make_structure
from gossamer_models.twin import MembraneForward, MeshErrors, ResponseRecord, StaticRecord, Twin, calibrate
from numpy.typing import NDArray

from .structures import READINGS, pulled, shipped

Array = NDArray[np.float64]
STEP, SAMPLES = 2.5e-4, 400
RIM = 2e6  # [N/m]
DISH = {
    "nothing": ({}, 0.0),
    "loss of gas": ({"pressure": -190.0}, 0.05),
    "loose support rim": ({"support_stiffness[1]": RIM / 2.0}, 0.5),
}
SAIL = {"nothing": ({}, 0.0), "slack boom x": ({"boom_x": 0.9}, 0.1)}
DEPTH, WRONG = 0.2, 0.05
Recorder = Callable[[MembraneForward, Array, dict[str, float], float, np.random.Generator], ResponseRecord]


def of_dish(
    truth: MembraneForward, damage: Array, given: dict[str, float], noise: float, random: np.random.Generator
) -> ResponseRecord:
    """Simulate a record of motion under a load that is off by 5 % (deviation)."""
    amplitude = 100.0 * (1.0 + 0.05 * random.standard_normal())
    start = {name: np.array([value]) for name, value in ({"pressure_amplitude": amplitude} | given).items()}
    y = truth.strain(damage[None], start, {}, SAMPLES, STEP)[0]
    return ResponseRecord(step=STEP, values=y + noise * random.standard_normal(y.shape), noise=noise)


def of_sail(
    truth: MembraneForward, damage: Array, given: dict[str, float], noise: float, random: np.random.Generator
) -> ResponseRecord:
    """Simulate load states; what the booms pull is less than the record says by the share that is given."""
    stated = pulled(np.zeros(0))
    acting = {name: given.get(name, 1.0) * values for name, values in stated.items()}
    y = np.repeat(truth.states(damage[None], {}, acting)[0], READINGS, axis=1)
    count = y.shape[1] // READINGS
    return StaticRecord(
        values=y + noise * random.standard_normal(y.shape),
        noise=noise,
        inputs=stated,
        state=np.repeat(np.arange(count), READINGS),
        names=tuple(str(k + 1) for k in range(count)),
    )


def dish() -> Structure:
    """Return the shipped dish on a rim of springs."""
    structure = shipped("reflector")
    supports = tuple(replace(support, stiffness=RIM) for support in structure.setup.supports)
    return make_structure(replace(structure.setup, supports=supports), structure.mesh)


def main() -> None:
    """Print the lines."""
    given_numbers = [float(word) for word in sys.argv[1:] if not word.startswith("-")]
    cases, noise = int(given_numbers[0]) if given_numbers else 2, given_numbers[1] if given_numbers[1:] else 1e-4
    finer, sail = "--finer" in sys.argv, "--sail" in sys.argv
    structure = shipped("sail") if sail else dish()
    record: Recorder = of_sail if sail else of_dish
    truth, random = MembraneForward(structure.finer() if finer else structure), np.random.default_rng(5)
    names, undamaged = structure.zone_names, np.zeros(structure.n_zones)
    healthy = [record(truth, undamaged, {}, noise, random) for _ in range(1 if sail else 2)]
    begun = time.process_time()
    known = calibrate(structure, healthy, priors={} if sail else {"density": 0.0}, mesh_error=finer)
    print(f"calibrated in {time.process_time() - begun:.0f} s of CPU: {'; '.join(known.doubts) or 'valid'}", flush=True)
    errors = MeshErrors(known.applied(structure, None)[0], known.parameters) if finer else None
    twin = Twin(structure, calibration=known, faults="known", mesh_error=errors)
    sure = list[tuple[float, bool]]()
    for fault, (given, share) in (SAIL if sail else DISH).items():
        right, valid, wrong = 0, 0, 0
        for case in range(2 * cases):
            damage = undamaged.copy()
            if case >= cases:
                damage[random.integers(len(names))] = DEPTH
            begun = time.process_time()
            answer = twin.fit(record(truth, damage, given, noise, random))
            probability, texts = answer.explanations[0]
            what = {text.rpartition(" ")[0].rpartition(" ")[0] for text in texts}
            true = {fault} - {"nothing"} | {name for name, depth in zip(names, damage, strict=True) if depth}
            right += what == true
            valid += answer.valid
            if answer.valid:
                sure.append((probability, what == true))
            off = answer.determined & (np.abs(answer.damage - damage) > np.maximum(WRONG, 3.0 * answer.deviation))
            wrong += bool(answer.valid and off.any())
            found = next((each for each in answer.faults if each.name == fault), None)
            size = f", {100.0 * found.share:.1f} +- {100.0 * found.deviation:.1f} % of {100.0 * share:g} %" if found else ""
            print(
                f"{fault}, {'damaged' if damage.any() else 'whole'}: {answer.explanations[:2]}{size}, valid {answer.valid}, "
                f"{time.process_time() - begun:.0f} s of CPU",
                flush=True,
            )
        print(f"{fault}: right first in {right} of {2 * cases}, {valid} valid, {wrong} wrong and valid", flush=True)
    stated, were = np.mean(sure, axis=0) if sure else (np.nan, np.nan)
    print(f"valid answers: first explanations {100.0 * stated:.0f} % sure, {100.0 * were:.0f} % right", flush=True)


if __name__ == "__main__":
    main()
