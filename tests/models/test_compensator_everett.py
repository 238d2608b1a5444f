"""Chapter 5 as it is printed, tabulated surfaces and inverse interpolation, against the exact inverse."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import ParameterError
from gossamer_models.compensator import compensator_model
from gossamer_models.sensor import default_artifact, sensor_model
from gossamer_models.sensor.plots import everett
from oracles.everett import EverettInverse, everett_surfaces
from oracles.preisach import artifact, drive, start, term

RELAXATION = [term(0.1, 0), term(0.2, 1, (0.03, 3.0), (0.5, 0.5))]
SENSORS = {
    "eta 0.85": artifact(eta=0.85),
    "relaxing": artifact(eta=0.85, relaxation=RELAXATION),
    "default": default_artifact(),
}


def interpolated(sensor, output, points):
    inverse = EverettInverse(sensor, points)
    return np.array([inverse.step(value, 0.1) for value in output])


@pytest.mark.parametrize("name", SENSORS)
def test_inverse_interpolation_and_exact_inverse_agree(name):
    sensor = SENSORS[name]
    strain = np.random.default_rng(3).uniform(0.0, 1.0, 80)
    output = drive(start(sensor_model(sensor)), strain)
    exact = drive(start(compensator_model(sensor)), output)
    assert exact == pytest.approx(strain, abs=1e-12)
    coarse, fine = (np.abs(interpolated(sensor, output, n) - exact).max() for n in (17, 129))
    assert fine < 1e-3
    assert fine < coarse / 9.0  # second order with reservations: the tables bend at a lattice of their own, 1/8 or 1/32


def test_surfaces_are_the_changes_that_the_sensor_makes():
    sensor = SENSORS["eta 0.85"]
    strain, rising, falling = everett_surfaces(sensor, 9)
    # from the virgin state: up to one value, down to another
    for i, top in enumerate(strain[1:], start=1):
        for j, low in enumerate(strain[:i]):
            up, down = drive(start(sensor_model(sensor)), [top, low])
            assert rising[0, i] == pytest.approx(up, abs=1e-12)
            assert falling[i, j] == pytest.approx(down - up, abs=1e-12)
    assert np.isnan(rising[5, 2])
    assert np.isnan(falling[2, 5])
    assert np.abs(np.diag(rising)).max() == 0.0


@pytest.mark.parametrize("name", SENSORS)
def test_the_surfaces_that_a_fit_draws_are_those_of_chapter_5(name):
    up, down = everett(SENSORS[name])
    _, rising, falling = everett_surfaces(SENSORS[name], SENSORS[name].n_lines + 1)
    np.testing.assert_allclose(up.T, rising, atol=1e-12)
    np.testing.assert_allclose(-down, falling, atol=1e-12)


def test_surfaces_of_one_eta_are_mirror_images_but_for_eta():
    """Symmetric about h1 = h2 in the classical model, Section 5.1; eta scales one side of it, Section 5.2."""
    _, rising, falling = everett_surfaces(SENSORS["eta 0.85"], 17)
    upper = np.triu_indices(17)
    assert -falling.T[upper] == pytest.approx(0.85 * rising[upper], abs=1e-12)


def test_surfaces_are_static_and_an_extension_is_refused():
    extended = artifact(relaxation=[replace(term(0.1, 0), drive="falling")])
    with pytest.raises(ParameterError, match="relaxation of the thesis only"):
        EverettInverse(extended)
    for found, wanted in zip(everett_surfaces(extended, 9), everett_surfaces(artifact(), 9), strict=True):
        np.testing.assert_array_equal(found, wanted)
