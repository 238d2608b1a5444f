"""The membrane elements and their assembly: patch test, invariance, energy, tangent, mesh."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from gossamer_models.membrane import MembraneParams
from gossamer_models.membrane.element import balance, element_points, tangents
from gossamer_models.membrane.geometry import geometry
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import membrane as textbook
from oracles.membrane import energy_function, equations
from scipy.spatial.transform import Rotation

E, NU = 1e7, 0.33
ORDERS = pytest.mark.parametrize("order", [1, 2, 3])
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
# unit square of five distorted quadrilaterals around an inner one, the usual patch
PATCH_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.3, 0.2], [0.75, 0.3], [0.65, 0.7], [0.2, 0.6]], dtype=float)
PATCH = np.array([[0, 1, 4, 5], [1, 2, 5, 6], [2, 3, 6, 7], [3, 0, 7, 4], [4, 5, 7, 6]])


class SingleElement:
    """One element between four corners, and the textbook's."""

    def __init__(self, order, corners):
        self.X = X = textbook.element_nodes(order, corners)
        m = len(X)
        x, load = ca.SX.sym("x", 3, m), ca.SX.sym("load")
        D = E / (1.0 - NU**2)
        element = geometry(np.column_stack([X, np.zeros(m)])[None], order, "st_venant_kirchhoff", np.eye(3)[:1]).placed()
        shared = {"D": D, "nu": NU, "pressure": load}
        at = element_points(tangents(ca.vertsplit(ca.vec(x.T), m), element), element, ca.DM(element.w), shared)
        f, wave = balance(at.P, at.load, element), D * at.wave
        energy = textbook.element_energy(x, X, E, NU)
        definition = textbook.element_force(x, X, E, NU, load)
        self.force = ca.Function("f", [x, load], [ca.reshape(f, m, 3).T, ca.mmax(wave), energy, definition])


@cache
def square(order):
    return SingleElement(order, SQUARE)


@cache
def patch(order):
    """The elements of the patch, its nodes, and the nodes of each element."""
    elements = [SingleElement(order, PATCH_CORNERS[corners]) for corners in PATCH]
    nodes, places = np.unique(np.round([element.X for element in elements], 12).reshape(-1, 2), axis=0, return_inverse=True)
    return elements, nodes, places.reshape(len(elements), -1)


def patch_force(order, F, load=0.0):
    elements, nodes, places = patch(order)
    total = np.zeros((len(nodes), 3))
    for element, place in zip(elements, places, strict=True):
        total[place] += np.asarray(element.force(F @ element.X.T, load)[0]).T
    return nodes, total


def first_piola(F):
    e = (F.T @ F - np.eye(2)) / 2.0
    return F @ (E / (1.0 - NU**2) * ((1.0 - NU) * e + NU * np.trace(e) * np.eye(2)))


@ORDERS
def test_a_patch_of_distorted_elements_carries_a_homogeneous_state(order):
    """Interior nodes feel nothing; the edges feel the exact stress."""
    F = np.array([[1.10, 0.05], [-0.03, 1.02], [0.20, -0.10]])
    nodes, f = patch_force(order, F)
    inside = ((nodes > 0.0) & (nodes < 1.0)).all(axis=1)
    assert inside.sum() == {1: 4, 2: 17, 3: 40}[order]
    assert np.abs(f[inside]).max() < 1e-9 * E
    right = f[nodes[:, 0] == 1.0].sum(axis=0) - f[nodes[:, 0] == 0.0].sum(axis=0)  # corners share top and bottom equally
    np.testing.assert_allclose(right, -2.0 * first_piola(F)[:, 0], atol=1e-12 * E)


@ORDERS
def test_pressure_on_a_plane_patch_sums_to_pressure_times_current_area(order):
    F = np.array([[1.10, 0.05], [-0.03, 1.02], [0.20, -0.10]])
    f = patch_force(order, F, 3.0)[1] - patch_force(order, F, 0.0)[1]
    np.testing.assert_allclose(f.sum(axis=0), 3.0 * np.cross(F[:, 0], F[:, 1]), atol=1e-15 * E)


angles = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3)
seeds = st.integers(0, 2**32 - 1)


def moved(X, seed):
    """Move every node by up to 0.3 along x, y and z, shape (3, m)."""
    return np.vstack([X.T, np.zeros(len(X))]) + np.random.default_rng(seed).uniform(-0.3, 0.3, (3, len(X)))


@ORDERS
@settings(max_examples=30, deadline=None)
@given(rotation=angles, shift=st.lists(st.floats(-10, 10), min_size=3, max_size=3))
def test_a_rigid_motion_gives_no_force(order, rotation, shift):
    element = square(order)
    x = Rotation.from_rotvec(rotation).as_matrix()[:, :2] @ element.X.T + np.array(shift)[:, None]
    f, _, energy, _ = element.force(x, 0.0)
    assert np.abs(f).max() < 1e-11 * E
    assert float(energy) < 1e-12 * E


