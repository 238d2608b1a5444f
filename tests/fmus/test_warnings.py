"""A model that leaves the range in which it is valid says so once, and goes on: FMUs in Python and in C."""

import pytest
from fmi_instances import Fmi3

OVERSTRETCHED = {"edge_displacement": 0.2, "pressure_amplitude": 0.0}  # strain 0.4/0.588 in the plane
STRAIN = (
    "'largest_strain' of model 'membrane' is 0.680272; the model is valid from -1 to 0.5. "
    "The run goes on; this is logged once."
)


def test_a_membrane_without_its_validity_warns_once_per_result(instance):
    fmu = instance("membrane")
    fmu.initialize(**OVERSTRETCHED)
    assert fmu.step(1e-4) == 0
    assert fmu.messages == [STRAIN]
    fmu.set("pressure", 1e6)
    for _ in range(200):
        assert fmu.step(3e-4) == 0
    first, second = fmu.messages
    assert first == STRAIN
    assert second.startswith("'deflection_ratio' of model 'membrane' is 2.07")
    assert second.endswith("; the model is valid from 0 to 1. The run goes on; this is logged once.")


def test_every_instance_warns_and_a_reset_one_again(instance):
    one, two = instance("membrane"), instance("membrane")
    for fmu in (one, two):
        fmu.initialize(**OVERSTRETCHED)
        assert fmu.messages == [STRAIN]
    one.slave.reset()
    one.initialize(**OVERSTRETCHED)
    assert one.messages == [STRAIN, STRAIN]


def test_within_its_validity_nothing_is_logged(instance):
    fmu = instance("membrane")
    fmu.initialize()
    for _ in range(200):
        fmu.step(3e-4)
    assert fmu.messages == []


@pytest.mark.parametrize("logging", [True, False])
def test_fmi_3_warns_if_the_host_wants_it(built, unzipped_once, models, logging):
    path = built("native FMI 3")["membrane"]
    model = models["membrane"]
    fmu = Fmi3(model, path, unzipped_once(path))
    fmu.slave.setDebugLogging(logging, [])
    fmu.start()
    reference = {group.start: k for k, group in fmu.groups.items()}
    for name, value in OVERSTRETCHED.items():
        fmu.set([reference[model.names.index(name)]], [value])
    fmu.leave()
    fmu.step(3e-4)
    fmu.slave.freeInstance()
    assert [text.decode() if isinstance(text, bytes) else text for text in fmu.messages] == [STRAIN] * logging
