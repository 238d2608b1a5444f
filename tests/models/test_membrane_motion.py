"""Motion of membranes from a mesh: frequencies in closed form, the square of the thesis, scaled inertia, limits."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from gossamer_models import Stepper
from gossamer_models.membrane import (
    Load,
    MembraneEquations,
    PointMass,
    Region,
    Setup,
    Support,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from gossamer_models.membrane.model import first_period
from oracles.meshes import disc, meshed, rectangle, rim, started, thesis_square
from scipy.special import jn_zeros


@pytest.mark.parametrize(("n", "order"), [(8, 1), (4, 4)])
def test_the_square_of_the_thesis_as_a_mesh_is_the_membrane_of_the_thesis(n, order):
    mesh, square = (Stepper(membrane_model(s)) for s in (thesis_square(n, order), square_structure(n, order)))
    for model in (mesh, square):
        model.set("pressure_amplitude", 1e4)
        model.set("damage[6]", 0.3)
        model.initialize()
    for _ in range(1500):
        for model in (mesh, square):
            model.step(5e-5)  # one internal step of both, whose limits differ
        for k in range(4):
            assert mesh.get(f"strain[{k + 1}]") == pytest.approx(square.get(f"strain[{k + 1}]"), abs=1e-12)
    assert square.get("strain[1]") > 0.03


def triangle(n, kind):
    """Mesh an equilateral triangle of unit side as three quadrilateral patches around its middle."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(3.0) / 2.0]])
    middle = corners.mean(axis=0)

    def patch(k):
        points = corners[k], (corners[k] + corners[(k + 1) % 3]) / 2.0, middle, (corners[k] + corners[k - 1]) / 2.0

        def place(s, t):
            shares = (1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t
            x, y = sum(share[None] * point[:, None, None] for share, point in zip(shares, points, strict=True))
            return x, y, 0.0 * s

        return place

    def on_rim(x, y, z):
        return (y < 1e-9) | (np.sqrt(3.0) * x - y < 1e-9) | (np.sqrt(3.0) * (1.0 - x) - y < 1e-9)

    return meshed([patch(k) for k in range(3)], n, edges={"rim": on_rim}, kind=kind)


def frequencies(file, order):
    """Return the lowest angular frequencies of transverse motion over the wave speed, from the linearised forces."""
    stress, modulus, nu, density, h = 1e6, 3e9, 0.3, 1400.0, 2e-5
    film = Region(youngs_modulus=modulus, poisson_ratio=nu, density=density, thickness=h, prestress=(stress, stress, 0.0))
    structure = make_structure(
        Setup(order=order, regions=(film,), supports=(Support(group="rim"),)), surface_mesh(file, order)
    )
    x, one = ca.MX.sym("x", structure.free.size), ca.MX.ones(1)
    strain = 2.0 * stress * (1.0 - nu) / modulus * one
    equations, zero = MembraneEquations(structure), ca.MX(0.0)
    assert equations.shared_names == ("D", "pressure", "along", "across", "shear")
    shared = {"D": modulus * h / (1.0 - nu**2) * one, "pressure": zero, "along": strain, "across": strain, "shear": zero}
    tangent = ca.Function(
        "tangent", [x], [ca.jacobian(equations.forces(x, shared, SimpleNamespace(), SimpleNamespace()).f, x)]
    )
    free = 3 * np.arange(len(structure.moving)) + 2
    K = -tangent(structure.mesh.nodes[structure.order].ravel()).sparse().toarray()[np.ix_(free, free)]
    root = np.sqrt(structure.mass[structure.moving])
    return np.sqrt(np.linalg.eigvalsh(K / root[:, None] / root)[:3] * density / stress)


@pytest.mark.parametrize(
    ("kind", "order", "sizes", "rate"), [("quad", 1, (4, 8), 2), ("triangle", 1, (4, 8), 2), ("quad9", 4, (1, 2), 4)]
)
def test_a_disc_has_the_frequencies_of_bessel_functions(kind, order, sizes, rate):
    exact = np.concatenate([jn_zeros(0, 1), np.repeat(jn_zeros(1, 1), 2)]) / 0.5
    edges = {"rim": lambda x, y, z: np.hypot(x, y) > 0.5 - 1e-9}
    errors = [np.abs(frequencies(meshed(disc(0.5), n, edges=edges, kind=kind), order) / exact - 1.0) for n in sizes]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(np.full(3, rate), abs=0.12)
    assert errors[1].max() < 4e-3


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_an_equilateral_triangle_has_the_frequencies_of_lame(kind):
    exact = 4.0 * np.pi / 3.0 * np.sqrt([3.0, 7.0, 7.0])  # m^2 + m n + n^2
    errors = [np.abs(frequencies(triangle(n, kind), 1) / exact - 1.0) for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(np.full(3, 2.0), abs=0.2)


def test_an_equilateral_triangle_of_order_6_has_the_frequencies_of_lame():
    exact = 4.0 * np.pi / 3.0 * np.sqrt([3.0, 7.0, 7.0])
    assert frequencies(triangle(1, "quad"), 6) == pytest.approx(exact, rel=1e-4)


def test_scaled_inertia_along_the_surface_takes_a_tenth_of_the_steps_and_keeps_transverse_motion():
    """A sail of 10 m, 2.5 um and 7 kPa for one period of its first frequency, after light falls on it; factor 100."""
    side, stress = 10.0, 7e3
    file = meshed([rectangle(side, side)], 8, edges=rim(side))
    film = Region(
        youngs_modulus=2.5e9, poisson_ratio=0.34, density=1400.0, thickness=2.5e-6, prestress=(stress, stress, 0.0)
    )
    histories, steps = [], []
    for factor in (1.0, 100.0):
        structure, model, _ = started(file, inplane_mass=factor, regions=(film,), supports=(Support(group="rim"),))
        middle = int(np.argmin(np.abs(structure.mesh.nodes[structure.moving] - [side / 2, side / 2, 0.0]).sum(axis=1)))
        model.set("pressure", 1e-5)
        history = []
        for _ in range(64):
            model.step(0.1)
            history.append(model.x[3 * middle + 2])
        histories.append(np.array(history))
        steps.append(model.get("max_step"))
    assert np.ptp(histories[0]) > 5e-3
    assert steps[1] > 9.0 * steps[0]
    assert np.linalg.norm(histories[1] - histories[0]) < 1.5e-3 * np.linalg.norm(histories[0])


def test_point_masses_keep_their_inertia_along_a_film_that_is_scaled():
    """A block of 100 times the film's mass between two strips, pulled along them: by the step, and by its period."""
    film = Region(youngs_modulus=1e6, poisson_ratio=0.0, density=1000.0, thickness=1e-3)
    middle = {"middle": lambda x, y, z: np.abs(x - 0.5) < 1e-9, "ends": lambda x, y, z: np.abs(x - 0.5) > 0.4}
    strip = meshed([rectangle(1.0, 0.1)], (8, 1), points=middle | {"all": lambda x, y, z: x > -1.0})
    mass = 10.0
    setup = {
        "regions": (film,),
        "supports": (Support(group="ends"), Support(group="all", fixed="yz")),
        "masses": (PointMass(group="middle", mass=mass),),
        "loads": (Load(name="pull", kind="force", groups=("middle",), direction=(1.0, 0.0, 0.0)),),
    }
    for factor in (1.0, 20.0):
        structure, model, _ = started(strip, inplane_mass=factor, **setup)
        model.set("pull", 1.0)  # on each of two nodes
        model.step(1e-5)
        there = [3 * int(np.flatnonzero(structure.moving == node)[0]) for node in structure.mesh.points["middle"]]
        v = model.x[3 * len(structure.moving) :][there]
        of_film = 1000.0 * 1e-3 * 0.1 / 8
        assert v * (mass + factor * of_film) / (2.0 * 1e-5) == pytest.approx([1.0, 1.0], rel=1e-6)
        stiffness = 2.0 * film.youngs_modulus * film.thickness * 0.1 / 0.5
        exact = 2.0 * np.pi * np.sqrt((mass + factor * 8.0 * of_film / 3.0) / stiffness)
        assert first_period(structure) == pytest.approx(exact, rel=5e-3)


WARNING = "The run goes on; this is logged once."


def test_a_membrane_that_starts_beyond_its_validity_says_so_once():
    """A micrometre of film at 10 kPa, found by initialization; a moved edge; a slack corner."""
    file = meshed([rectangle(1.0, 1.0)], 4, edges=rim(1.0))

    def warnings(thickness=1e-3, pressure=0.0, stretch=1.0):
        said = []
        film = Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=thickness)
        _, model, _ = started(
            file,
            said.append,
            mass_damping=20.0,
            regions=(film,),
            supports=(Support(group="rim", stretch=(stretch, stretch, 1.0)),),
            loads=(Load(name="pressure", start=pressure),),
        )
        before = list(said)
        model.step(1e-5)
        assert said == before
        assert all(text.endswith(WARNING) for text in said)
        return [text.split("'")[1] for text in said]

    assert warnings(stretch=1.02) == []
    assert warnings(stretch=0.9) == ["compressed_share"]
    assert warnings(stretch=1.7) == ["largest_strain"]
    assert warnings(stretch=10.0) == ["largest_strain", "displacement_ratio"]
    assert warnings(thickness=1e-6, pressure=1e4) == ["largest_strain", "displacement_ratio"]


def test_the_square_membrane_says_so_too():
    """It starts from the stretched plane, so what pressure does to a micrometre of film shows while it moves."""
    said = []
    square = Stepper(membrane_model(square_structure(4, 1)), edge_displacement=1000.0)
    square.warn = said.append
    square.initialize()
    assert [text.split("'")[1] for text in said] == ["largest_strain"]
    said.clear()
    square.reset()
    square.set("thickness", 1e-6)
    square.set("edge_displacement", 0.006)
    square.set("pressure", 1e4)
    square.initialize()
    assert said == []
    for _ in range(10):
        square.step(1e-4)
    assert [text.split("'")[1] for text in said] == ["largest_strain", "deflection_ratio"]
