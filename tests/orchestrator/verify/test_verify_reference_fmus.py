"""``verify`` and ``info`` of FMUs of the behaviour of the FMI project's: no false alarm, and no fault is missed."""

from __future__ import annotations

import zipfile

import pytest
from command_line import invoke
from gossamer_orchestrator import FmuFile
from gossamer_orchestrator.verify import FAILED, PASSED, REMARK, verify
from gossamer_orchestrator.verify.checks import CHECKS
from reference.build import NAMES

FMUS = [f"{name}{fmi}" for fmi, names in NAMES.items() for name in names]
QUICK = set(CHECKS) - {"memory"}  # which takes seconds, whatever the FMU


@pytest.mark.parametrize("name", FMUS)
def test_verify_has_no_failure(reference_fmus, name):
    findings = verify(reference_fmus / f"{name}.fmu", only=QUICK)
    assert len(findings) == 1 + len(QUICK)
    assert [f for f in findings if f.verdict == FAILED] == []
    assert {f.check for f in findings if f.verdict == REMARK} <= {"units", "steps"}


@pytest.mark.parametrize("fmi", [2, 3])
def test_one_that_ends_the_simulation_is_remarked_and_its_memory_is_counted_over_several_runs(reference_fmus, fmi):
    findings = {f.check: f for f in verify(reference_fmus / f"Stair{fmi}.fmu", only={"steps", "memory"})}
    assert findings["steps"].verdict == REMARK
    assert "ends the simulation in step 44 of 0.2 s, by t = 9 s" in findings["steps"].why
    assert findings["memory"].verdict == PASSED


FAULTS = {  # what is changed in the model description
    "an output that the binary does not have": ("Stair3", 'valueReference="1"', 'valueReference="9"'),
    "the independent variable, which it does not have": ("Stair3", 'valueReference="0"', 'valueReference="9"'),
    "another type": ("Stair3", "<Int32", "<Int16"),
    "another type of FMI 2.0": ("Stair2", '<Integer start="1"/>', '<Boolean start="true"/>'),
    "a size that the binary does not have": ("StateSpace3", 'valueReference="3"', 'valueReference="33"'),
    "a token of another binary": ("Dahlquist2", "{test-Dahlquist-2}", "{another}"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_verify_finds_a_model_description_that_does_not_fit_the_binary(reference_fmus, tmp_path, fault):
    name, old, new = FAULTS[fault]
    path = tmp_path / "faulty.fmu"
    with zipfile.ZipFile(reference_fmus / f"{name}.fmu") as source, zipfile.ZipFile(path, "w") as target:
        for member in source.namelist():
            content = source.read(member)
            if member == "modelDescription.xml":
                assert old.encode() in content
                content = content.replace(old.encode(), new.encode())
            target.writestr(member, content)
    failed = [f for f in verify(path, only={"readable"}) if f.verdict == FAILED]
    assert [f.check for f in failed] == ["start" if "token" in fault else "readable"]


@pytest.mark.parametrize("name", FMUS)
def test_info_lists_every_variable_with_its_type(reference_fmus, name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    result = invoke(["info", str(reference_fmus / f"{name}.fmu")])
    assert result.exit_code == 0, result.output
    rows = [[cell.strip() for cell in line.split("│")[1:4]] for line in result.output.splitlines() if "│" in line]
    shown = ("structuralParameter", "parameter", "input", "output")
    variables = [v for v in FmuFile(reference_fmus / f"{name}.fmu").description.modelVariables if v.causality in shown]
    types = {v.name: f"{v.type}[{','.join(map(str, v.shape))}]" if v.shape else v.type for v in variables}
    assert {row[0]: row[2] for row in rows} == types
