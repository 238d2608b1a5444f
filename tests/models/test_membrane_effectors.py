"""Reduced membranes as flex files of 42 and as masses on springs: what they do to a frame that shakes."""

import numpy as np
import pytest
from gossamer_models.membrane import Linearised, flex_file, node_file, reduce_membrane, spring_masses, square_structure


@pytest.fixture(scope="module")
def reduced():
    """The square under a pressure, off its centre: some modes only turn it, others do both."""
    structure = square_structure(4, 2)
    damaged = {"damage[1]": 0.4, "damage[2]": 0.3, "pressure": 50.0, "mass_damping": 3.0}
    return reduce_membrane(Linearised(structure, damaged).modes(6), [41, 7])


def read_flex(text):
    """Read a flex file line by line in the order of 42's own reader, whose comments begin with an exclamation mark."""
    lines = iter(text.splitlines())

    def numbers():
        return [float(word) for word in next(lines).partition("!")[0].split()]

    def skip(count=1):
        for _ in range(count):
            next(lines)

    def sparse(shape):
        found = np.zeros(shape)
        for _ in range(int(numbers()[0])):
            *place, value = numbers()
            found[tuple(map(int, place))] = value
        return found

    skip(2)
    n = int(numbers()[0])
    skip(1 + n)
    joint = []
    for _ in range(2):
        skip(1 + (not joint))
        joint.append(sparse((n, 1, 3)))
    skip(2)
    psi = sparse((n, 2, 3))
    skip()
    theta = sparse((n, 2, 3))
    matrices = []
    for _ in range(3):
        skip()
        matrices.append(sparse((n, n)))
    integrals = []
    for _ in range(2):
        skip()
        integrals.append(np.array([numbers() for _ in range(n)]))
    for _ in range(2):
        skip()
        assert numbers() == [0]
    assert next(lines) == "[EOF]"
    assert not any(each.any() for each in (*joint, theta))
    return psi, *matrices, *integrals


def test_a_reader_of_42_finds_the_modes(reduced):
    psi, M, K, C, P, H = read_flex(flex_file(reduced, "Square"))
    modes = reduced.modes
    np.testing.assert_array_equal(psi, modes.shapes[:, [40, 6]])
    np.testing.assert_array_equal(M, np.eye(6))
    np.testing.assert_array_equal(np.sqrt(np.diag(K)) / (2.0 * np.pi), modes.frequencies)
    np.testing.assert_array_equal(C, 3.0 * np.eye(6))
    np.testing.assert_array_equal(np.hstack([P, H]), modes.participation)


def test_momentum_integrals_are_sums_over_the_nodes(reduced):
    """Of mass times shape, and of its moment about the membrane's own origin, at the equilibrium."""
    *_, P, H = read_flex(flex_file(reduced, "Square"))
    known = reduced.modes.linearised
    structure, shapes = known.structure, reduced.modes.shapes
    weighted = structure.mass[:, None] * shapes
    places = structure.mesh.nodes - structure.origin + known.displacement
    np.testing.assert_allclose(P, weighted.sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(H, np.cross(places, weighted).sum(axis=1), atol=1e-12)


def test_nodes_of_42_lie_where_the_membrane_rests(reduced):
    lines = node_file(reduced, "Square").splitlines()
    assert lines[2].split()[0] == "2"
    known = reduced.modes.linearised
    places = known.structure.mesh.nodes - known.structure.origin + known.displacement
    for line, node in zip(lines[4:], (41, 7), strict=True):
        np.testing.assert_allclose([float(word) for word in line.split()[:3]], places[node - 1], rtol=1e-15)
        assert line.endswith(f'"node {node}"')


def test_masses_on_springs_push_their_frame_as_the_modes_do(reduced):
    """What a frame feels that shakes along and about its axes at any frequency, but for the twist about each direction."""
    springs, L = spring_masses(reduced), reduced.modes.participation
    assert springs.mode.tolist() == [1, 2, 3, 4, 5, 6]
    kept = L[springs.mode - 1].copy()
    twist = np.sum(kept[:, 3:] * springs.direction, axis=1)
    np.testing.assert_allclose(springs.lost, np.abs(twist) / np.linalg.norm(kept[:, 3:], axis=1), atol=1e-9)
    kept[:, 3:] -= twist[:, None] * springs.direction
    squares = reduced.modes.squares[springs.mode - 1]
    for s in 2j * np.pi * np.array([3.0, 9.0, 40.0]):
        modal = kept.T @ (kept * (s**2 / (s**2 + 3.0 * s + squares))[:, None])
        each = np.zeros((6, 6), dtype=complex)
        for m, r, e, k, c in zip(
            springs.mass, springs.place, springs.direction, springs.stiffness, springs.damping, strict=True
        ):
            along = np.concatenate([e, np.cross(r, e)])  # what a unit of force on it is for the frame
            each += m * np.outer(along, along) * (m * s**2 / (m * s**2 + c * s + k))
        np.testing.assert_allclose(each, modal, atol=1e-9 * np.abs(modal).max())


def test_modes_that_only_turn_their_frame_are_no_masses_on_springs():
    """Of a whole flat square: one half goes up while the other goes down."""
    whole = reduce_membrane(Linearised(square_structure(4, 2)).modes(3))
    assert spring_masses(whole).mode.tolist() == [1]
    assert np.abs(whole.modes.participation[1:, 3:]).max() > 0.01
