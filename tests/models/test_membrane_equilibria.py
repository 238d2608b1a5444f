"""Equilibria by Newton's method against relaxation, and their derivatives against differences."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ParameterError
from gossamer_models.membrane import (
    Equilibrium,
    Region,
    Setup,
    Support,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from oracles.meshes import disc, meshed
from oracles.shells import SHELLS, shell

# where relaxation stops moves a slack film across its plane by more than it moves a taut one
ALIKE = {"film": 1e-8, "balloon": 3e-9, "plate": 3e-9}


def made(structure):
    return Equilibrium(structure, membrane_model(structure))


@pytest.fixture(scope="module", params=SHELLS)
def named(request):
    structure = shell(request.param)
    return request.param, structure, made(structure)


def damages(structure, cases, most=0.5):
    rng = np.random.default_rng(2)
    return rng.uniform(0.0, most, (cases, structure.n_zones))


def test_newton_reaches_what_relaxation_reaches(named):
    name, structure, equilibrium = named
    found = equilibrium.solve({"damage": damages(structure, 2)})
    model = membrane_model(structure)
    for u, p, q, x in zip(found.u, found.p, found.q, found.x, strict=True):
        state, results = model.init(u, p)
        relaxed = np.asarray(state).ravel()
        np.testing.assert_allclose(q, relaxed[: q.size], atol=ALIKE[name])
        np.testing.assert_allclose(x, relaxed, atol=10.0 * ALIKE[name])
    strain = [float(results[k]) for k in range(structure.n_sensors)]  # outputs come first
    np.testing.assert_allclose(found.strain[-1], strain, atol=10.0 * ALIKE[name])


def test_derivatives_are_the_limit_of_differences(named):
    _, structure, equilibrium = named
    damage = damages(structure, 1)
    names, change = ["damage", "youngs_modulus[1]", structure.setup.loads[-1].name], 1e-4
    found = equilibrium.solve({"damage": damage})
    slopes = equilibrium.derivatives(found, names)
    assert slopes.strain.shape == (1, structure.n_zones + 2, structure.n_sensors)
    directions = [("damage", {"damage": np.eye(structure.n_zones)[:1]}, 0)]
    directions += [(name, None, structure.n_zones + i) for i, name in enumerate(names[1:])]
    start = {v.name: v.start for v in membrane_model(structure).variables}
    for name, moved, row in directions:
        size = 1.0 if moved else start[name]
        both = []
        for sign in (-1.0, 1.0):
            given = {"damage": damage}
            given |= {name: damage + sign * change * moved["damage"]} if moved else {name: size * (1.0 + sign * change)}
            both.append(equilibrium.solve(given))
        for what in ("strain", "displacement"):
            difference = (getattr(both[1], what) - getattr(both[0], what))[0] / (2.0 * change * size)
            slope = getattr(slopes, what)[0, row]
            np.testing.assert_allclose(slope, difference, atol=2e-5 * np.abs(difference).max())


def test_the_tangent_is_the_derivative_of_the_forces(named):
    _, structure, equilibrium = named
    found = equilibrium.solve({"damage": damages(structure, 1)})
    balance = equilibrium.newton.balance
    direction = np.random.default_rng(0).standard_normal(len(equilibrium.free))
    u, p, q = found.u[0], found.p[0], found.q[0]
    step = np.zeros_like(q)
    step[equilibrium.free] = 1e-9 * np.ptp(structure.mesh.nodes) * direction / np.abs(direction).max()
    ends = [np.asarray(balance(u, p, q + sign * step)[0]).ravel()[equilibrium.free] for sign in (-1.0, 1.0)]
    product = -2.0 * (equilibrium.tangent(found, 0) @ step[equilibrium.free])
    np.testing.assert_allclose(ends[1] - ends[0], product, atol=1e-5 * np.abs(product).max())


def test_a_case_depends_on_no_other(named):
    _, structure, equilibrium = named
    damage = damages(structure, 3)
    together = equilibrium.solve({"damage": damage})
    alone = pickle.loads(pickle.dumps(equilibrium)).solve({"damage": damage[2:]})
    np.testing.assert_array_equal(together.q[2], alone.q[0])


def test_a_pressed_square_starts_from_its_plane():
    """Its own start leaves the pressure out; where Newton's method fails nothing stands in for it."""
    square = square_structure(4, 1)
    equilibrium = made(square)
    found = equilibrium.solve({"pressure": [0.0, 200.0], "damage": np.full(16, 0.2)})
    balance = equilibrium.newton.balance
    for case in range(2):
        f, _ = balance(found.u[case], found.p[case], found.q[case])
        assert float(ca.norm_inf(f)) < 1e-11 * float(found.p[case].max())
    assert np.abs(found.q[0, 2::3]).max() == 0.0 < found.q[1, 2::3].min()


def test_states_of_a_second_record_start_from_those_of_the_first():
    """A flat film that is blown up is left to relaxation, which takes a hundred times as long as Newton's steps."""
    film = Region(youngs_modulus=3e9, poisson_ratio=0.3, density=1400.0, thickness=25e-6, prestress=(2e6, 2e6, 0.0))
    rim = (Support(group="rim", stiffness=4e4),)
    setup = Setup(regions=(film,), supports=rim, factors=("thickness", "prestress"))
    file = meshed(disc(1.5), 2, points={"rim": lambda x, y, z: np.hypot(x, y) > 1.5 - 1e-9})
    equilibrium = made(make_structure(setup, surface_mesh(file, 2)))
    relaxed, relax = [], equilibrium._relaxed
    equilibrium._relaxed = lambda u, p: relaxed.append(u) or relax(u, p)
    pressure = np.array([17.0, 70.0])  # [Pa], roughly 16 and 64
    counts = []
    for factor, thickness in ((1.0, 1.0), (1.02, 1.04), (0.97, 1.04), (1.03, 0.96)):
        found = equilibrium.solve({"pressure": factor * pressure, "thickness_factor": thickness})
        assert not found.failed.any()
        counts.append(len(relaxed))
    assert counts[-1] == counts[0]


def test_threads_may_share_what_finds_equilibria():
    structure = shell("balloon")
    shared, cases = made(structure), np.split(damages(structure, 40), 2)
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda each: shared.solve({"damage": each}).q, cases))
    np.testing.assert_array_equal(found, [made(structure).solve({"damage": each}).q for each in cases])


def test_a_membrane_that_its_load_tears_has_no_equilibrium():
    found = made(shell("plate")).solve({"force": [0.0, -1e5]})
    assert found.failed.tolist() == [False, True]
    assert np.isnan(found.x[1]).all()
    assert np.isnan(found.strain[1]).all()


def test_a_model_of_loops_is_refused():
    square = square_structure(4, 1)
    with pytest.raises(ParameterError, match="membrane's own model"):
        Equilibrium(square, membrane_model(square, compiled=True))
