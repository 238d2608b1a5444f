"""The square of the thesis, the setup that ships: its mesh, zones, sensors and variables.

Its numbers are parameters when it runs: they scale its mesh, mass and law, and the way of its rim. It starts flat and
without loads. Elements and zones are numbered row by row from the corner nearest to the origin, x fastest, as in Section 7.1
of the thesis; the membrane's own origin is its centre.
"""

import math
from dataclasses import astuple, dataclass, field, fields, replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..arrays import Vector
from ..errors import ParameterError
from ..mistakes import DescriptionError, Mistake
from ..variables import Variable, input_, local, output, parameter
from .gauges import place_matrix
from .interface import BUILT_IN, MAX_STEP, STRAIN, damage_rows, node_rows
from .reading import MeshFile
from .setup import Region, Sensor, Setup, Support
from .structure import Structure, make_structure, stretched_evenly
from .surface import surface_mesh
from .zones import Zone

ZONES_PER_SIDE = 4
GRID_STEPS = 8  # deflections are results on a grid of 7 x 7 points, whatever the mesh
# fractions of the side along x and y; (0.2, 0.2), (0.4, 0.2), (0.2, 0.4), (0.4, 0.4) m of the prestressed 0.6 m square,
# where Section 7.5 of the thesis measures the normal strain along y
SENSORS = ((1 / 3, 1 / 3), (2 / 3, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 2 / 3))
GRID = [(i, j) for i in range(1, GRID_STEPS) for j in range(1, GRID_STEPS)]
ZONES = [(column, row) for row in range(ZONES_PER_SIDE) for column in range(ZONES_PER_SIDE)]


def _row(start: float, unit: str, description: str, minimum: float, maximum: float) -> Any:  # noqa: ANN401
    """Make a field that holds one row of the table."""
    row = {"start": start, "unit": unit, "description": description, "minimum": minimum, "maximum": maximum}
    return field(default=start, metadata=row)


