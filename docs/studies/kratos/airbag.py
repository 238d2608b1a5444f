"""A square airbag that wrinkles, as Kratos inflates it on the same elements, in tests/oracles/kratos/airbag.

``python -m studies.kratos.airbag PYTHON`` from the folder ``docs``, with the Python of an environment as for ``records``;
a minute. Kratos begins where ours rests and stays there; from 0.1 % away it comes back without wrinkles, and with them its
elements go slack and its matrix is singular.
"""

from __future__ import annotations

import sys

import numpy as np
from gossamer_models.membrane import Load, MeshFile, Region, Setup, Structure, Support, make_structure, surface_mesh
from numpy.typing import NDArray

from .records import FOLDER, at_rest, problem, solve

Array = NDArray[np.float64]
DIAGONAL, PRESSURE = 1.2, 5e3  # [m], [Pa]
FILM = Region(youngs_modulus=588e6, poisson_ratio=0.4, density=1000.0, thickness=0.6e-3)
HELD = {"left": "x", "bottom": "y", "right": "z", "top": "z"}  # two planes of symmetry, and the seams


def airbag(n: int, law: str = "relaxed") -> Structure:
    """Return an eighth of the airbag, of two flat squares that are joined along their edges, with n by n elements."""
    half = DIAGONAL / np.sqrt(8.0)
    at = np.linspace(0.0, half, n + 1)
    nodes = np.array([(x, y, 0.0) for y in at for x in at])
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = first[:, None] + np.array([0, 1, n + 2, n + 1])
    x, y = nodes[:, 0], nodes[:, 1]
    on = {"left": x == 0.0, "bottom": y == 0.0, "right": x == half, "top": y == half}
    points = {name: np.flatnonzero(there) for name, there in on.items()}
    file = MeshFile("airbag", nodes, quads, np.zeros((0, 3), dtype=np.int64), {}, {}, points)
    supports = tuple(Support(group=name, fixed=axes) for name, axes in HELD.items())
    loads = (Load(name="pressure", start=PRESSURE),)
    setup = Setup(title="Airbag", law=law, regions=(FILM,), supports=supports, loads=loads)
    return make_structure(setup, surface_mesh(file, 1))


def main() -> None:
    """Write the displacements of all nodes with wrinkles; print what they are without, too."""
    folder = FOLDER / "airbag"
    folder.mkdir(exist_ok=True)
    for law in ("relaxed", "st_venant_kirchhoff"):
        structure = airbag(16, law)
        given = problem(structure, np.zeros(1), np.array([PRESSURE]), 0.0)
        ours = at_rest(structure, np.zeros(0), {})
        found = solve(sys.argv[1], given | {"displaced": np.zeros((1, *ours.shape)), "guess": ours[None]})[0]
        print(f"{law}: {found[0, 2]:.5f} m, ours {ours[0, 2]:.5f} m, apart by {np.abs(found - ours).max():.2g} m")
        if law == "relaxed":
            header = "Kratos 10.4: displacement of the nodes of an airbag of 1.2 m, 16 x 16 elements an eighth [m]"
            np.savetxt(folder / "16.csv", found, "%.8g", ",", header=header)


if __name__ == "__main__":
    main()
