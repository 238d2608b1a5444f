"""Sensors identified again in flight: what they recover of a later flight, before and after.

``python -m studies.recalibration`` from the folder ``docs`` prints a line for each sensor: of a record that the twin's own
mesh has made, and of one of order 8 for the default twin. Tables and relaxation of each sensor differ by random fields, not
those that are fitted; two damaged zones that nobody knows, noise 0.1 % of the range, 0.3 s. The later flight has 0.8 times
the pressure and another frequency, and no noise.
"""

from __future__ import annotations

import time

import numpy as np
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import SensorArtifact, default_artifact
from gossamer_models.stepper import Stepper, simulate
from gossamer_models.twin import ResponseRecord, Twin, recalibrate
from gossamer_models.twin.simulation import SensorBank
from numpy.typing import NDArray

from .sensor_error import perturbed
from .twin import BILINEAR, FINER, STEP, membrane, strain

Array = NDArray[np.float64]
SIZES = (0.25, 0.02, 0.12, 0.1)  # of the fields [1]
DAMAGE = 0.3 * np.eye(16)[5:6] + 0.15 * np.eye(16)[10:11]
LATER = {"pressure_amplitude": 0.8e4, "pressure_frequency": 9.5}
NOISE = 1e-3  # of the mean range
SCALES = ("full_scale_strain", "full_scale_resistance_change", "rest_resistance")


def recovered(artifact: SensorArtifact, given: dict[str, float], resistance: Array) -> Array:
    """Return the strain [1] that the exact inverse recovers."""
    model = Stepper(compensator_model(artifact, "inverse"), **given)
    model.initialize()
    return simulate(model, np.full(resistance.size, STEP), {"resistance": resistance}, ["strain"])["strain"]


def main() -> None:
    """Print the lines."""
    for what, mesh, structure in (("own mesh", BILINEAR, square_structure(*BILINEAR)), ("order 8", FINER, None)):
        twin, thirds = Twin(structure, sensor=default_artifact()), 3 if structure is None else 1
        first, later = (strain(DAMAGE, membrane(mesh), 0.0, thirds=thirds, given=given)[0] for given in (None, LATER))
        old = twin.bank.parameters
        banks = [
            SensorBank(perturbed(default_artifact(), size, k + 3), 1, 0.0, {name: value[k] for name, value in old.items()})
            for k, size in enumerate(SIZES)
        ]
        read, flown = (
            np.concatenate([bank.read(each[None, k : k + 1], STEP)[0][0] for k, bank in enumerate(banks)])
            for each in (first, later)
        )
        noise = NOISE * float(np.ptp(twin.bank.read(first[None], STEP)[0][0], axis=1).mean())
        values = read + noise * np.random.default_rng(1).standard_normal(read.shape)
        begun = time.process_time()
        answer = twin.fit(ResponseRecord(step=STEP, values=values, kind="resistance", noise=noise))
        fitted = time.process_time() - begun
        off = np.sqrt(np.mean((answer.strain - first[:, : answer.strain.shape[1]]) ** 2, axis=1)) / np.ptp(first, axis=1)
        wrong, felt = 100.0 * np.abs(answer.damage - DAMAGE[0]).max(), ", ".join(f"{100.0 * each:.3f}" for each in off)
        print(
            f"{what}: valid {answer.valid}, damage off by {wrong:.2f} %, strain of the twin by {felt} % of range", flush=True
        )
        print(f"{fitted:.0f} s of CPU", flush=True)
        for k, each in recalibrate(answer, twin.bank).items():
            span, rest = float(np.ptp(later[k - 1])), {"rest_strain": float(old["rest_strain"][k - 1])}
            known = {name: float(old[name][k - 1]) for name in SCALES}
            before, after = (
                100.0 * float(np.sqrt(np.mean((recovered(*one, flown[k - 1]) - later[k - 1]) ** 2))) / span
                for one in ((default_artifact(), rest | known), (each.artifact, rest))
            )
            change = f"later flight {before:.2f} -> {after:.2f} % of range, stated {100.0 * each.deviation / span:.2f}"
            print(f"  sensor {k}, {100.0 * each.before:.1f} % off: {change}", flush=True)


if __name__ == "__main__":
    main()
