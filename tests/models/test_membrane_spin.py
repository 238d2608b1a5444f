"""Films that spin: closed forms of their vibrations, their equilibrium, what a frame that flies takes in their place."""

import numpy as np
import pytest
from gossamer_models import Stepper, simulate
from gossamer_models.membrane import Linearised, Load, Region, Setup, Support, make_structure, membrane_model, surface_mesh
from gossamer_models.mistakes import DescriptionError
from oracles.meshes import annulus, disc, meshed
from oracles.spinning import free_disc, hubbed_disc, stresses

RATE, RADIUS, HUB, NU = 20.0, 0.5, 0.2, 0.3  # [rad/s], [m], share of it, [1]
FILM = Region(youngs_modulus=3e9, poisson_ratio=NU, density=1400.0, thickness=1e-5)
SPIN = Load(name="spin", kind="centrifugal", start=RATE)


def spinning(patches, n, held, order=4, **changes):
    points = {name: where for name, (where, _) in held.items()}
    supports = tuple(Support(group=name, fixed=fixed) for name, (_, fixed) in held.items())
    setup = Setup(**{"order": order, "regions": (FILM,), "supports": supports, "loads": (SPIN,)} | changes)
    return make_structure(setup, surface_mesh(meshed(patches, n, points=points, kind="quad9"), order))


def on_a_hub(n, **changes):
    held = {"hub": (lambda x, y, z: np.hypot(x, y) < HUB * RADIUS + 1e-9, "xyz")}
    return spinning([annulus(HUB * RADIUS, RADIUS)], n, held, **changes)


def at_its_centre(n, held="xyz", **changes):
    centre = {"centre": (lambda x, y, z: np.hypot(x, y) < 1e-9, held), "side": (lambda x, y, z: x > RADIUS - 1e-9, "y")}
    return spinning(disc(RADIUS), n, centre, **changes)


def squares(structure, count):
    modes = Linearised(structure).modes(count)
    return modes.squares / RATE**2, modes.effective_masses[:, 2]


def test_a_disc_on_a_hub_vibrates_as_its_differential_equation_and_meshes_converge():
    by_diameters = [np.repeat(hubbed_disc(n, HUB, NU, 3), 1 + (n > 0)) for n in range(7)]
    exact = np.sort(np.concatenate(by_diameters))[:9]
    coarse, fine = (np.abs(squares(on_a_hub(n), 9)[0] / exact - 1.0).max() for n in ((8, 2), (12, 3)))
    assert fine < 2e-4
    assert coarse > 10.0 * fine


def test_a_disc_held_at_its_centre_vibrates_as_lamb_and_southwell_found():
    found, along = squares(at_its_centre(2), 14)
    shown = found[along < 1e-9]  # with nodal diameters, and so no motion of the centre
    exact = sorted(free_disc(n, s, NU) for n in (1, 2, 3, 4, 5) for s in (0, 1) for _ in range(2))[: len(shown)]
    np.testing.assert_allclose(shown, exact, rtol=3e-3)
    np.testing.assert_allclose(shown[:2], 1.0, rtol=1e-7)  # it tilts at the rate of spin, on any mesh


def test_it_starts_in_the_stress_of_its_spin():
    structure = on_a_hub((12, 3))
    away = Linearised(structure).displacement
    r = np.hypot(*structure.mesh.nodes[:, :2].T)
    radial, hoop = stresses(r / RADIUS, HUB, NU)
    scale = FILM.density * (RATE * RADIUS) ** 2
    wanted = r * (hoop - NU * radial) * scale / FILM.youngs_modulus
    np.testing.assert_allclose(np.hypot(*away[:, :2].T), wanted, atol=2e-3 * wanted.max())


def test_a_spin_about_another_axis_is_that_of_the_film_turned():
    about = Load(name="spin", kind="centrifugal", start=RATE, direction=(0.0, 3.0, 0.0), point=(0.1, 0.0, 0.0))
    ring = annulus(HUB * RADIUS, RADIUS)

    def turned(s, t):
        x, y, z = ring(s, t)
        return 0.1 + y, z, x

    held = {"hub": (lambda x, y, z: np.hypot(x - 0.1, z) < HUB * RADIUS + 1e-9, "xyz")}
    found, _ = squares(spinning([turned], (8, 2), held, loads=(about,)), 4)
    np.testing.assert_allclose(found, squares(on_a_hub((8, 2)), 4)[0], rtol=1e-9)


def test_a_film_that_spins_rests_in_its_axes():
    stepper = Stepper(membrane_model(on_a_hub((8, 2), order=2)))
    stepper.initialize()
    away = simulate(stepper, 20 * [1e-4], {}, ["displacement"])["displacement"]
    assert away[0] > 1e-6
    np.testing.assert_allclose(away, away[0], rtol=1e-9)


def test_what_cannot_spin_is_refused():
    with pytest.raises(DescriptionError, match="'groups' belongs to loads that do not act on all masses"):
        Load(name="spin", kind="centrifugal", groups=("hub",))
    with pytest.raises(DescriptionError, match="free to move about x as a rigid body"):
        at_its_centre(2, loads=(Load(name="spin", kind="centrifugal"),))
    with pytest.raises(DescriptionError, match=r"free to move about [xyz] as a rigid body"):  # spin tips it out of its plane
        at_its_centre(2, loads=(Load(name="spin", kind="centrifugal", start=RATE, direction=(1.0, 0.0, 0.0)),))
    with pytest.raises(DescriptionError, match="free to move along z as a rigid body"):
        at_its_centre(2, held="xy")
    with pytest.raises(DescriptionError, match="a frame that flies turns the membrane itself"):
        membrane_model(on_a_hub((8, 2)), frame=True)