@ORDERS
@settings(max_examples=30, deadline=None)
@given(rotation=angles, seed=seeds)
def test_force_turns_with_the_element_and_carries_no_resultant_or_moment(order, rotation, seed):
    """Objectivity, and balance of linear and angular momentum of the internal forces."""
    element = square(order)
    x = moved(element.X, seed)
    R = Rotation.from_rotvec(rotation).as_matrix()
    f, turned = (np.asarray(element.force(y, 0.0)[0]) for y in (x, R @ x))
    np.testing.assert_allclose(turned, R @ f, atol=1e-10 * E)
    np.testing.assert_allclose(f.sum(axis=1), 0.0, atol=1e-11 * E)
    np.testing.assert_allclose(np.cross(x.T, f.T).sum(axis=0), 0.0, atol=1e-11 * E)


@ORDERS
@settings(max_examples=10, deadline=None)
@given(seed=seeds, load=st.floats(-1e5, 1e5))
def test_the_force_is_the_pressure_minus_the_gradient_of_the_energy(order, seed, load):
    """Operators along the sides against shape functions and an energy, on a square and on distorted elements."""
    for element in [square(order), *patch(order)[0]]:
        f, _, _, definition = (np.asarray(result) for result in element.force(moved(element.X, seed), load))
        np.testing.assert_allclose(f, definition, rtol=0.0, atol=1e-12 * max(E, np.abs(f).max()))


@ORDERS
def test_the_wave_stiffness_of_a_uniaxial_stretch_is_the_exact_one(order):
    """lambda^2 E/(1-nu^2) + S along the stretch, with S = E/(1-nu^2) (lambda^2 - 1)/2 when the other strain is zero."""
    stretch, element = 1.2, square(order)
    x = np.vstack([element.X.T * [[stretch], [1.0]], np.zeros(len(element.X))])
    exact = E / (1.0 - NU**2) * (stretch**2 + (stretch**2 - 1.0) / 2.0)
    assert float(element.force(x, 0.0)[1]) == pytest.approx(exact, rel=1e-11)


MESHES = pytest.mark.parametrize(("n", "order"), [(4, 1), (4, 3), (4, 4)])


@MESHES
def test_the_assembled_tangent_is_the_derivative_of_the_force(n, order):
    mesh = equations(n, order)
    rng = np.random.default_rng(0)
    q, direction = 0.003 * rng.standard_normal((2, mesh.n_q))
    damage, p, h = rng.uniform(0.0, 0.6, 16), MembraneParams().vector(), 1e-5

    def force(q):
        return np.asarray(mesh.force(q, damage, 1e4, p)).ravel()

    difference = (force(q + h * direction) - force(q - h * direction)) / (2.0 * h)
    product = -np.asarray(mesh.tangent(q, damage, 1e4, p) @ ca.DM(direction)).ravel()
    np.testing.assert_allclose(product, difference, atol=1e-8 * np.abs(difference).max())


@MESHES
def test_the_assembled_force_is_minus_the_gradient_of_the_assembled_energy(n, order):
    mesh, params = equations(n, order), MembraneParams()
    energy = energy_function(mesh.mesh, params)
    rng = np.random.default_rng(1)
    q, direction = 0.003 * rng.standard_normal((2, mesh.n_q))
    damage, h = rng.uniform(0.0, 0.6, 16), 1e-5
    slope = (energy(q + h * direction, damage) - energy(q - h * direction, damage)) / (2.0 * h)
    power = float(ca.dot(mesh.force(q, damage, 0.0, params.vector()), ca.DM(direction)))
    assert slope == pytest.approx(-power, rel=1e-7)


@pytest.mark.parametrize(("n", "order"), [(8, 1), (4, 4)])
def test_the_stretched_plane_is_an_equilibrium_at_zero_displacement(n, order):
    f = equations(n, order).force(np.zeros(equations(n, order).n_q), np.zeros(16), 0.0, MembraneParams().vector())
    assert np.abs(f).max() < 1e-12 * 1e7 * 1e-3 * 0.0735


def test_both_mass_matrices_hold_the_same_mass_per_node_far_from_the_edges():
    mesh, params = equations(8), MembraneParams()
    centre = 3 * mesh.mesh.centre
    lumped, consistent = mesh.lumped_mass(params), mesh.consistent_mass(params)
    exact = 1100.0 * 0.001 * (0.588 / 8) ** 2
    assert lumped.diagonal()[centre] == pytest.approx(exact, rel=1e-14)
    assert consistent[centre].sum() == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("order", [1, 4])
def test_zones_are_numbered_row_by_row_with_x_fastest(order):
    mesh = equations(8, order).mesh
    centres = mesh.nodes[mesh.elements].mean(axis=1)
    expected = np.floor(centres[:, 0] * 4) + 4 * np.floor(centres[:, 1] * 4)
    np.testing.assert_array_equal(mesh.zone, expected)
    assert tuple(mesh.nodes[mesh.interior[mesh.centre]]) == (0.5, 0.5)
