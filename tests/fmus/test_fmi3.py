"""Native FMUs of FMI 3.0, through FMPy: arrays, the numbers of the model and of FMI 2.0, what else is in the file."""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import matplotlib as mpl
import numpy as np
import pytest
from fmi_instances import Fmi3
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from fmu_host import FMUS, Instance, excite, same
from gossamer_fmus.description import arrays_of
from gossamer_fmus.page import diagrams
from gossamer_models import Stepper
from lxml import etree

STEPS = [3e-4, 1e-4, 7e-4, 3e-4, 2e-3, 5e-5]


@pytest.fixture(scope="module")
def fmus3(built):
    return built("native FMI 3")


@pytest.fixture
def make(fmus3, unzipped_once, models):
    """Make instances of an FMU by name; all are freed at the end of the test."""
    made = []

    def get(name):
        made.append(Fmi3(models[name], fmus3[name], unzipped_once(fmus3[name])))
        return made[-1]

    yield get
    for each in made:
        each.slave.freeInstance()


def initialized(fmu):
    fmu.start()
    fmu.leave()
    return fmu


def advance(fmu, model, name, k, h=3e-4):
    """Step with the k-th inputs, each array set as a whole, and return all results."""
    _, inputs, results = model.slices()
    values = {place: model.variables[place].start for place in range(inputs.start, inputs.stop)}
    values |= {model.names.index(key): value for key, value in excite(name, k).items()}
    for reference, group in fmu.groups.items():
        if group.start in values:
            fmu.set([reference], [values[place] for place in group])
    fmu.step(h)
    return fmu.get([reference for reference, group in fmu.groups.items() if group.start >= results.start])


@pytest.mark.parametrize("name", FMUS)
def test_neighbours_are_arrays_with_names_shapes_units_and_starts(fmus3, models, name):
    found = {v.name: v for v in fmpy.read_model_description(str(fmus3[name])).modelVariables}
    assert found.pop("time").causality == "independent"
    for variable in models[name].variables:
        array = found[variable.name.split("[")[0]]
        assert (array.unit, array.causality) == (variable.unit, variable.causality)
    for array in arrays_of(models[name]):
        variable = found[array.name]
        assert tuple(variable.shape or ()) == array.shape
        starts = [v.start for v in array.members if v.start is not None]
        assert [float(text) for text in (variable.start or "").split()] == starts


def test_the_detector_takes_strain_of_4_and_gives_damage_of_16(fmus3):
    variables = {v.name: v for v in fmpy.read_model_description(str(fmus3["detector"])).modelVariables}
    assert list(variables["strain"].shape) == [4]
    assert list(variables["damage"].shape) == [16]


@pytest.mark.parametrize("name", FMUS)
def test_the_fmu_is_its_model_in_any_step_size(make, models, name):
    fmu, model = initialized(make(name)), Stepper(models[name])
    model.initialize()
    results = models[name].slices()[2]
    for k, h in enumerate(STEPS * 3):
        for key, value in excite(name, k).items():
            model.set(key, value)
        model.step(h)
        found = advance(fmu, models[name], name, k, h)
        assert same(found, model.get_values(range(results.start, results.stop)), "native", name)


@pytest.mark.parametrize("name", FMUS)
def test_a_saved_and_a_serialized_state_continue_to_the_bit(make, models, name):
    fmu, other = initialized(make(name)), make(name)

    def run(target, begin):
        return [advance(target, models[name], name, k) for k in range(begin, begin + 5)]

    run(fmu, 0)
    state = fmu.save()
    read = other.read(fmu.write(state))
    other.restore(read)
    first = run(fmu, 5)
    fmu.restore(state)
    assert run(fmu, 5) == first
    assert run(other, 5) == first
    fmu.free(state)
    other.free(read)


def test_a_state_of_fmi_2_is_read_by_fmi_3(make, models, built, unzipped_once):
    """They are the same program below the names of the functions."""
    path = built("native")["sensor"]
    old = Instance(path, unzipped_once(path))
    old.initialize()
    old.set("strain", 0.2)
    old.step(1e-3)
    state = old.slave.getFMUstate()
    fmu = make("sensor")
    read = fmu.read(old.slave.serializeFMUstate(state))
    fmu.restore(read)
    assert advance(fmu, models["sensor"], "sensor", 1) == advance_old(old, models["sensor"])
    old.slave.freeFMUstate(state)
    fmu.free(read)
    old.slave.freeInstance()


def advance_old(old, model):
    for key, value in excite("sensor", 1).items():
        old.set(key, value)
    assert old.step(3e-4) == 0
    return old.get(*(v.name for v in model.variables[model.slices()[2]]))


