"""Records of the shipped dish and sail, computed by Kratos on their own meshes, in tests/oracles/kratos.

``python -m studies.kratos.records PYTHON`` from the folder ``docs``, with the Python of an environment that has
``KratosStructuralMechanicsApplication``, ``KratosConstitutiveLawsApplication`` and ``KratosLinearSolversApplication``; half
an hour. Kratos has the law of Saint
Venant and Kirchhoff, wrinkled in the sail, and integrates by Newmark's method of the average acceleration with half of the
record's step. The first line of a record says what is damaged.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from gossamer_models.membrane import Structure, membrane_model
from gossamer_models.membrane.gauges import stacked
from numpy.typing import NDArray

from ..structures import SAMPLES, pulled, shipped

Array = NDArray[np.float64]
FOLDER = Path(__file__).parents[3] / "tests" / "oracles" / "kratos"
SOLVER = Path(__file__).with_name("membrane.py")
STEP, HALVES = 2.4e-4, 2
DAMAGE = {"dish": ({6: 0.3}, {3: 0.2, 10: 0.4}), "sail": ({7: 0.3}, {2: 0.25, 9: 0.4})}  # zones from 1


def problem(structure: Structure, damage: Array, pressure: Array, step: float) -> dict[str, Array]:
    """Describe a structure whose faces have one pressure [Pa], held where it is held."""
    (block,), (region,) = structure.elements, structure.setup.regions
    zone = structure.zone[block.combination]
    corners = block.nodes[:, [0, 1, 3, 2]] if block.nodes.shape[1] == 4 else block.nodes
    return {
        "nodes": structure.mesh.nodes,
        "cells": corners,
        "modulus": region.youngs_modulus * (1.0 - np.where(zone < 0, 0.0, damage[zone])),
        "nu": np.array(region.poisson_ratio),
        "density": np.array(region.density),
        "thickness": np.array(region.thickness),
        "held": ~structure.free.reshape(-1, 3),
        "pressure": pressure,
        "step": np.array(step),
        "damping": np.array(structure.setup.mass_damping),
        "wrinkles": np.array(structure.setup.law == "relaxed"),
    }


def at_rest(structure: Structure, damage: Array, load: dict[str, float]) -> Array:
    """Return our displacement at rest [m], shape (N, 3), where Kratos begins to search its own."""
    model = membrane_model(structure)
    p, u, _ = model.slices()
    values = {v.name: v.start or 0.0 for v in model.variables} | load
    values |= {f"damage[{k + 1}]": value for k, value in enumerate(damage)}
    state, _ = model.init([values[name] for name in model.names[u]], [values[name] for name in model.names[p]])
    found = np.zeros((len(structure.mesh.nodes), 3))
    found[structure.moving] = np.asarray(state).ravel()[: 3 * len(structure.moving)].reshape(-1, 3)
    return found + displaced(structure, load)


def displaced(structure: Structure, load: dict[str, float]) -> Array:
    """Return how supports are displaced [m], shape (N, 3)."""
    shares = [load.get(support.motion, 1.0) if support.motion else 1.0 for support in structure.setup.supports]
    return np.asarray(np.tensordot(shares, structure.ways, 1)).reshape(-1, 3)


def solve(python: str, given: dict[str, Array]) -> Array:
    """Let Kratos solve, and return the displacement [m], shape (k, N, 3)."""
    with TemporaryDirectory() as folder:
        asked, answer = Path(folder) / "problem.npz", Path(folder) / "answer.npz"
        np.savez(asked, **given)  # type: ignore[arg-type]
        subprocess.run([python, str(SOLVER), str(asked), str(answer)], check=True, stdout=subprocess.DEVNULL)
        found = np.load(answer)
        assert found["converged"].all(), "Kratos has not converged"
        return np.asarray(found["displacement"])


def strain(structure: Structure, displacement: Array) -> Array:
    """Return the strain of the sensors [1], shape (s, k)."""
    gauges = stacked(structure.setup.sensors, list(structure.gauges), len(structure.mesh.nodes))
    return gauges.strain(np.moveaxis(structure.mesh.nodes + displacement, 0, 2))


def write(name: str, number: int, headings: list[str], columns: Array, zones: dict[int, float]) -> None:
    """Write a record: six digits are a hundredth of the noise."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    what = ", ".join(f"{share:g} in zone {zone}" for zone, share in zones.items())
    header = f"# Kratos 10.4, {structure_of(name).setup.title}: damage {what}\n{','.join(headings)}"
    np.savetxt(FOLDER / f"{name}_{number}.csv", columns, "%.7g", ",", header=header, comments="")


def structure_of(name: str) -> Structure:
    """Return the structure of a name of ``DAMAGE``."""
    return shipped({"dish": "reflector"}.get(name, name))


def dish(python: str, number: int, zones: dict[int, float]) -> None:
    """Record the dish under its own pressure and the built-in one, which sets in at time 0."""
    structure = structure_of("dish")
    damage = np.zeros(structure.n_zones)
    damage[[zone - 1 for zone in zones]] = list(zones.values())
    inside, setup = structure.setup.loads[0].start, structure.setup
    time = STEP / HALVES * np.arange(1, HALVES * SAMPLES + 1)
    held = np.zeros((len(time), len(structure.mesh.nodes), 3))
    still = problem(structure, damage, np.array([inside]), 0.0)
    still |= {"displaced": held[:1], "guess": at_rest(structure, damage, {})[None]}
    pressure = inside + setup.pressure_amplitude * np.sin(2.0 * np.pi * setup.pressure_frequency * time)
    moving = problem(structure, damage, pressure, STEP / HALVES) | {"displaced": held, "guess": solve(python, still)}
    y = strain(structure, solve(python, moving)[HALVES - 1 :: HALVES])
    headings = ["time [s]", *(f"strain[{k + 1}]" for k in range(len(y)))]
    write("dish", number, headings, np.vstack([STEP * np.arange(1, SAMPLES + 1), y]).T, zones)


def sail(python: str, number: int, zones: dict[int, float]) -> None:
    """Record the sail in the load states of the study."""
    structure = structure_of("sail")
    damage = np.zeros(structure.n_zones)
    damage[[zone - 1 for zone in zones]] = list(zones.values())
    load = pulled(np.zeros(0))
    states = [dict(zip(load, row, strict=True)) for row in np.array(list(load.values())).T.tolist()]
    given = problem(structure, damage, load["pressure"], 0.0)
    given["displaced"] = np.array([displaced(structure, state) for state in states])
    given["guess"] = np.array([at_rest(structure, damage, {"sun": 0.0, **state}) for state in states])
    y = strain(structure, solve(python, given))
    headings = ["state", "pressure [Pa]", "boom_x", "boom_y", "sun [Pa]", *(f"strain[{k + 1}]" for k in range(len(y)))]
    rows = [np.arange(1, len(states) + 1), load["pressure"], load["boom_x"], load["boom_y"], np.zeros(len(states)), *y]
    write("sail", number, headings, np.vstack(rows).T, zones)


def main() -> None:
    """Write all records; noise is added where they are read."""
    for name, make in (("sail", sail), ("dish", dish)):
        for number, zones in enumerate(DAMAGE[name]):
            make(sys.argv[1], number + 1, zones)
            print(f"{name} {number + 1}", flush=True)


if __name__ == "__main__":
    main()
