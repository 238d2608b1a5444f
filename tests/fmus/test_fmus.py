"""An FMU of either kind in a host: the same numbers as its model, states, refusals, neighbours."""

import math
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmu_host import FMUS, excite, same
from gossamer_models import Stepper

OK, DISCARD = 0, 2


@pytest.mark.parametrize("name", FMUS)
def test_the_fmu_is_its_model_in_any_step_size(instance, models, kind, name):
    fmu, model = instance(name), Stepper(models[name])
    fmu.initialize()
    model.initialize()
    results = [v.name for v in models[name].variables if v.causality in ("output", "local")]
    for k, h in enumerate([3e-4, 1e-4, 7e-4, 3e-4, 2e-3, 5e-5] * 3):
        for key, value in excite(name, k).items():
            fmu.set(key, value)
            model.set(key, value)
        assert fmu.step(h) == OK, fmu.messages
        model.step(h)
        assert same(fmu.get(*results), [model.get(result) for result in results], kind, name)


@pytest.mark.parametrize("name", FMUS)
@pytest.mark.parametrize("serialized", [False, True])
def test_a_saved_state_continues_to_the_bit(instance, name, serialized):
    fmu = instance(name)
    fmu.initialize()
    outputs = fmu.names("output")

    def advance(target, begin):
        for k in range(begin, begin + 5):
            for key, value in excite(name, k).items():
                target.set(key, value)
            assert target.step(3e-4) == OK
        return target.get(*outputs)

    advance(fmu, 0)
    state = fmu.slave.getFMUstate()
    first = advance(fmu, 5)
    if serialized:
        bytes_ = fmu.slave.serializeFMUstate(state)
        other = instance(name, name="other")
        restored = other.slave.deSerializeFMUstate(bytes_)
        other.slave.setFMUstate(restored)
        other.slave.freeFMUstate(restored)
        again = advance(other, 5)
    else:
        fmu.slave.setFMUstate(state)
        again = advance(fmu, 5)
    fmu.slave.freeFMUstate(state)
    assert again == first


@pytest.mark.parametrize("name", FMUS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_bad_input_discards_the_step_names_the_input_and_changes_nothing(instance, name, value):
    fmu = instance(name)
    fmu.initialize()
    assert fmu.step(3e-4) == OK
    target = fmu.names("input")[0]
    before, good = fmu.get(*fmu.names("output")), fmu.get(target)[0]
    fmu.set(target, value)
    assert fmu.step(3e-4) == DISCARD
    assert f"'{target}'" in fmu.messages[-1]
    assert fmu.get(*fmu.names("output")) == before
    fmu.set(target, good)
    assert fmu.step(3e-4) == OK


def test_damage_out_of_range_is_refused(instance):
    fmu = instance("membrane")
    fmu.initialize()
    fmu.set("damage[3]", 1.2)
    assert fmu.step(3e-4) == DISCARD
    assert "'damage[3]'" in fmu.messages[-1]


@pytest.mark.parametrize("h", [0.0, -1e-3, math.nan, math.inf])
def test_a_step_must_be_a_positive_time(instance, h):
    fmu = instance("sensor")
    fmu.initialize()
    assert fmu.step(h) == DISCARD
    assert "must be a positive time" in fmu.messages[-1]


@pytest.mark.parametrize("name", FMUS)
def test_initial_results_can_be_read_in_initialization_mode_and_follow_the_parameters(instance, models, name):
    """As FMI asks; a host may read a result there, change what it depends on, and read it again."""
    fmu, model = instance(name), Stepper(models[name])
    outputs = fmu.names("output")
    parameter = {
        "membrane": "edge_displacement",
        "framed_membrane": "edge_displacement",
        "hub": "mass",
        "detector": "sampling_step",
    }.get(name, "rest_resistance")
    fmu.slave.setupExperiment(startTime=0.0)
    fmu.slave.enterInitializationMode()
    model.initialize()
    assert fmu.get(*outputs) == [model.get(output) for output in outputs]
    start = 1.1 * model.get(parameter)
    model.reset()
    model.set(parameter, start)
    fmu.set(parameter, start)
    model.initialize()
    assert fmu.get(*outputs) == [model.get(output) for output in outputs]
    fmu.slave.exitInitializationMode()
    assert fmu.get(*outputs) == [model.get(output) for output in outputs]
    assert not fmu.messages


def test_two_instances_do_not_share_anything(instance):
    a, b = instance("sensor"), instance("sensor", name="other")
    a.initialize(rest_resistance=100.0)
    b.initialize(rest_resistance=200.0)
    a.set("strain", 0.3)
    for fmu in (a, b):
        fmu.step(0.1)
    assert b.get("resistance") == [200.0]
    assert a.get("resistance") != [100.0]


def test_two_estimators_do_not_share_their_windows(instance):
    """One sees noise, the other none: the second must say what it says when it is alone."""
    a, b, alone = (instance("estimator", name=name) for name in ("a", "b", "alone"))
    for fmu in (a, b, alone):
        fmu.initialize(noise=0.05)
    noise = np.random.default_rng(0).standard_normal(60)
    for k in range(60):
        a.set("resistance", 100.0 + 0.2 * k + noise[k])
        assert a.step(0.1) == OK
        b.set("resistance", 100.0 + 0.1 * k)
        assert b.step(0.1) == OK
    for k in range(60):
        alone.set("resistance", 100.0 + 0.1 * k)
        assert alone.step(0.1) == OK
    outputs = b.names("output")
    assert b.get(*outputs) == alone.get(*outputs)
    assert a.get(*outputs) != b.get(*outputs)


def test_memory_does_not_grow_with_steps(instance):
    """Resident memory after 20 000 steps that log nothing, against after 2 000."""
    statm = Path("/proc/self/statm")
    if not statm.exists():
        pytest.skip("reads /proc, which this system does not have")
    fmu = instance("sensor")
    fmu.initialize()
    rng = np.random.default_rng(0)

    def pages_after(steps):
        for strain in rng.uniform(0.0, 0.4, steps):
            fmu.set("strain", float(strain))
            fmu.step(1e-3)
        return int(statm.read_text().split()[1])

    before = pages_after(2_000)
    assert pages_after(20_000) - before < 256  # 1 MiB


def test_fmpy_simulates_the_default_experiment(fmus):
    result = fmpy.simulate_fmu(str(fmus["membrane"]), stop_time=0.03, output=["deflection"])
    assert result["deflection"][-1] > 1e-3
