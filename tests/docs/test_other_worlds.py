"""The worlds that are not the model: another integrator, another sensor material."""

import numpy as np
import pytest
from gossamer_models.batch import Batch
from gossamer_models.membrane import membrane_model, square_structure
from studies.runge_kutta import runge_kutta_membrane
from studies.specimen.flight import calibrated_sensor, flown_resistance

pytest.importorskip("ziglang", reason="many small steps need the compiler")

MESH, STEP, STEPS = (4, 1), 3e-4, 100
START = {"damage": np.where(np.arange(16) == 5, 0.4, 0.0)[None]}


def histories(model, parts):
    return Batch(model, model.elements("strain")).run(parts * STEPS, STEP / parts, START, every=parts).results[0]


def test_runge_kutta_is_of_fourth_order_and_agrees_with_verlet_in_the_limit():
    runge_kutta, verlet = runge_kutta_membrane(*MESH), membrane_model(square_structure(*MESH))
    exact = histories(runge_kutta, 16)
    errors = [np.abs(histories(runge_kutta, parts) - exact).max() for parts in (2, 4)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)
    assert np.abs(histories(verlet, 32) - exact).max() < 1e-4 * np.ptp(exact)


def test_one_calibration_of_the_fast_specimen_identifies_it_to_two_per_cent_of_its_range():
    sensor, error = calibrated_sensor()
    assert 0.5 < error < 2.0
    strain = 0.02 + 0.1 * np.sin(np.linspace(0.0, np.pi, 50))
    resistance = flown_resistance(strain[None, None], STEP)
    assert resistance.shape == (1, 1, 50)
    assert resistance.max() > sensor.scales.rest_resistance
