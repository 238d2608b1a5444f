"""What is in an FMU: a valid description, true capabilities, reproducible bytes, pages that are up to date."""

import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from building import build_fmu
from fmpy.validation import validate_fmu
from fmu_host import FMUS, model_of
from gossamer_fmus import NAMES, build_all, build_models, variables_table
from gossamer_fmus.catalogue import MODELS, fmu_folder, make_model
from gossamer_fmus.description import arrays_of, base_unit
from gossamer_fmus.page import with_variables
from gossamer_models import ArtifactError, ParameterError, StepModel, Stepper, Variable, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane.square import square_structure
from gossamer_models.sensor import Scales, default_artifact
from gossamer_models.sensor.artifact import DEFAULT_TRACKING
from gossamer_orchestrator import make_plan, parse_scenario
from oracles.direct import direct_inverse
from oracles.preisach import spring

only_python = pytest.mark.parametrize("kind", ["python"], indirect=True)


@pytest.mark.parametrize("name", FMUS)
def test_fmpy_finds_no_problem(fmus, name):
    assert validate_fmu(str(fmus[name])) == []


@pytest.mark.parametrize("name", FMUS)
def test_fmutool_finds_no_problem(fmus, name):
    command = [sys.executable, "-m", "fmu_manipulation_toolbox.cli.fmutool", "-input", str(fmus[name]), "-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    assert "No semantic error against the FMI-2 standard" in output
    assert not re.search(r"^(WARNING|ERROR|CRITICAL)", output, re.MULTILINE), output


def test_a_build_that_ends_between_two_renames_is_said_until_it_is_repeated(tmp_path, monkeypatch, caplog):
    models = {name: model_of("sensor") for name in ("a", "b")}
    build_models(models, tmp_path)
    replace = Path.replace

    def end(self, target):
        if target.name == "a.fmu":
            msg = "killed"
            raise OSError(msg)
        return replace(self, target)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", end)
        with pytest.raises(OSError, match="killed"):
            build_models(models, tmp_path)
    scenario = parse_scenario("step = 0.1\nstop = 0.1\n[components.s]\nfmu = 'b'\ninputs = { strain = 0 }\n")
    make_plan(scenario, tmp_path)
    assert "a build of a, b in" in caplog.text
    caplog.clear()
    build_models(models, tmp_path)
    make_plan(scenario, tmp_path)
    assert caplog.text == ""


@only_python
@pytest.mark.parametrize("name", FMUS)
def test_two_builds_give_the_same_bytes(fmus, tmp_path, name):
    assert build_fmu(model_of(name), tmp_path).read_bytes() == fmus[name].read_bytes()


def test_a_build_in_another_process_gives_the_same_bytes(fmus, kind, tmp_path):
    """Hash seeds, temporary folders and import order differ there."""
    build = f"build_all(Path({str(tmp_path)!r}), native={kind == 'native'})"
    subprocess.run(
        [sys.executable, "-c", f"from pathlib import Path; from gossamer_fmus import build_all; {build}"], check=True
    )
    for name in NAMES:
        assert (tmp_path / f"{name}.fmu").read_bytes() == fmus[name].read_bytes()


@only_python
def test_another_model_has_another_guid_and_other_module_names(fmus, tmp_path):
    other = build_fmu(MODELS["membrane"](square_structure(4, 2)), tmp_path)
    assert fmpy.read_model_description(str(other)).guid != fmpy.read_model_description(str(fmus["membrane"])).guid
    names = [{n for n in zipfile.ZipFile(p).namelist() if n.endswith(".py")} for p in (other, fmus["membrane"])]
    assert not names[0] & names[1]


@pytest.mark.parametrize("name", FMUS)
def test_every_variable_has_a_unit_a_description_and_its_range(fmus, models, name):
    description = fmpy.read_model_description(str(fmus[name]))
    for found, wanted in zip(description.modelVariables, models[name].variables, strict=True):
        assert (found.name, found.unit, found.description) == (wanted.name, wanted.unit, wanted.description)
        assert [None if text is None else float(text) for text in (found.min, found.max, found.nominal, found.start)] == [
            wanted.minimum,
            wanted.maximum,
            wanted.nominal,
            wanted.start,
        ]


@only_python
@pytest.mark.parametrize("name", FMUS)
def test_no_package_of_ours_and_no_top_level_pythonfmu_travels_inside(fmus, name):
    for member in zipfile.ZipFile(fmus[name]).namelist():
        parts = member.split("/")
        if parts[0] == "resources" and member.endswith(".py"):
            assert re.fullmatch(r"(step|slave)_[0-9a-f]{16}(\.py)?", parts[1]), member


@pytest.mark.parametrize("name", FMUS)
def test_the_documentation_page_lists_the_variables(fmus, models, name):
    page = zipfile.ZipFile(fmus[name]).read("documentation/index.html").decode()
    assert "<table>" in page
    assert models[name].variables[0].description in page


@pytest.mark.parametrize("name", [name for name in NAMES if fmu_folder(name).is_dir()])
def test_the_table_in_the_readme_is_up_to_date(models, name, rewrite_goldens):
    path = fmu_folder(name) / "README.md"
    wanted = with_variables(path.read_text(encoding="utf-8"), models[name])
    if rewrite_goldens:
        path.write_text(wanted, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == wanted, "run 'make goldens'"


@pytest.mark.parametrize(
    ("name", "folder"), [("estimator", "compensator"), ("filter", "compensator"), ("framed_membrane", "membrane")]
)
def test_the_tables_of_the_other_variants_are_up_to_date(models, name, folder, rewrite_goldens):
    path = fmu_folder(folder) / "README.md"
    begin, end = f"<!-- variables of the {name} -->\n", f"\n<!-- end of variables of the {name} -->"
    text = path.read_text(encoding="utf-8")
    before, rest = text.split(begin)
    wanted = before + begin + variables_table(models[name]) + end + rest.split(end)[1]
    if rewrite_goldens:
        path.write_text(wanted, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == wanted, "run 'make goldens'"


@pytest.mark.parametrize(
    ("unit", "attributes"),
    [
        ("1", {}),
        ("Pa", {"kg": "1", "m": "-1", "s": "-2"}),
        ("kg/m3", {"kg": "1", "m": "-3"}),
        ("m/s2", {"m": "1", "s": "-2"}),
        ("Hz", {"s": "-1"}),
        ("rad", {"rad": "1"}),
        ("ohm", {"kg": "1", "m": "2", "s": "-3", "A": "-2"}),
        ("kPa", {"kg": "1", "m": "-1", "s": "-2", "factor": "1000.0"}),
        ("mol", {"mol": "1"}),
    ],
)
def test_units_are_reduced_to_si(unit, attributes):
    assert base_unit(unit) == attributes


@pytest.mark.parametrize("unit", ["degC", "m**0.5", "lbs_per_moon", "bit"])
def test_a_unit_that_a_model_description_cannot_say_is_refused(unit):
    with pytest.raises(ParameterError, match=re.escape(repr(unit))):
        base_unit(unit)


@pytest.mark.parametrize(
    "names", [("a[1]", "a[3]"), ("a[1,1]", "a[2,1]", "a[1,2]", "a[2,2]"), ("a[1]", "b", "a[2]"), ("a[2]", "a[1]")]
)
def test_elements_that_are_no_array_are_refused(names):
    variables = tuple(Variable(name=n, causality="input", unit="1", description="x", start=0.0) for n in names)
    u, p, x, h = ca.MX.sym("u", len(names)), ca.MX.sym("p", 0), ca.MX.sym("x", 0), ca.MX.sym("h")
    init, step = ca.Function("init", [u, p], [x, x]), ca.Function("step", [x, u, p, h], [x, x])
    with pytest.raises(ParameterError, match="the elements of 'a'"):
        arrays_of(StepModel(name="toy", description="x", variables=variables, init=init, step=step))


def test_fmi_3_without_native_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="Add native=True"):
        build_all(tmp_path, fmi=3)


@only_python
def test_an_artifact_or_a_mesh_can_be_chosen(fmus, tmp_path):
    default_artifact().write(tmp_path / "sensor.json")
    built = build_all(tmp_path, ["sensor", "compensator"], artifact=tmp_path / "sensor.json")
    assert built["sensor"].read_bytes() == fmus["sensor"].read_bytes()
    for mesh, text in (
        ({"elements_per_side": 8, "order": 1}, "64 quadrilaterals of order 1"),
        ({"order": 3}, "of order 3"),
        ({"law": "relaxed"}, "law relaxed"),
    ):
        other = build_all(tmp_path, ["membrane"], **mesh)["membrane"]
        assert text in fmpy.read_model_description(str(other)).description
    estimator = build_all(tmp_path, ["estimator"])["estimator"]
    assert "strain_deviation" in {v.name for v in fmpy.read_model_description(str(estimator)).modelVariables}
    assert validate_fmu(str(estimator)) == []
    with pytest.raises(ParameterError, match="'membrane' is not built from an artifact"):
        build_all(tmp_path, ["membrane"], artifact=tmp_path / "sensor.json")
    with pytest.raises(ParameterError, match="'sensor' has no mesh"):
        build_all(tmp_path, ["sensor"], elements_per_side=8)
    with pytest.raises(ParameterError, match="'detector' has no mesh"):
        build_all(tmp_path, ["detector"], order=6)
    with pytest.raises(ParameterError, match="'sensor' has no law"):
        build_all(tmp_path, ["sensor"], law="hencky")
    with pytest.raises(ParameterError, match="no law 'huke'"):
        build_all(tmp_path, ["membrane"], law="huke")
    with pytest.raises(ArtifactError, match=r"gossamer\.sensor"):
        build_all(tmp_path, ["detector"], artifact=tmp_path / "sensor.json")


@only_python
def test_a_fractional_artifact_builds_a_sensor_and_nothing_else(fmus, tmp_path):
    from gossamer_models.fractional import FractionalArtifact, FractionalTerm

    term = FractionalTerm(coefficient=0.1, order=0.3)
    artifact = FractionalArtifact(
        model="sub-model-1", direct=0.4, terms=(term,), full_scale_strain=0.1, resistance_change=50.0
    )
    path = tmp_path / "fractional.json"
    artifact.write(path)
    built = build_all(tmp_path, ["sensor"], artifact=path)["sensor"]
    assert validate_fmu(str(built)) == []
    both = [fmpy.read_model_description(str(fmu)).modelVariables for fmu in (built, fmus["sensor"])]
    names = [[(v.name, v.unit, v.causality) for v in variables] for variables in both]
    assert names[0] == names[1]
    with pytest.raises(ParameterError, match=r"fractional.json holds .* no inverse.*model=.preisach."):
        build_all(tmp_path, ["sensor", "compensator"], artifact=path)
    with pytest.raises(ArtifactError, match=r"gossamer\.fractional"):
        build_all(tmp_path, ["detector"], artifact=path)
    replace(artifact, model="sub-model-2").write(path)
    with pytest.raises(ParameterError, match=r"whole record.*fractional-sub-model-1"):
        build_all(tmp_path, ["sensor"], artifact=path)
    path.write_text("{}")
    with pytest.raises(ArtifactError, match="cannot read the artifact"):
        build_all(tmp_path, ["sensor"], artifact=path)


@pytest.mark.parametrize("native", [False, True], ids=["python", "native"])
def test_the_fmu_of_a_direct_inverse_gives_what_its_model_gives(tmp_path, native):
    scales = Scales(rest_resistance=100.0, full_scale_resistance_change=50.0, full_scale_strain=0.2)
    artifact = replace(spring(), inverse=direct_inverse((1, 3), step=0.05), scales=scales)
    artifact.write(tmp_path / "direct.json")
    fmu = build_all(tmp_path, ["compensator"], native=native, artifact=tmp_path / "direct.json")["compensator"]
    assert validate_fmu(str(fmu)) == []
    names, time = ["strain", "present_strain", "strain_deviation", "delay", "saturated"], 0.1 * np.arange(41)
    R = 125.0 + 30.0 * np.sin(time)
    signal = np.array(list(zip(time, R, strict=True)), dtype=[("time", float), ("resistance", float)])
    found = fmpy.simulate_fmu(str(fmu), stop_time=4.0, step_size=0.1, output_interval=0.1, input=signal, output=names)
    stepper = Stepper(compensator_model(artifact))
    stepper.initialize()
    expected = simulate(stepper, np.full(40, 0.1), {"resistance": R[:-1]}, names)
    for name in names:
        assert found[name][1:] == pytest.approx(expected[name], abs=1e-12), name


def test_a_sensor_without_scales_is_built_with_stated_ones_or_not_at_all(tmp_path):
    """Its FMU would start at scales of no sensor, and recover wrong strain without a word."""
    path = tmp_path / "signal.json"
    replace(default_artifact(), provenance={"data": "another"}).write(path)
    for name in ("sensor", "compensator", "estimator"):
        with pytest.raises(ParameterError, match=r"signal\.json holds no scales.*scales=.*1000,150,0\.2.*rest_resistance="):
            build_all(tmp_path, [name], artifact=path)
    built = build_all(tmp_path, ["sensor"], artifact=path, scales=(1000.0, 150.0, 0.2))["sensor"]
    starts = {v.name: v.start for v in fmpy.read_model_description(str(built)).modelVariables}
    names = ("rest_resistance", "full_scale_resistance_change", "full_scale_strain")
    assert [float(starts[name]) for name in names] == [1000.0, 150.0, 0.2]
    with pytest.raises(ParameterError, match="three numbers, not 2"):
        build_all(tmp_path, ["sensor"], artifact=path, scales=(1000.0, 150.0))
    with pytest.raises(ParameterError, match="'membrane' has no scales"):
        build_all(tmp_path, ["membrane"], scales=(1000.0, 150.0, 0.2))


def test_numbers_of_a_compensator_that_were_not_measured_are_named(tmp_path, caplog):
    """Artifacts of earlier versions hold no noise, and those of a named model no numbers of a filter."""
    path = tmp_path / "old.json"
    scales = Scales(rest_resistance=1000.0, full_scale_resistance_change=150.0, full_scale_strain=0.2)
    old = replace(default_artifact(), scales=scales)
    for compensator, tracking, noise in ((None, None, None), ("estimator", None, None), (None, DEFAULT_TRACKING, 1e-4)):
        replace(old, compensator=compensator, tracking=tracking, noise=noise).write(path)
        said = {}
        for name in ("sensor", "compensator", "estimator", "filter"):
            caplog.clear()
            make_model(name, artifact=path)
            said[name] = caplog.text
        assert not said["sensor"]
        assert ("old.json holds no measured noise" in said["estimator"]) == (noise is None)
        assert ("holds no measured noise" in said["compensator"]) == (compensator == "estimator")
        assert ("old.json holds no numbers of a filter" in said["filter"]) == (tracking is None)


def test_sensor_and_filter_are_built_from_any_sensor_and_where_one_is_refused_none_is_written(tmp_path):
    term = replace(default_artifact().relaxation[0], gain=True)
    scales = Scales(rest_resistance=40.0, full_scale_resistance_change=18.0, full_scale_strain=0.3)
    stored = tmp_path / "sensor.json"
    replace(default_artifact(), relaxation=(term,), scales=scales).write(stored)
    with pytest.raises(ParameterError, match="gossamer build filter --artifact") as refused:
        build_all(tmp_path / "fmus", ["sensor", "estimator"], artifact=stored)
    assert refused.value.__notes__ == ["That was estimator; none of sensor, estimator was written."]
    assert not (tmp_path / "fmus").exists()
    assert set(build_all(tmp_path / "fmus", ["sensor", "filter"], artifact=stored)) == {"sensor", "filter"}
