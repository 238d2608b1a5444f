"""Cost of one step of each model in CasADi's virtual machine, printed beside its target and a peer."""

import statistics
import time

import numpy as np
import pytest
from gossamer_models import Stepper
from gossamer_models.compensator import compensator_model
from gossamer_models.detector import posterior_model
from gossamer_models.membrane import MembraneParams, membrane_model, square_structure
from gossamer_models.sensor import sensor_model
from oracles.statics import integrate_implicit
from studies.square import SquareEquations

H = 3e-4


def running(model, **start):
    stepper = Stepper(model, **start)
    stepper.initialize()
    return stepper


def test_membrane_step(cost, measured):
    for name, mesh, target in (("order 4", (4, 4), 150), ("bilinear 8 x 8", (8, 1), 50)):
        membrane = running(membrane_model(square_structure(*mesh)))
        h = 0.5 * membrane.get("max_step")
        explicit = cost(membrane.step, h, repeats=100, batches=15)
        print(f"\nmembrane of {name}, one explicit step: {explicit:.0f} us (target {target})")
    begin, steps = time.perf_counter(), 50 if measured else 1
    integrate_implicit(SquareEquations(square_structure(8, 1)), MembraneParams(), steps=steps)
    implicit = 1e6 * (time.perf_counter() - begin) / steps
    print(f"one implicit step of 3e-4 s: {implicit / (2 * explicit):.0f} times the two explicit ones it stands for")


def test_sensor_compensator_estimator_and_detector_step(cost):
    strains = iter(np.tile(0.1 + 0.09 * np.sin(np.linspace(0.0, 60.0, 5000)), 20).tolist())
    sensor, compensator = running(sensor_model()), running(compensator_model())
    detector = running(posterior_model(), repeat=1.0)

    def sense():
        sensor.set("strain", next(strains))
        sensor.step(H)

    def compensate():
        sense()
        compensator.set("resistance", sensor.get("resistance"))
        compensator.step(H)

    print(f"\nsensor, input set and step: {cost(sense, batches=15):.1f} us (target 25)")
    print(f"sensor and compensator step: {cost(compensate, batches=15):.1f} us")
    estimator = running(compensator_model(method="estimator"))
    print(f"estimator step: {cost(estimator.step, H):.1f} us")
    print(f"detector step: {cost(detector.step, H):.1f} us")


@pytest.mark.parametrize("model", [sensor_model, compensator_model])
def test_a_step_costs_the_same_after_a_million(model, cost, measured):
    """Target: 1.0 +- 0.1. Early and late instances take turns, so that both see the same machine."""
    name = "strain" if model is sensor_model else "resistance"
    many = 1_000_000 if measured else 1000
    early, late = running(model()), running(model())
    middle = early.get("resistance") if name == "resistance" else 0.1
    values = middle * (1.0 + 0.2 * np.sin(np.linspace(0.0, 600.0, 1_000_000)))
    for k, stepper in ((1000, early), (many, late)):
        for value in values[:k]:
            stepper.set(name, value)
            stepper.step(H)
    ratios = [cost(late.step, H, batches=6) / cost(early.step, H, batches=6) for _ in range(21 if measured else 1)]
    print(f"\n{model().name}: cost of a step after {many:g} steps over that after 1e3: {statistics.median(ratios):.3f}")