def test_derivatives_with_arrays_are_those_of_fmi_2(make, models, built, unzipped_once):
    model = models["membrane"]
    fmu = initialized(make("membrane"))
    path = built("native")["membrane"]
    old = Instance(path, unzipped_once(path))
    old.initialize()
    for k in range(5):
        advance(fmu, model, "membrane", k)
        for key, value in excite("membrane", k).items():
            old.set(key, value)
        assert old.step(3e-4) == 0
    known = [reference for reference, group in fmu.groups.items() if model.names[group.start] in ("pressure", "damage[1]")]
    unknown = [reference for reference, group in fmu.groups.items() if model.names[group.start].startswith("strain")]
    flat = {True: [], False: []}
    for references, is_known in ((known, True), (unknown, False)):
        flat[is_known] = [place for reference in references for place in fmu.groups[reference]]
    seed = np.random.default_rng(0).uniform(-1.0, 1.0, 17).tolist()
    found = fmu.slave.getDirectionalDerivative(unknown, known, seed, 4)
    assert found == old.slave.getDirectionalDerivative(flat[False], flat[True], seed)
    assert np.abs(found).min() > 0.0
    old.slave.freeInstance()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda fmu: fmu.set([7], [0.1] * 16), "'damage[1]' is a result"),
        (lambda fmu: fmu.set([1], [0.1]), "'start_time' is fixed"),
        (lambda fmu: fmu.set([6], [0.1] * 3), "have 4 values, not 3"),
        (lambda fmu: fmu.slave.getFloat64([7], 17), "have 16 values, not 17"),
        (lambda fmu: fmu.slave.getFloat64([99]), "value reference 99"),
        (lambda fmu: fmu.set([0], [1.0]), "value reference 0"),
        (lambda fmu: fmu.slave.getInt32([1]), "Float64 only"),
        (lambda fmu: fmu.step(-1.0), "must be a positive time"),
        (lambda fmu: fmu.step(1e9), "Use shorter communication steps"),
        (lambda fmu: fmu.start(), "fmi3EnterInitializationMode is not allowed while model 'detector' is running"),
        (lambda fmu: fmu.slave.enterEventMode(), "the model description does not offer it"),
        (lambda fmu: fmu.slave.getDirectionalDerivative([7], [1], [1.0], 16), "'start_time' is no input"),
        (lambda fmu: fmu.read(b"GOSSAMER"), "no saved state of model 'detector'"),
    ],
)
def test_a_refusal_says_why_and_the_run_goes_on(make, models, call, message):
    fmu = initialized(make("detector"))
    before = advance(fmu, models["detector"], "detector", 0)
    with pytest.raises(FMICallException):
        call(fmu)
    assert message in fmu.messages[-1].decode()
    results = [reference for reference, group in fmu.groups.items() if group.start >= models["detector"].slices()[2].start]
    assert fmu.get(results) == before
    advance(fmu, models["detector"], "detector", 1)


@pytest.mark.parametrize("name", FMUS)
def test_fmpy_finds_no_problem_and_simulates_the_default_experiment(fmus3, name):
    assert validate_fmu(str(fmus3[name])) == []
    result = fmpy.simulate_fmu(str(fmus3[name]))
    assert len(result) > 10
    assert all(np.isfinite(result[column]).all() for column in result.dtype.names)


@pytest.mark.parametrize("name", FMUS)
def test_fmutool_finds_no_problem(fmus3, name):
    command = [sys.executable, "-m", "fmu_manipulation_toolbox.cli.fmutool", "-input", str(fmus3[name]), "-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    assert "No semantic error against the FMI-3 standard" in output
    assert not re.search(r"^(WARNING|ERROR|CRITICAL)", output, re.MULTILINE), output


@pytest.mark.parametrize("name", FMUS)
def test_the_diagram_names_all_inputs_and_outputs_and_the_build_description_is_valid(fmus3, models, name):
    with zipfile.ZipFile(fmus3[name]) as archive:
        picture = ET.fromstring(archive.read("documentation/diagram.svg"))
        build = etree.fromstring(archive.read("sources/buildDescription.xml"))
        texts = " ".join(element.text or "" for element in picture.iter("{http://www.w3.org/2000/svg}text"))
        for array in arrays_of(models[name]):
            if array.members[0].causality in ("input", "output"):
                assert re.search(rf"\b{array.name}\b", texts)
        schema = Path(fmpy.__file__).parent / "schema/fmi3/fmi3BuildDescription.xsd"
        etree.XMLSchema(etree.parse(str(schema))).assertValid(build)
        for file in build.iter("SourceFile"):
            assert f"sources/{file.get('name')}" in archive.namelist()


def test_the_users_own_style_of_pictures_does_not_change_an_fmu(models):
    with mpl.rc_context({"font.size": 20, "axes.grid": True, "patch.linewidth": 3}):
        drawn = diagrams(models["sensor"])
    assert drawn == diagrams(models["sensor"])


@pytest.mark.skipif(not shutil.which("gcc"), reason="builds with gcc, as an importing tool would")
@pytest.mark.parametrize("name", ["sensor", "detector"])
def test_the_sources_can_be_built_as_described_and_give_the_same_numbers(make, models, fmus3, tmp_path, name):
    fmpy.extract(str(fmus3[name]), str(tmp_path))
    build = ET.parse(tmp_path / "sources/buildDescription.xml")
    (binary,) = (tmp_path / "binaries").rglob("*.so")
    original = binary.read_bytes()
    sources = [element.get("name") for element in build.iter("SourceFile")]
    headers = Path(fmpy.__file__).parent / "c-code"  # an importing tool has its own
    libraries = [f"-l{element.get('name')}" for element in build.iter("Library")]
    subprocess.run(
        ["gcc", "-std=c11", "-I", headers, "-O2", "-shared", "-fPIC", "-o", binary, *sources, *libraries],
        cwd=tmp_path / "sources",
        check=True,
    )
    assert binary.read_bytes() != original
    fmu, rebuilt = initialized(make(name)), initialized(Fmi3(models[name], fmus3[name], str(tmp_path)))
    for k in range(50):
        assert advance(rebuilt, models[name], name, k) == advance(fmu, models[name], name, k)
    rebuilt.slave.freeInstance()
