"""What native FMUs refuse, in words and without harm: the standard's call sequence, values, states, references."""

import ctypes
import math

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

OK, DISCARD, ERROR = 0, 2, 3


@pytest.fixture
def kind():
    return "native"


def status(fmu, function, *arguments):
    return getattr(fmu.slave.dll, function)(fmu.slave.component, *arguments)


def test_calls_before_initialization_are_errors_that_name_the_call(instance):
    fmu = instance("sensor")
    assert fmu.step(1e-3) == ERROR
    assert "fmi2DoStep is not allowed before initialization" in fmu.messages[-1]
    for function in ("fmi2ExitInitializationMode", "fmi2Terminate", "fmi2CancelStep"):
        assert status(fmu, function) == ERROR
        assert f"{function}" in fmu.messages[-1]
    with pytest.raises(FMICallException):
        fmu.get("resistance")
    assert "reading a result is not allowed before initialization" in fmu.messages[-1]
    assert fmu.get("rest_resistance") == [100.0]


def test_a_running_instance_refuses_what_belongs_before_it_and_goes_on(instance):
    fmu = instance("sensor")
    fmu.initialize()
    for function in ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode"):
        assert status(fmu, function) == ERROR
        assert "while model 'sensor' is running" in fmu.messages[-1]
    for name, reason in (("rest_resistance", "is fixed once"), ("resistance", "is a result")):
        with pytest.raises(FMICallException):
            fmu.set(name, 5.0)
        assert reason in fmu.messages[-1]
    assert fmu.step(1e-3) == OK
    assert fmu.get("rest_resistance", "resistance") == [100.0, 100.0]


def test_after_its_end_results_can_be_read_and_nothing_else_is_done(instance):
    fmu = instance("sensor")
    fmu.initialize()
    fmu.step(1e-3)
    fmu.slave.terminate()
    assert fmu.get("resistance") == [100.0]
    assert fmu.step(1e-3) == ERROR
    with pytest.raises(FMICallException):
        fmu.set("strain", 0.1)
    assert "after model 'sensor' was terminated" in fmu.messages[-1]
    fmu.slave.reset()
    fmu.initialize()
    assert fmu.step(1e-3) == OK


def test_setting_several_values_sets_all_or_none(instance):
    fmu = instance("sensor")
    fmu.initialize()
    references = [fmu.references["strain"], fmu.references["resistance"]]
    with pytest.raises(FMICallException):
        fmu.slave.setReal(references, [0.2, 5.0])
    assert fmu.get("strain") == [0.0]


def test_a_failed_initialization_can_be_corrected_and_repeated(instance):
    fmu = instance("membrane")
    fmu.slave.setupExperiment(startTime=0.0)
    fmu.slave.enterInitializationMode()
    fmu.set("youngs_modulus", -1.0)
    assert status(fmu, "fmi2ExitInitializationMode") == ERROR
    assert "'youngs_modulus'" in fmu.messages[-1]
    fmu.set("youngs_modulus", 1e9)
    assert status(fmu, "fmi2ExitInitializationMode") == OK
    assert fmu.step(3e-4) == OK


def test_a_read_that_fails_leaves_no_stale_number_behind(instance):
    """Some hosts go on without looking at the status."""
    fmu = instance("sensor")
    fmu.slave.enterInitializationMode()
    fmu.set("rest_strain", 0.7)
    resistance, buffer = (ctypes.c_uint * 1)(fmu.references["resistance"]), (ctypes.c_double * 1)(5.0)
    assert status(fmu, "fmi2GetReal", resistance, ctypes.c_size_t(1), buffer) == ERROR
    assert math.isnan(buffer[0])


def test_a_strain_beyond_full_scale_before_the_run_is_refused_with_advice(instance):
    fmu = instance("sensor")
    fmu.slave.setupExperiment(startTime=0.0)
    fmu.slave.enterInitializationMode()
    fmu.set("rest_strain", 0.7)
    assert status(fmu, "fmi2ExitInitializationMode") == ERROR
    assert "must not exceed full_scale_strain" in fmu.messages[-1]


@pytest.mark.parametrize(
    "spoil", [lambda b: b[:-1], lambda b: b"", lambda b: bytes([b[0] ^ 1]) + b[1:], lambda b: b[:-1] + b"x"]
)
def test_a_spoilt_state_is_refused_and_the_run_goes_on(instance, spoil):
    fmu = instance("sensor")
    fmu.initialize()
    fmu.step(1e-3)
    state = fmu.slave.getFMUstate()
    spoilt = spoil(fmu.slave.serializeFMUstate(state))
    fmu.slave.freeFMUstate(state)
    with pytest.raises(FMICallException):
        fmu.slave.deSerializeFMUstate(spoilt)
    assert "saved state" in fmu.messages[-1]
    assert fmu.step(1e-3) == OK


def test_a_state_of_another_model_is_refused(instance):
    sensor, compensator = instance("sensor"), instance("compensator")
    sensor.initialize()
    compensator.initialize()
    state = sensor.slave.getFMUstate()
    with pytest.raises(FMICallException):
        compensator.slave.deSerializeFMUstate(sensor.slave.serializeFMUstate(state))
    assert "no saved state of model 'compensator'" in compensator.messages[-1]
    sensor.slave.freeFMUstate(state)


def test_a_wrong_guid_is_refused(fmus, unzipped):
    description = fmpy.read_model_description(str(fmus["sensor"]))
    slave = fmpy.fmi2.FMU2Slave(
        guid="{00000000-0000-0000-0000-000000000000}",
        unzipDirectory=unzipped["sensor"],
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="stranger",
    )
    with pytest.raises(Exception, match="instantiate"):
        slave.instantiate()
    slave.freeLibrary()


def test_other_types_and_unknown_references_are_refused(instance):
    fmu = instance("sensor")
    fmu.initialize()
    for call in (
        lambda: fmu.slave.getReal([999_999]),
        lambda: fmu.slave.setReal([4_000_000_000], [1.0]),
        lambda: fmu.slave.getInteger([0]),
        lambda: fmu.slave.setBoolean([0], [True]),
        lambda: fmu.slave.getString([0]),
    ):
        fmu.messages.clear()
        with pytest.raises(FMICallException):
            call()
        assert "no value reference" in fmu.messages[-1] or "real variables only" in fmu.messages[-1]
    assert fmu.step(1e-3) == OK


def test_a_percent_sign_in_a_message_is_no_printf_format(instance):
    """The model's name and advice hold none; the escape is for those that will."""
    fmu = instance("sensor")
    fmu.initialize()
    assert status(fmu, "fmi2DoStep", ctypes.c_double(0.0), ctypes.c_double(math.nan), 0) == DISCARD
    assert fmu.messages[-1].replace("%%", "").count("%") == 0


def test_fmpys_own_loop_ends_at_a_refused_step_rather_than_repeat_it_for_ever(fmus):
    signals = np.array([(0.0, 0.0), (0.005, 0.0), (0.005, 1e8), (0.01, 1e8)], dtype=[("time", float), ("pressure", float)])
    result = fmpy.simulate_fmu(
        str(fmus["membrane"]),
        stop_time=0.01,
        output_interval=1e-3,
        input=signals,
        output=["deflection"],
        logger=lambda *_: None,
        timeout=20.0,
    )
    assert result["time"][-1] == pytest.approx(0.005, abs=1.1e-3)
