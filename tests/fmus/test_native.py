"""What only native FMUs have: derivatives, the standard's call sequence enforced, C without a host's help."""

import ctypes
import math
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu_host import FMUS, Instance, excite, model_of
from gossamer_fmus import build_all
from gossamer_fmus.build import MODELS
from gossamer_fmus.native import chosen, derivative, fmi_headers, sources, universal, with_guid
from gossamer_models import ParameterError, Stepper
from gossamer_models.membrane import membrane_model

OK, DISCARD, ERROR = 0, 2, 3


@pytest.fixture
def kind():
    return "native"


def test_the_membranes_two_forms_give_the_same_bits():
    """One is a loop over elements, which compiles well; the other columns, which suit the virtual machine."""
    both = [Stepper(membrane_model(4, compiled=compiled), pressure_amplitude=2e4) for compiled in (False, True)]
    for stepper in both:
        stepper.set("damage[6]", 0.3)
        stepper.initialize()
    for k in range(100):
        for stepper in both:
            stepper.set("base_acceleration", 5.0 * math.sin(0.1 * k))
            stepper.step(3e-4)
        assert np.array_equal(both[0]._x, both[1]._x)


# Values at which no model is at a kink: strain rises, resistance rises.
SMOOTH = {
    "membrane": ({"pressure": 500.0, "damage[7]": 0.2}, ["pressure", "base_acceleration", "damage[7]"]),
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
    results = fmu.names("output") + fmu.names("local")
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
        change = (1e-3 if name == "membrane" else 1e-5) * max(abs(values.get(key, 0.0)), 1.0)
        step()
        known, unknown = [fmu.references[key]], [fmu.references[result] for result in results]
        found = np.array(fmu.slave.getDirectionalDerivative(unknown, known, [2.0])) / 2.0
        value = values.get(key, 0.0)
        wanted = (step(**{key: value + change}) - step(**{key: value - change})) / (2.0 * change)
        assert np.abs(found).max() > 0.0
        assert found == pytest.approx(wanted, rel=1e-5, abs=1e-6 * np.abs(wanted).max())
    fmu.slave.freeFMUstate(before)


def test_before_the_first_step_a_derivative_is_that_of_the_initial_results(instance):
    """As FMI allows in initialization mode: central differences of the prestress equilibrium by the damage of a zone."""
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
    for name in ("membrane", "sensor", "compensator", "estimator"):
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
    assert "'density' is none" in fmu.messages[-1]
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
        assert "while it runs" in fmu.messages[-1]
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
    assert "after its end" in fmu.messages[-1]
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
    signals = np.array(
        [(0.0, 0.0), (0.005, 0.0), (0.005, 1e8), (0.01, 1e8)], dtype=[("time", float), ("pressure", float)]
    )
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


def test_a_thousand_instances_live_side_by_side(fmus, unzipped):
    instances = [Instance(fmus["sensor"], unzipped["sensor"], f"sensor{k}") for k in range(1000)]
    for k, fmu in enumerate(instances):
        fmu.initialize(rest_resistance=100.0 + k)
    for fmu in instances:
        assert fmu.step(0.1) == OK
    assert [fmu.get("resistance")[0] for fmu in instances] == [100.0 + k for k in range(1000)]
    for fmu in instances:
        fmu.slave.freeInstance()


@pytest.mark.parametrize("name", FMUS)
def test_instances_in_four_threads_give_what_one_gives(instance, name):
    """ctypes releases the interpreter's lock during a call, so the steps do run side by side."""

    def run(fmu):
        fmu.initialize()
        rows = []
        for k in range(300):
            for key, value in excite(name, k).items():
                fmu.set(key, value)
            assert fmu.step(3e-4) == OK
            rows.append(fmu.get(*fmu.names("output")))
        return rows

    wanted = run(instance(name))
    with ThreadPoolExecutor(4) as pool:
        assert all(rows == wanted for rows in pool.map(run, [instance(name) for _ in range(4)]))


def test_platforms_are_chosen_by_name_and_a_wrong_one_is_refused_with_those_there_are():
    assert chosen(["all"], 2) == ["linux64", "win64", "darwin64"]
    assert chosen(["all"], 3) == ["linux64", "win64", "darwin64", "aarch64-linux"]
    with pytest.raises(ParameterError, match="'aarch64-linux' only with --fmi 3"):
        chosen(["aarch64-linux"], 2)
    with pytest.raises(ParameterError, match="'solaris'; there are linux64, win64, darwin64 and all"):
        chosen(["linux64", "solaris"], 2)


def test_fmi_3_without_native_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="Add --native"):
        build_all(tmp_path, fmi=3)


