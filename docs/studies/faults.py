"""Faults that are no torn zones: whether a twin names the right one, and how sure it is.

``python -m studies.faults [CASES] [--finer]`` from the folder ``docs`` prints a line for each case and for each fault. The
shipped dish on a rim of springs, calibrated on two healthy records: 5 % less gas, or the rim half as stiff, without and with
20 % damage in a zone. Strain noise 1e-4. ``--finer``: the truth has finer elements than the twin.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
from gossamer.descriptions import load_structure
from gossamer_models.membrane import make_structure
from gossamer_models.twin import MembraneForward, MeshErrors, ResponseRecord, Twin, calibrate
from numpy.typing import NDArray

Array = NDArray[np.float64]
NOISE, STEP, SAMPLES = 1e-4, 2.5e-4, 400
RIM = 2e6  # [N/m]
FAULTS = {
    "nothing": ({}, 0.0),
    "loss of gas": ({"pressure": -190.0}, 0.05),
    "loose support rim": ({"support_stiffness[1]": RIM / 2.0}, 0.5),
}
DEPTH, WRONG = 0.2, 0.05


def main() -> None:
    """Print the lines."""
    counts = [int(word) for word in sys.argv[1:] if word.isdigit()]
    cases, finer = counts[0] if counts else 2, "--finer" in sys.argv
    shipped = load_structure("reflector")
    supports = tuple(replace(support, stiffness=RIM) for support in shipped.setup.supports)
    structure = make_structure(replace(shipped.setup, supports=supports), shipped.mesh)
    truth = MembraneForward(structure.finer() if finer else structure)
    random = np.random.default_rng(5)
    names = structure.zone_names

    def record(damage: Array, given: dict[str, float]) -> ResponseRecord:
        amplitude = 100.0 * (1.0 + 0.05 * random.standard_normal())
        start = {name: np.array([value]) for name, value in ({"pressure_amplitude": amplitude} | given).items()}
        y = truth.strain(damage[None], start, {}, SAMPLES, STEP)[0]
        return ResponseRecord(step=STEP, values=y + NOISE * random.standard_normal(y.shape), noise=NOISE)

    healthy = [record(np.zeros(len(names)), {}) for _ in range(2)]
    begun = time.process_time()
    known = calibrate(structure, healthy, priors={"density": 0.0}, mesh_error=finer)
    print(f"calibrated in {time.process_time() - begun:.0f} s of CPU: {'; '.join(known.doubts) or 'valid'}", flush=True)
    errors = MeshErrors(known.applied(structure, None)[0], known.parameters) if finer else None
    twin = Twin(structure, calibration=known, faults="known", mesh_error=errors)
    for fault, (given, share) in FAULTS.items():
        right, valid, wrong = 0, 0, 0
        for case in range(2 * cases):
            damage = np.zeros(len(names))
            if case >= cases:
                damage[random.integers(len(names))] = DEPTH
            begun = time.process_time()
            answer = twin.fit(record(damage, given))
            what = {text.rpartition(" ")[0].rpartition(" ")[0] for text in answer.explanations[0][1]}
            true = {fault} - {"nothing"} | {name for name, depth in zip(names, damage, strict=True) if depth}
            right += what == true
            valid += answer.valid
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


if __name__ == "__main__":
    main()
