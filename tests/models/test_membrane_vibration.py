"""Modes of membranes about their equilibria: closed forms, the step itself, other equilibria, refusals."""

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ConvergenceError, ParameterError
from gossamer_models.membrane import (
    Gas,
    Linearised,
    Load,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from oracles.meshes import disc, meshed, rectangle, rim, tube
from oracles.shells import shell
from scipy.special import jn_zeros

STRESS, DENSITY, THICKNESS = 1e5, 1000.0, 1e-3
FILM = {"youngs_modulus": 1e7, "poisson_ratio": 0.3, "density": DENSITY, "thickness": THICKNESS}
TAUT = Region(**FILM, prestress=(STRESS, STRESS, 0.0))
RIM = (Support(group="rim"),)
SPEED = np.sqrt(STRESS / DENSITY)  # of transverse waves [m/s]


def structure(patches, n, points, order=1, kind="quad", **setup):
    setup = {"regions": (TAUT,), "supports": RIM} | setup
    return make_structure(Setup(order=order, **setup), surface_mesh(meshed(patches, n, points=points, kind=kind), order))


def square(n, order=1, **setup):
    return structure([rectangle(1.0, 1.0)], n, rim(1.0), order, **setup)


def balloon(**setup):
    """A tube of film on two rings, blown up by gas behind caps that are not modelled."""
    points = {"ends": lambda x, y, z: (z < 1e-9) | (z > 0.6 - 1e-9)}
    sensors = (Sensor(point=(0.2, 0.0, 0.3), direction=(0.0, 1.0, 0.0)),)
    setup = {"gas": Gas(pressure=2e3, ambient=1e5, exponent=1.4, volume=0.07), "sensors": sensors} | setup
    setup |= {"regions": (Region(**FILM),), "supports": (Support(group="ends"),), "zones": (Zone(parts=5),)}
    return structure([tube(0.2, 0.6)], (12, 5), points, **setup)


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_a_prestressed_square_vibrates_as_in_closed_form_and_meshes_converge(kind):
    i, j = np.mgrid[1:6, 1:6]
    exact = np.sort(SPEED / 2.0 * np.hypot(i, j).ravel())[:6]
    errors = [np.abs(Linearised(square(n, kind=kind)).modes(6).frequencies / exact - 1.0).max() for n in (6, 12, 24)]
    assert errors[2] < 0.02
    assert np.all(np.array(errors[:2]) / errors[1:] > 3.3)  # second order
    assert Linearised(square(4, order=4)).modes(1).frequencies[0] == pytest.approx(exact[0], rel=1e-6)


def test_a_drum_vibrates_at_the_zeros_of_bessel_functions():
    drum = structure(disc(0.5), 6, {"rim": lambda x, y, z: np.hypot(x, y) > 0.5 - 1e-9}, kind="quad9", order=2)
    found = Linearised(drum).modes(6).frequencies
    zeros = [*jn_zeros(0, 2), *np.repeat(jn_zeros(1, 1), 2), *np.repeat(jn_zeros(2, 1), 2)]
    np.testing.assert_allclose(found, np.sort(zeros) * SPEED / (2.0 * np.pi * 0.5), rtol=2e-3)


def test_all_modes_together_have_the_mass_that_moves_along_and_about_every_axis():
    found = Linearised(square(4))
    modes = found.modes(len(found.free))
    np.testing.assert_allclose(modes.participation.T @ modes.participation, modes.moving, atol=1e-12)
    assert modes.moving[0, 0] == pytest.approx(DENSITY * THICKNESS * 9 / 16)


SPIN = Load(name="spin", kind="centrifugal", start=30.0, direction=(0.2, 0.1, 1.0), point=(0.3, 0.0, 0.0))


@pytest.mark.parametrize("made", [square_structure, balloon, lambda: square(4, loads=(Load(name="pressure"), SPIN))])
def test_modes_are_those_of_the_step_of_the_model(made):
    """The step's own derivative, at rest and over a short time, holds the tangent."""
    structure = made()
    found = Linearised(structure, {"pressure": 300.0})
    modes, model, h = found.modes(8), membrane_model(structure), 1e-7
    names = [v.name for v in model.variables]
    p = found.p.copy()
    p[[names.index(name) for name in ("pressure_amplitude", "mass_damping")]] = 0.0
    x = ca.MX.sym("x", model.n_states)
    start = np.array(model.at_rest.begin(found.u, p, found.q)[0]).ravel()
    dv = ca.jacobian(model.step.call([x, found.u, p, h], True, False)[0], x)
    n = found.q.size
    K = -np.array(ca.Function("step", [x], [dv])(start))[n : 2 * n, :n][np.ix_(found.free, found.free)] / h
    own = np.sort(np.linalg.eigvals(K).real)[:8]
    np.testing.assert_allclose(np.sqrt(own) / (2.0 * np.pi), modes.frequencies, rtol=1e-6)


@pytest.mark.parametrize("made", [balloon, lambda: square(6, zones=(Zone(parts=5),))])
def test_changes_by_damage_are_differences_to_other_equilibria(made):
    structure, d = made(), 1e-4
    modes = Linearised(structure, {"pressure": 50.0}).modes(5)
    found = modes.sensitivities()
    for zone in (0, 3):
        ends = [Linearised(structure, {"pressure": 50.0, f"damage[{zone + 1}]": x}).modes(5) for x in (0.0, d, 2.0 * d)]

        def change(of, at=ends):
            return (4.0 * of(at[1]) - 3.0 * of(at[0]) - of(at[2])) / (2.0 * d)  # one-sided, second order

        np.testing.assert_allclose(change(lambda m: np.log(m.frequencies)), found.frequency[:, zone], atol=2e-5)
        alone = ~np.isnan(found.strain[:, 0, zone]) if structure.n_sensors else []
        if np.any(alone):
            signs = [np.sign(np.sum(m.phi * modes.phi, axis=0))[:, None] for m in ends]
            strain = [sign * m.strain for sign, m in zip(signs, ends, strict=True)]
            wanted = (4.0 * strain[1] - 3.0 * strain[0] - strain[2]) / (2.0 * d)
            np.testing.assert_allclose(wanted[alone], found.strain[alone, :, zone], rtol=1e-3, atol=1e-3)


def test_what_cannot_vibrate_is_refused_by_name():
    with pytest.raises(ParameterError, match="28 modes of 27 degrees of freedom: ask for 1 to 27"):
        Linearised(square(4)).modes(28)
    pressed = Region(**FILM, prestress=(-STRESS, STRESS / 10.0, 0.0))
    with pytest.raises(ConvergenceError, match=r"unstable: \d+ of its modes have negative stiffness"):
        Linearised(square(6, regions=(pressed,))).modes(3)
    with pytest.raises(ConvergenceError, match="have no stiffness: the film is slack"):
        Linearised(square(6, regions=(Region(**FILM),))).modes(3)
    with pytest.raises(ConvergenceError, match="no equilibrium to vibrate about"):
        Linearised(shell("plate"), {"force": -1e5})


def test_a_load_that_stretches_the_film_raises_its_frequencies():
    sheet = square(8, loads=(Load(name="pressure"),))
    slow, fast = (Linearised(sheet, {"pressure": p}).modes(1).frequencies[0] for p in (0.0, 500.0))
    assert fast > 1.05 * slow