def test_the_sources_name_no_path_and_depend_on_the_model_alone():
    first, second = (sources(MODELS["sensor"](), "{guid}", 2) for _ in range(2))
    assert first == second
    assert set(first) == {"fmi2.c", "stepper.h", "model.h", "functions.h"}
    assert not any(b"/home" in text or b"/tmp" in text for text in first.values())


def test_a_guid_put_in_later_is_all_that_changes():
    model = MODELS["sensor"]()
    without = sources(model, "", 2)
    named = with_guid(without, "{1-2}")
    assert named == sources(model, "{1-2}", 2)
    assert [name for name in without if without[name] != named[name]] == ["model.h"]


def test_a_universal_library_lists_its_parts_by_processor():
    """Two headers of Mach-O files: x86-64 (0x01000007, 3) and arm64 (0x0100000c, 0), little-endian."""
    parts = [
        bytes.fromhex("cffaedfe07000001030000000600") + b"x" * 9,
        bytes.fromhex("cffaedfe0c00000100000000") + b"y" * 9,
    ]
    fat = universal(parts)
    head = np.frombuffer(fat[: 8 + 2 * 20], dtype=">u4").tolist()
    assert head[:2] == [0xCAFEBABE, 2]
    for k, (processor, subtype) in enumerate([(0x01000007, 3), (0x0100000C, 0)]):
        found, found_subtype, offset, size, align = head[2 + 5 * k : 7 + 5 * k]
        assert (found, found_subtype) == (processor, subtype)
        assert offset % (1 << align) == 0
        assert fat[offset : offset + size] == parts[k]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="links with gcc, which is not installed")
def test_sources_of_two_fmus_can_be_linked_into_one_program(tmp_path):
    """As importers for embedded targets do: with a prefix for the FMI functions; a host's own header asks for it."""
    objects = []
    for name in ("sensor", "detector"):
        folder = tmp_path / name
        folder.mkdir()
        for file, content in sources(MODELS[name](), "{guid}", 3).items():
            (folder / file).write_bytes(content)
        objects.append(str(tmp_path / f"{name}.o"))
        prefix = f"-DFMI3_FUNCTION_PREFIX={name}_"
        command = ["gcc", "-O0", "-c", "fmi3.c", "-o", objects[-1], prefix, "-I", str(fmi_headers())]
        subprocess.run(command, cwd=folder, check=True)
    (tmp_path / "main.c").write_text(
        "const char *sensor_fmi3GetVersion(void), *detector_fmi3GetVersion(void);\n"
        "int main(void) { return sensor_fmi3GetVersion()[0] - detector_fmi3GetVersion()[0]; }\n"
    )
    program = str(tmp_path / "main")
    subprocess.run(["gcc", str(tmp_path / "main.c"), *objects, "-lm", "-o", program], check=True)
    assert subprocess.run([program], check=False).returncode == 0


STEPS = """
#include "fmi2.c"
static int allocations;
void *__real_malloc(size_t n);
void *__real_calloc(size_t n, size_t size);
void *__wrap_malloc(size_t n) { allocations++; return __real_malloc(n); }
void *__wrap_calloc(size_t n, size_t size) { allocations++; return __real_calloc(n, size); }
int main(void) {
  fmi2CallbackFunctions callbacks = {0};
  Instance *m = fmi2Instantiate("m", fmi2CoSimulation, MODEL_GUID, "", &callbacks, 0, 0);
  fmi2EnterInitializationMode(m);
  if (!m || fmi2ExitInitializationMode(m) || allocations != 1) return 1;
  for (int k = 0; k < 1000; k++) if (fmi2DoStep(m, 3e-4 * k, 3e-4, fmi2True)) return 2;
  return allocations == 1 ? 0 : 3;
}
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="counts allocations with gcc's linker, which is not installed")
@pytest.mark.parametrize("name", FMUS)
def test_an_instance_is_one_allocation_and_a_step_is_none(tmp_path, name):
    for file, content in sources(model_of(name), "{guid}", 2).items():
        (tmp_path / file).write_bytes(content)
    (tmp_path / "steps.c").write_text(STEPS)
    wrap = "-Wl,--wrap=malloc,--wrap=calloc"
    command = ["gcc", "-O1", "steps.c", "-o", "steps", "-I", ".", "-I", str(fmi_headers()), wrap, "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([str(tmp_path / "steps")], check=False).returncode == 0
