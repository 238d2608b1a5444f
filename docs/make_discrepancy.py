"""Write what the digital twin knows about the error of its default mesh, from pairs of runs on it and on a finer one.

``python docs/make_discrepancy.py [FOLDER]``; the finer mesh takes an hour of one core. Finished chunks of pairs stay in the
folder, so it can be interrupted. Chunks 16 and 17 are kept for ``docs/studies/twin.py`` to judge with.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from gossamer_models.artifacts import write_artifact
from gossamer_models.twin.discrepancy import DEFAULT_PATH, SCHEMA, STEP, VERSION, learn, simulated_pairs
from numpy.typing import NDArray

ELEMENTS, ORDER, STEPS = 4, 4, 1000
LEVELS = 32767  # of the numbers in the file, 16 bits each
LEARNED = [chunk for chunk in range(21) if chunk not in (16, 17)]


def pairs(folder: Path, chunk: int) -> dict[str, NDArray[np.float64]]:
    """Return a chunk of ``simulated_pairs``, simulated or read."""
    path = folder / f"pairs_{chunk:02d}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(path, **simulated_pairs(chunk, ELEMENTS, ORDER, STEPS))  # type: ignore[arg-type]
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}


def write(path: Path, components: NDArray[np.float64], provenance: dict[str, str]) -> None:
    """Write the JSON card and, beside it, the components of strain, shape (k, sensors, splines), in 16 bits each."""
    scale = np.abs(components).max(axis=(1, 2)) / LEVELS
    levels = np.round(components / scale[:, None, None]).astype(np.int16)
    content = {"elements_per_side": ELEMENTS, "order": ORDER, "length": STEPS * STEP}
    write_artifact(path, SCHEMA, VERSION, provenance, content, {"scale": scale, "levels": levels})


def main() -> None:
    """Simulate the pairs that are missing, and write the artifact into the package."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/pairs")
    delta = np.vstack([pairs(folder, chunk)["difference"] for chunk in LEARNED]).astype(float)
    provenance = {
        "command": "python docs/make_discrepancy.py",
        "data": f"{len(delta)} pairs of order {ORDER} and {2 * ORDER}, 0 to 5 zones of 0 to 60 %; half of them with "
        "load, damping and modulus varied",
        "error": f"root mean square of the differences {np.sqrt(np.mean(delta**2)):.5f}",
    }
    write(DEFAULT_PATH, learn(delta, STEP), provenance)


if __name__ == "__main__":
    main()
