"""A structure that is not as drawn: the twin with the drawing, and calibrated on healthy records.

``python -m studies.inspection [RECORDS] [NOISE ...]`` from the folder ``docs`` prints a line for each noise of strain.
Density, thickness, prestrain and Young's modulus of the square are 5 % more or less than drawn, each by chance; the truth
has elements of order 6, and the error of the twin's mesh was learned of order 8. It is calibrated on two healthy records.
Every other record has two damaged zones of 10 to 50 %, and a load that is off by 5 % (deviation).
"""

from __future__ import annotations

import sys
import time

import numpy as np
from gossamer_models.membrane import square_structure
from gossamer_models.twin import Answer, MembraneForward, ResponseRecord, Twin, calibrate
from numpy.typing import NDArray

Array = NDArray[np.float64]
DRAWN = {"density": 1100.0, "thickness": 1e-3, "edge_displacement": 6e-3, "youngs_modulus": 1e7}
OFF, STEP, SAMPLES, TRUTH = 0.05, 3e-4, 1000, (4, 6)
WRONG, DEVIATIONS = 0.05, 3.0  # damage [1], and deviations, by which a zone may be off
STRUCTURES = 2  # of the records


def line(answers: list[Answer], damages: list[Array], seconds: float) -> str:
    """Return what a twin made of records."""
    errors = [answer.damage - damage for answer, damage in zip(answers, damages, strict=True)]
    torn = [damage > 0.0 for damage in damages]
    z = [(error / answer.deviation)[where] for error, answer, where in zip(errors, answers, torn, strict=True)]
    wrong = [
        answer.valid and bool((answer.determined & (abs(error) > np.maximum(WRONG, DEVIATIONS * answer.deviation))).any())
        for error, answer in zip(errors, answers, strict=True)
    ]
    off = 100.0 * np.abs(np.array(errors))
    damaged = np.mean([row[where].mean() for row, where in zip(off, torn, strict=True)])
    z_rms = float(np.sqrt(np.mean(np.concatenate(z) ** 2)))
    valid = sum(answer.valid for answer in answers)
    return (
        f"{off.mean():.3f} / {damaged:.2f} % off, worst {off.max():.1f}, z {z_rms:.2f}, {valid} of {len(answers)} valid, "
        f"{sum(wrong)} wrong and valid, {seconds / len(answers):.0f} s of CPU each"
    )


def main() -> None:
    """Print the lines."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    for noise in map(float, sys.argv[2:] or ["5.8e-3", "1e-3"]):
        random, begun = np.random.default_rng(7), time.process_time()
        answers: dict[str, list[Answer]] = {"as drawn": [], "calibrated": []}
        seconds, damages = dict.fromkeys(answers, 0.0), list[Array]()
        for _ in range(STRUCTURES):
            true = {name: value * (1.0 + OFF * random.choice([-1.0, 1.0])) for name, value in DRAWN.items()}
            forward = MembraneForward(square_structure(*TRUTH), true)

            def record(damage: Array, load: float, forward: MembraneForward = forward) -> ResponseRecord:
                amplitude = np.array([load * forward.parameters["pressure_amplitude"]])
                y = forward.strain(damage[None], {"pressure_amplitude": amplitude}, {}, SAMPLES, STEP)[0]
                return ResponseRecord(step=STEP, values=y + noise * random.standard_normal(y.shape))  # noqa: B023

            begun = time.process_time()
            known = calibrate(None, [record(np.zeros(16), load) for load in (1.0, 1.04)])
            found = ", ".join(
                f"{name} {value:.3f} +- {s:.3f}"
                for name, value, s in zip(known.names, known.factors, known.deviation, strict=True)
            )
            factors = ", ".join(f"{name} {value / DRAWN[name]:.2f}" for name, value in true.items())
            print(f"noise {noise:g}: {factors}; found {found}; {time.process_time() - begun:.0f} s of CPU", flush=True)
            for _ in range(count // STRUCTURES):
                damage = np.zeros(16)
                damage[random.choice(16, 2, replace=False)] = random.uniform(0.1, 0.5, 2)
                seen = record(damage, 1.0 + 0.05 * random.standard_normal())
                damages.append(damage)
                for name, calibration in (("as drawn", None), ("calibrated", known)):
                    begun = time.process_time()
                    answers[name].append(Twin(calibration=calibration).fit(seen))
                    seconds[name] += time.process_time() - begun
        for name, each in answers.items():
            print(f"noise {noise:g}, {name:10}  {line(each, damages, seconds[name])}", flush=True)


if __name__ == "__main__":
    main()