def _built_in(name: str) -> Any:  # noqa: ANN401
    row = next(v for v in BUILT_IN if v.name == name)
    return _row(row.start or 0.0, row.unit, row.description, row.minimum or 0.0, row.maximum or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class MembraneParams:
    """Parameters of the square membrane; the defaults are those of Section 7.3 of the thesis and a mass damping.

    Each field is a row: default, unit, description, smallest and largest value.

    Raises
    ------
    ParameterError
        A value is not finite or out of its range.

    Notes
    -----
    The default of ``mass_damping``, 8 % of critical at the first frequency, is a choice: the thesis states none, but without
    any the response depends on step and mesh after 0.1 s (it is weakly chaotic), so that no two programs, and no damaged and
    healthy run, can be compared. The built-in pressure is amplitude * sin(2 pi frequency t + phase).
    """

    side_length: float = _row(0.588, "m", "Side of the unstretched square", 1e-3, 1e3)
    thickness: float = _row(0.001, "m", "Unstretched thickness", 1e-7, 1.0)
    youngs_modulus: float = _row(1e7, "Pa", "Young's modulus of the undamaged material", 1.0, 1e13)
    poisson_ratio: float = _row(0.33, "1", "Poisson's ratio", -0.9, 0.499)
    density: float = _row(1100.0, "kg/m3", "Density of the unstretched material", 1e-3, 1e5)
    edge_displacement: float = _row(0.006, "m", "Outward displacement of every edge before it is held", 0.0, 1e3)
    mass_damping: float = _built_in("mass_damping")
    pressure_amplitude: float = _built_in("pressure_amplitude")
    pressure_frequency: float = _built_in("pressure_frequency")
    pressure_phase: float = _built_in("pressure_phase")

    def __post_init__(self) -> None:
        for row in fields(self):
            value, low, high = getattr(self, row.name), row.metadata["minimum"], row.metadata["maximum"]
            if not low <= value <= high:
                msg = f"membrane parameter {row.name!r} is {value:g}; it must be a number from {low:g} to {high:g}"
                raise ParameterError(msg)

    def vector(self) -> Vector:
        """Return all values in the order of the table, shape (n,)."""
        return np.array(astuple(self), dtype=np.float64)

    def pressure(self, time: float) -> float:
        """Evaluate the built-in pressure [Pa] at a time [s]."""
        return self.pressure_amplitude * math.sin(math.tau * self.pressure_frequency * time + self.pressure_phase)


INPUTS = (
    input_("pressure", "Pa", "Uniform follower pressure added to the built-in one", 0.0, -1e6, 1e6, nominal=1e4),
    input_(
        "base_acceleration",
        "m/s2",
        "Acceleration of the rigid frame, normal to the membrane, that displacements are relative to",
        0.0,
        -1e5,
        1e5,
        nominal=10.0,
    ),
)
PARAMETERS = tuple(parameter(row.name, **row.metadata) for row in fields(MembraneParams))


def stretch(p: MembraneParams | SimpleNamespace) -> Any:  # noqa: ANN401
    """Return the stretch [1] of the undamaged, unloaded membrane in its plane, Section 7.2 of the thesis."""
    return 1.0 + 2.0 * p.edge_displacement / p.side_length


def square_structure(
    elements_per_side: int = ZONES_PER_SIDE,
    order: int = 4,
    law: str = "st_venant_kirchhoff",
    params: MembraneParams | None = None,
) -> Structure:
    """Make the square with its 16 damage zones and its four sensors.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4, at least 4, so that every damage zone is a whole number of elements.
    order : int
        Order of the elements: 1 for bilinear, 2 to 12 for spectral ones.
    law : str
        Law of the material, one of ``law.LAWS``.
    params : MembraneParams or None
        Start values of the parameters; None for those of the thesis.

    Raises
    ------
    DescriptionError
        ``elements_per_side`` does not fit the zones, ``order`` is out of range, or there is no such law.
    """
    n = elements_per_side
    if not isinstance(n, int) or isinstance(n, bool) or n < ZONES_PER_SIDE or n % ZONES_PER_SIDE:
        text = f"'elements_per_side' is {n!r}. Write a multiple of 4 for the 4 x 4 damage zones: 4, 8, 12, 16, ..."
        raise DescriptionError(Mistake(("elements_per_side",), text))
    p = params or MembraneParams()
    side = p.side_length
    material = {name: getattr(p, name) for name in ("youngs_modulus", "poisson_ratio", "density", "thickness")}
    centre, per_metre = (side / 2.0, side / 2.0, 0.0), 1.0 + 2.0 / side
    setup = Setup(
        title="Square membrane",
        order=order,
        law=law,
        mass_damping=p.mass_damping,
        regions=(Region(**material),),
        supports=(Support(group="rim", stretch=(per_metre, per_metre, 1.0), centre=centre, motion="edge_displacement"),),
        zones=tuple(Zone(group=f"zone_{k + 1}") for k in range(len(ZONES))),
        sensors=tuple(Sensor(point=(side * x, side * y, 0.0), direction=(0.0, 1.0, 0.0)) for x, y in SENSORS),
    )
    mesh = surface_mesh(_mesh(n, side), order)
    at = np.array([(GRID_STEPS / 2, GRID_STEPS / 2), *GRID]) / GRID_STEPS * side
    probes = place_matrix(mesh, np.column_stack([at, np.zeros(len(at))]))
    found = stretched_evenly(make_structure(setup, mesh), np.array(centre))
    return replace(found, variables=partial(_variables, p), probes={"deflection": probes[:1], "w": probes[1:]})


def _mesh(n: int, side: float) -> MeshFile:
    """Mesh a square by n x n squares."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, side, n + 1)])
    node = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)  # row y, column x
    faces = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    number = np.arange(n * n)
    zone = ZONES_PER_SIDE * (number // n * ZONES_PER_SIDE // n) + number % n * ZONES_PER_SIDE // n
    lines = [node[0], node[-1], node[:, 0], node[:, -1]]
    return MeshFile(
        name="square",
        nodes=np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]),
        quadrilaterals=faces,
        triangles=np.zeros((0, 3), dtype=np.int64),
        faces={f"zone_{k + 1}": np.flatnonzero(zone == k) for k in range(len(ZONES))},
        edges={"rim": np.concatenate([np.column_stack([line[:-1], line[1:]]) for line in lines])},
        points={},
    )


def _variables(p: MembraneParams, setup: Setup, _: tuple[str, ...], n_nodes: int) -> tuple[Variable, ...]:
    """Make the table of the square."""
    strain = "Nominal strain along y, prestrain included, at x = {:.0f}/3, y = {:.0f}/3 of the side"
    return (
        *(replace(row, start=getattr(p, row.name)) for row in PARAMETERS),
        *INPUTS,
        *damage_rows([f"zone {k} (column {x + 1} along x, row {y + 1} along y)" for k, (x, y) in enumerate(ZONES, 1)]),
        *(
            output(f"strain[{k + 1}]", "1", strain.format(*np.array(sensor.point[:2]) / p.side_length * 3.0), nominal=0.1)
            for k, sensor in enumerate(setup.sensors)
        ),
        output("deflection", "m", "Deflection of the centre", nominal=0.1),
        *(
            local(
                f"w[{i},{j}]",
                "m",
                f"Deflection at {i}/{GRID_STEPS} of the side along x, {j}/{GRID_STEPS} along y",
                nominal=0.1,
            )
            for i, j in GRID
        ),
        *node_rows(setup, n_nodes),
        replace(STRAIN, description="Largest principal nominal strain of all points"),
        local("deflection_ratio", "1", "Largest of the deflections w over the side", minimum=0.0, maximum=1.0, nominal=0.1),
        MAX_STEP,
    )
