"""Spectral elements: their rule, their interpolation, convergence with the order, and the default membrane on them."""

import numpy as np
import pytest
from gossamer_models import ParameterError, simulate
from gossamer_models.membrane import MembraneEquations, MembraneParams, square_structure
from gossamer_models.membrane.element import derivative_matrix, gauss_points, lobatto_points, value_matrix
from gossamer_models.membrane.gauges import gauge, place_matrix
from gossamer_models.membrane.square import stretch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.membrane import LOBATTO, equations, membrane, motion, started, vectors
from oracles.modal import natural_frequencies
from oracles.statics import static_deflection

STRAINS = [f"strain[{k}]" for k in range(1, 5)]
UNDAMPED = MembraneParams(mass_damping=0.0)


@pytest.fixture(scope="module")
def model():
    return membrane(4, 4)


def relative(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def integral(degree):
    """Integrate x^degree over [-1/2, 1/2]."""
    return 0.5**degree / (degree + 1) if degree % 2 == 0 else 0.0


@pytest.mark.parametrize("n", range(2, 14))
@pytest.mark.parametrize(("rule", "highest"), [(gauss_points, lambda n: 2 * n - 1), (lobatto_points, lambda n: 2 * n - 3)])
def test_a_rule_is_exact_to_its_degree_and_no_further(rule, highest, n):
    points, weights = rule(n)
    for degree in range(highest(n) + 1):
        assert weights @ points**degree == pytest.approx(integral(degree), abs=1e-15)
    beyond = highest(n) + 1
    assert abs(weights @ points**beyond - integral(beyond)) > 1e-3 * integral(beyond) / 4.0**n
    assert (weights > 0.0).all()
    np.testing.assert_array_equal(points, -points[::-1])


@pytest.mark.parametrize("order", LOBATTO)
def test_lobatto_rules_are_those_of_the_table(order):
    points, weights = lobatto_points(order + 1)
    np.testing.assert_allclose(2.0 * points, LOBATTO[order][0], atol=1e-15)
    np.testing.assert_allclose(2.0 * weights, LOBATTO[order][1], atol=1e-15)


@given(order=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_interpolation_of_a_polynomial_and_its_slope_is_exact(order, seed):
    rng = np.random.default_rng(seed)
    polynomial = np.polynomial.Polynomial(rng.uniform(-1.0, 1.0, order + 1))
    nodes, points = lobatto_points(order + 1)[0], rng.uniform(-0.5, 0.5, 7)
    np.testing.assert_allclose(value_matrix(nodes, points) @ polynomial(nodes), polynomial(points), atol=1e-13)
    slopes = derivative_matrix(nodes, points) @ polynomial(nodes)
    np.testing.assert_allclose(slopes, polynomial.deriv()(points), atol=1e-11)


@settings(max_examples=20, deadline=None)
@given(x=st.floats(0.0, 1.0), y=st.floats(0.0, 1.0), order=st.sampled_from([1, 3, 4]))
def test_a_field_of_the_order_of_the_elements_is_read_exactly_anywhere(x, y, order):
    mesh = square_structure(4, order, params=MembraneParams(side_length=1.0)).mesh
    field, at = (mesh.nodes[:, 0] - 0.3) ** order * (mesh.nodes[:, 1] + 0.2) ** order, np.array([x, y, 0.0])
    (value,) = place_matrix(mesh, [at]) @ field
    along_x, along_y = ((gauge(mesh, at, axis, 0.0).lines @ field)[0] for axis in np.eye(3)[:2])
    assert value == pytest.approx((x - 0.3) ** order * (y + 0.2) ** order, abs=1e-14)
    assert along_x == pytest.approx(order * (x - 0.3) ** (order - 1) * (y + 0.2) ** order, abs=1e-12)
    assert along_y == pytest.approx(order * (x - 0.3) ** order * (y + 0.2) ** (order - 1), abs=1e-12)


def test_the_mass_is_diagonal_by_itself():
    mesh, params = equations(4, 4), MembraneParams()
    consistent, lumped = mesh.consistent_mass(params), mesh.lumped_mass(params)
    assert abs(consistent - lumped).max() < 1e-15 * lumped.max()
    whole = 1100.0 * 0.001 * 0.588**2
    assert square_structure().mesh.nodes.shape == (289, 3)
    assert lumped.diagonal()[::3].sum() < whole  # the rest is on the edges
    assert lumped.diagonal()[::3].sum() == pytest.approx(whole * (1.0 - 2.0 * 0.1 / 8.0) ** 2, rel=1e-12)


def test_the_first_frequency_converges_with_the_order():
    """A stretched membrane: f = sqrt(2)/(2 L) sqrt(S/rho), S = E/(1-nu) (lambda^2-1)/2, in reference lengths."""
    S = 1e7 / (1.0 - 0.33) * (stretch(UNDAMPED) ** 2 - 1.0) / 2.0
    exact = np.sqrt(2.0) / (2.0 * 0.588) * np.sqrt(S / 1100.0)
    errors = [abs(natural_frequencies(equations(4, order), UNDAMPED, count=1)[0] / exact - 1.0) for order in (2, 3, 4)]
    assert errors[0] < 4e-3
    assert errors[1] < errors[0] / 30.0
    assert errors[2] < errors[1] / 30.0
    assert errors[2] < 1e-6


@pytest.mark.parametrize(("pressure", "deflection"), [(1e3, 0.050053), (1e4, 0.139506)])
def test_the_static_deflection_is_that_of_another_program(pressure, deflection):
    """The reference is a bilinear 64 x 64 mesh, extrapolated; order 4 is 0.02 % from it."""
    mesh = equations(4, 4)
    w = static_deflection(mesh, UNDAMPED, pressure)[3 * mesh.mesh.centre + 2]
    assert w == pytest.approx(deflection, rel=3e-4)


@pytest.mark.parametrize("order", [1, 4])
def test_the_form_for_compilation_gives_the_same_numbers(order):
    """Its loop by hand: one element's function, and the sum at its nodes."""
    columns = equations(4, order)
    rng = np.random.default_rng(0)
    q, damage, p = 0.005 * rng.standard_normal(columns.n_q), rng.uniform(0.0, 0.9, 16), MembraneParams().vector()
    f, side = np.asarray(columns.force(q, damage, 1e4, p)).ravel(), 0.588 / 4
    (loop,) = MembraneEquations(columns.structure, compiled=True).tables.loops
    x = (columns.places(q) - [0.294, 0.294, 0.0])[columns.structure.order] / side
    same = np.zeros_like(x)
    for nodes, shared, own in zip(loop.nodes, loop.shared, loop.own, strict=True):
        D = 1e7 * 1e-3 * (1.0 - [*damage, 0.0][columns.structure.zone[shared]]) / (1.0 - 0.33**2)
        each, *_ = loop.function(x[nodes].T.ravel(), [D, 1e4 * side, 0.33], own)
        same[nodes] += side * np.asarray(each).reshape(3, -1).T
    np.testing.assert_allclose(f, same.ravel()[: columns.n_q], rtol=0.0, atol=1e-13 * np.abs(f).max())


def test_grid_points_on_nodes_are_those_nodes(model):
    """With an even order every eighth of the side is a node."""
    u, p = vectors(model, pressure=500.0)
    x, _ = model.init(u, p)
    for _ in range(50):
        x, y = model.step(x, u, p, 7e-5)
    q, _ = motion(model, x)
    mesh, results = equations(4, 4).mesh, dict(zip(model.names[model.slices()[2]], np.asarray(y).ravel(), strict=True))
    place = {tuple(np.round(8 * mesh.nodes[node], 9)): k for k, node in enumerate(mesh.interior)}
    for i, j in ((1, 1), (2, 5), (4, 4), (7, 3)):
        assert results[f"w[{i},{j}]"] == pytest.approx(q[3 * place[i, j] + 2], abs=1e-15)
    assert results["deflection"] == results["w[4,4]"]
    assert results["deflection_ratio"] == pytest.approx(max(abs(q[2::3])) / 0.588, rel=0.02)


def test_the_default_history_is_close_to_one_of_higher_order(model):
    """The whole study is docs/membrane.md: 1.5 % over 0.3 s against order 8. Here 1.0 % over 0.1 s."""
    runs = [simulate(started(each), 333 * [3e-4], {}, STRAINS) for each in (membrane(8), membrane(4, 4), membrane(4, 6))]
    bilinear, default, finer = (np.array([run[name] for name in STRAINS]) - 0.012 / 0.588 for run in runs)
    assert relative(default, finer) < 0.012
    assert relative(bilinear, finer) > 5.0 * relative(default, finer)


@pytest.mark.parametrize("order", [0, 13, -1, 2.0, True, "4"])
def test_an_order_that_there_is_not_is_refused(order):
    with pytest.raises(ParameterError, match="1 for bilinear elements, or 2 to 12"):
        square_structure(4, order)
