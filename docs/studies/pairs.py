"""Pairs of runs that differ in the mesh alone, for the model error of the digital twin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gossamer_models.batch import Batch
from gossamer_models.membrane import membrane_model, square_structure
from numpy.typing import NDArray

ORDER, FINER = 4, 8
STEP, STEPS = 3e-4, 1000
PAIRS = 32  # in a chunk


def pairs(folder: Path, chunk: int) -> dict[str, NDArray[np.float64]]:
    """Return ``damage``, ``load`` (in units of its range), ``strain`` and ``difference`` of 32 pairs, simulated or read.

    Damage of 0 to 5 zones, uniform from 0 to 60 %. In odd chunks the amplitude of the load varies by 10 %, its frequency by
    5 %, its phase by 0.1 rad, damping by a factor of 2 and Young's modulus by 2 %.
    """
    path = folder / f"pairs_{chunk:02d}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(path, **_simulate(chunk))  # type: ignore[arg-type]
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _simulate(chunk: int) -> dict[str, NDArray[np.float32]]:
    random = np.random.default_rng([10, chunk])
    damage = np.zeros((PAIRS, 16))
    for row in damage:
        count = random.integers(0, 6)
        zones = random.choice(16, count, replace=False)
        row[zones] = random.uniform(0.0, 0.6, count)
    load = random.uniform(-1.0, 1.0, (PAIRS, 5)) * (chunk % 2)
    start = {
        "damage": damage,
        "pressure_amplitude": 1e4 * (1.0 + 0.1 * load[:, 0]),
        "pressure_frequency": 7.9 * (1.0 + 0.05 * load[:, 1]),
        "mass_damping": 20.0 * 2.0 ** load[:, 2],
        "pressure_phase": 0.1 * load[:, 3],
        "youngs_modulus": 1e7 * (1.0 + 0.02 * load[:, 4]),
    }
    coarse, fine = (
        Batch(model, model.elements("strain")).run(STEPS, STEP, start).results
        for model in (membrane_model(square_structure(4, order)) for order in (ORDER, FINER))
    )
    found = {"damage": damage, "load": load, "strain": coarse, "difference": fine - coarse}
    return {name: values.astype(np.float32) for name, values in found.items()}
