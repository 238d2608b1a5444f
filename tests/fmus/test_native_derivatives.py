"""Directional derivatives of native FMUs: of a communication step, and of the initial results."""

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu_host import excite
from gossamer_fmus.c_code import derivative
from gossamer_models import Stepper

OK = 0


@pytest.fixture
def kind():
    return "native"


# Values at which no model is at a kink: strain rises, resistance rises.
SMOOTH = {
    "membrane": ({"pressure": 500.0, "damage[7]": 0.2}, ["pressure", "base_acceleration", "damage[7]"]),
    "framed_membrane": (
        {"pressure": 500.0, "angular_velocity[1]": 0.5, "damage[7]": 0.2},
        ["pressure", "frame_acceleration[3]", "angular_acceleration[1]", "damage[7]"],
    ),
    "hub": ({"force[3]": 20.0, "wheel_torque[1]": 3.0}, ["force[3]", "torque[1]", "thruster_force[2]", "wheel_torque[1]"]),
    "sensor": ({"strain": 0.11}, ["strain"]),
    "compensator": ({"resistance": 112.0}, ["resistance"]),
}


@pytest.mark.parametrize("h", [1e-4, 3e-4])
@pytest.mark.parametrize("name", SMOOTH)
def test_directional_derivatives_are_those_of_finite_differences(instance, name, h):
    """Central differences of a whole communication step, which for the membrane is one internal step or two."""
    values, inputs = SMOOTH[name]
    fmu = instance(name)
    fmu.initialize()
    maxima = ("largest_strain", "deflection_ratio")  # over points: they have kinks, which differences step over
    results = [result for result in fmu.names("output") + fmu.names("local") if result not in maxima]
    for key, value in values.items():
        fmu.set(key, 0.98 * value)
    assert fmu.step(h) == OK
    before = fmu.slave.getFMUstate()

    def step(**changed):
        fmu.slave.setFMUstate(before)
        for key, value in (values | changed).items():
            fmu.set(key, value)
        assert fmu.step(h) == OK, fmu.messages
        return np.array(fmu.get(*results))

    for key in inputs:
        # round-off of a strain would hide a derivative of 1e-12; the membrane is smooth enough for a larger change
        change = (1e-3 if "membrane" in name else 1e-5) * max(abs(values.get(key, 0.0)), 1.0)
        # a force is a sum over nodes, most of which cancels
        rounding = 1e-12 * np.abs(step()).max() / change
        known, unknown = [fmu.references[key]], [fmu.references[result] for result in results]
        found = np.array(fmu.slave.getDirectionalDerivative(unknown, known, [2.0])) / 2.0
        value = values.get(key, 0.0)
        wanted = (step(**{key: value + change}) - step(**{key: value - change})) / (2.0 * change)
        assert np.abs(found).max() > 0.0
        assert found == pytest.approx(wanted, rel=1e-5, abs=max(1e-6 * np.abs(wanted).max(), rounding))
    fmu.slave.freeFMUstate(before)


def test_before_the_first_step_a_derivative_is_that_of_the_initial_results(instance):
    """As FMI allows in initialization mode: central differences of the prestress equilibrium by a zone's damage."""
    fmu = instance("membrane")
    fmu.slave.setupExperiment(startTime=0.0)
    with pytest.raises(FMICallException):
        fmu.slave.getDirectionalDerivative([fmu.references["strain[1]"]], [fmu.references["damage[1]"]], [1.0])
    assert "not allowed before initialization" in fmu.messages[-1]
    fmu.slave.enterInitializationMode()
    strains = [f"strain[{k}]" for k in (1, 2, 3, 4)]

    def strain(damage):
        fmu.set("damage[1]", damage)
        return np.array(fmu.get(*strains))

    wanted = (strain(0.3 + 1e-5) - strain(0.3 - 1e-5)) / 2e-5
    strain(0.3)
    unknown, known = [fmu.references[name] for name in strains], [fmu.references["damage[1]"]]
    inside = fmu.slave.getDirectionalDerivative(unknown, known, [1.0])
    assert inside == pytest.approx(wanted, rel=1e-6, abs=1e-9)
    fmu.slave.exitInitializationMode()
    assert fmu.slave.getDirectionalDerivative(unknown, known, [1.0]) == inside


def test_every_derivative_that_is_not_zero_is_declared_as_a_dependency(instance):
    """Over a step that is divided, what acts on the membrane's state reaches all its outputs."""
    for name in ("membrane", "framed_membrane", "hub", "sensor", "compensator", "estimator"):
        fmu = instance(name)
        fmu.initialize()
        for k in range(3):
            for key, value in excite(name, k).items():
                fmu.set(key, value)
            assert fmu.step(3e-3) == OK
        declared = {u.variable.name: {v.name for v in u.dependencies} for u in fmu.description.outputs}
        for known in fmu.names("input"):
            found = fmu.slave.getDirectionalDerivative(
                [fmu.references[output] for output in declared], [fmu.references[known]], [1.0]
            )
            for output, value in zip(declared, found, strict=True):
                assert value == 0.0 or known in declared[output], (output, known)


def test_a_derivative_leaves_the_state_alone_and_is_one_by_an_input(instance):
    fmu = instance("membrane")
    fmu.initialize()
    strain, pressure = fmu.references["strain[1]"], fmu.references["pressure"]
    fmu.step(3e-4)
    before = fmu.slave.getFMUstate()
    saved = fmu.slave.serializeFMUstate(before)
    fmu.slave.getDirectionalDerivative([strain], [pressure], [1.0])
    after = fmu.slave.getFMUstate()
    assert fmu.slave.serializeFMUstate(after) == saved
    with pytest.raises(FMICallException):
        fmu.slave.getDirectionalDerivative([strain], [fmu.references["density"]], [1.0])
    assert "'density' is no input" in fmu.messages[-1]
    for state in (before, after):
        fmu.slave.freeFMUstate(state)


def test_the_derivative_of_a_step_is_linear_in_its_seed(models):
    model = models["membrane"]
    function, rng = derivative(model), np.random.default_rng(1)
    stepper = Stepper(model)
    stepper.initialize()
    parameters, inputs, _ = model.slices()
    base = [stepper._x, stepper._values[inputs], stepper._values[parameters], 1e-4]
    seeds = [(rng.normal(size=model.n_states), rng.normal(size=model.count("input"))) for _ in range(2)]
    one, two = (np.concatenate([np.array(part).ravel() for part in function(*base, *seed)]) for seed in seeds)
    both = np.concatenate(
        [np.array(p).ravel() for p in function(*base, seeds[0][0] + seeds[1][0], seeds[0][1] + seeds[1][1])]
    )
    assert both == pytest.approx(one + two, rel=1e-9, abs=1e-9 * np.abs(one).max())
