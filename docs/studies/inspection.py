"""A structure that is not as drawn: the twin with the drawing, and calibrated on healthy records.

``python -m studies.inspection --dish [RECORDS] [--finer]``: the shipped dish on a rim of springs. Thickness 5 %, pressure
3 % and stiffness of the rim a factor of 2 off, strain noise 1e-4, calibrated on three healthy records; as drawn, two of the
records. ``--finer``: the truth has finer elements than the twin.

``python -m studies.inspection [RECORDS] [NOISE ...]`` from the folder ``docs`` prints a line for each noise of strain.
Density, thickness, prestrain and Young's modulus of the square are 5 % more or less than drawn, each by chance; the truth
has elements of order 6, and the error of the twin's mesh was learned of order 8. It is calibrated on two healthy records.
Every other record has two damaged zones of 10 to 50 %, and a load that is off by 5 % (deviation).
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
from gossamer.descriptions import load_structure
from gossamer_models.membrane import make_structure, square_structure
from gossamer_models.twin import Answer, Calibration, MembraneForward, MeshErrors, ResponseRecord, Twin, calibrate
from gossamer_models.twin.calibration import with_factors
from numpy.typing import NDArray

Array = NDArray[np.float64]
DRAWN = {"density": 1100.0, "thickness": 1e-3, "edge_displacement": 6e-3, "youngs_modulus": 1e7}
OFF, STEP, SAMPLES, TRUTH = 0.05, 3e-4, 1000, (4, 6)
WRONG, DEVIATIONS = 0.05, 3.0  # damage [1], and deviations, by which a zone may be off
STRUCTURES = 2  # of the records
RIM, GAUGE_NOISE, DISH_STEP, DISH_SAMPLES = 2e6, 1e-4, 2.5e-4, 400  # [N/m], strain [1], [s]


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


def found(known: Calibration) -> str:
    """Return what a calibration found."""
    rows = zip(known.names, known.factors, known.deviation, strict=True)
    return ", ".join(f"{name} {value:.3f} +- {deviation:.3f}" for name, value, deviation in rows)


def dish(count: int, *, finer: bool) -> None:
    """Print what is found of a dish."""
    shipped, random = load_structure("reflector"), np.random.default_rng(8)
    supports = tuple(replace(support, stiffness=RIM) for support in shipped.setup.supports)
    drawn = make_structure(replace(shipped.setup, supports=supports), shipped.mesh)
    truth = with_factors(drawn.finer() if finer else drawn, drawn.setup.scalable)
    true = {"thickness_factor": 1.05, "pressure": 0.97 * -200.0, "support_stiffness[1]": RIM / 2.0}
    forward, zones = MembraneForward(truth, true), drawn.n_zones

    def record(damage: Array) -> ResponseRecord:
        amplitude = np.array([100.0 * (1.0 + 0.05 * random.standard_normal())])
        y = forward.strain(damage[None], {"pressure_amplitude": amplitude}, {}, DISH_SAMPLES, DISH_STEP)[0]
        values = y + GAUGE_NOISE * random.standard_normal(y.shape)
        return ResponseRecord(step=DISH_STEP, values=values, noise=GAUGE_NOISE)

    begun = time.process_time()
    known = calibrate(drawn, [record(np.zeros(zones)) for _ in range(3)], mesh_error=finer)
    print(f"thickness 1.05, gas 0.97, support 0.5; found {found(known)}", flush=True)
    print(f"{'; '.join(known.doubts) or 'valid'}, {time.process_time() - begun:.0f} s of CPU", flush=True)
    damages = [np.where(random.permutation(zones) < 2, random.uniform(0.1, 0.5, zones), 0.0) for _ in range(count)]
    seen = [record(damage) for damage in damages]
    for name, calibration in (("calibrated", known), ("as drawn", None)):
        structure = drawn if calibration is None else calibration.applied(drawn, None)[0]
        errors = MeshErrors(structure, None if calibration is None else calibration.parameters) if finer else None
        twin, begun = Twin(drawn, calibration=calibration, mesh_error=errors), time.process_time()
        answers = [twin.fit(each) for each in seen[: None if calibration else 2]]  # what is not explained takes minutes
        print(f"{name:10}  {line(answers, damages[: len(answers)], time.process_time() - begun)}", flush=True)


def main() -> None:
    """Print the lines."""
    if "--dish" in sys.argv:
        counts = [int(word) for word in sys.argv[1:] if word.isdigit()]
        dish(counts[0] if counts else 12, finer="--finer" in sys.argv)
        return
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
            factors = ", ".join(f"{name} {value / DRAWN[name]:.2f}" for name, value in true.items())
            print(
                f"noise {noise:g}: {factors}; found {found(known)}; {time.process_time() - begun:.0f} s of CPU", flush=True
            )
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
