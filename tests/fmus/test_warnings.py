"""A model that leaves the range in which it is valid says so once, and goes on: FMUs in Python and in C."""

import casadi as ca
import pytest
from building import build_fmu
from fmi_instances import Fmi2, Fmi3
from gossamer_models import StepModel
from gossamer_models.variables import input_, output

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


@pytest.mark.parametrize("native", [True, False])
def test_a_result_says_what_to_do_where_it_leaves_its_range(tmp_path, unzipped_once, native):
    model = StepModel.written(
        name="ramp",
        description="Ramp",
        variables=(input_("u", "1", "Rate", 3.0), output("x", "1", "State", maximum=2.0, advice="Slow down.")),
        init=lambda _u, _p: (ca.MX(0.0), {"x": 0.0}),
        step=lambda x, u, _p, h: (x + u.u * h, {"x": x + u.u * h}),
    )
    (tmp_path / "README.md").write_text("# Ramp\n")
    path = build_fmu(model, tmp_path, tmp_path / "README.md", native=native)
    fmu = Fmi2(model, path, unzipped_once(path))
    fmu.start()
    fmu.leave()
    fmu.step(1.0)
    fmu.slave.freeInstance()
    assert [text.decode() if isinstance(text, bytes) else text for text in fmu.messages] == [
        "'x' of model 'ramp' is 3; the model is valid from -inf to 2. Slow down. The run goes on; this is logged once."
    ]
