"""The report on any FMU: good ones pass, and each way of being bad is found, named and survived."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import stat
import sys
import zipfile

import pytest
from building import build_fmu
from command_line import invoke
from gossamer_fmus import build_all
from gossamer_models.sensor import sensor_model
from gossamer_orchestrator.verify import FAILED, NOT_APPLICABLE, PASSED, REMARK, verify
from gossamer_orchestrator.verify.checks import Finding
from pythonfmu.builder import FmuBuilder


def repack(source, target, edit):
    """Copy an FMU; what ``edit`` makes of a member's name and content is written, nothing if that is None."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = edit(name, old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


def rewrite(source, target, edit):
    """Copy an FMU with another model description."""
    described = "modelDescription.xml"
    return repack(source, target, lambda name, data: edit(data.decode()).encode() if name == described else data)


def by_name(findings):
    return {finding.check: finding for finding in findings}


def test_our_sensor_has_no_failure(tmp_path):
    findings = verify(build_fmu(sensor_model(), tmp_path))
    assert [f for f in findings if f.verdict == FAILED] == []
    verdicts = {f.check: f.verdict for f in findings}
    for name in (
        "rules, by FMPy",
        "rules, by fmutool",
        "units",
        "steps",
        "save and restore",
        "serialize",
        "reset",
        "reference results",
    ):
        assert verdicts[name] == PASSED
    assert (
        verdicts["two instances"]
        == verdicts["reference results"]
        == verdicts["not a number"]
        == verdicts["memory"]
        == PASSED
    )


@pytest.mark.parametrize("fmi", [2, 3])
def test_our_native_sensor_passes_every_check(tmp_path, fmi):
    pytest.importorskip("ziglang")
    fmu = build_all(tmp_path, ["sensor"], native=True, fmi=fmi)["sensor"]
    findings = verify(fmu)
    assert [f for f in findings if f.verdict != PASSED] == []
    assert "accepted" not in by_name(findings)["not a number"].why
    assert "is nan; it must be a finite number" in by_name(findings)["log messages"].why


# --- files ---


def test_a_truncated_archive_fails_and_nothing_else_is_tried(fmus, tmp_path):
    (tmp_path / "half.fmu").write_bytes((fmus / "gain.fmu").read_bytes()[:5000])
    (finding,) = verify(tmp_path / "half.fmu")
    assert (finding.check, finding.verdict) == ("archive", FAILED)
    assert "It is an incomplete ZIP archive" in finding.why


def test_a_damaged_member_fails(fmus, tmp_path):
    fmu = repack(fmus / "gain.fmu", tmp_path / "flipped.fmu", lambda _name, data: data)  # stored, not deflated
    fmu.write_bytes(fmu.read_bytes().replace(b"<fmiModelDescription", b"<fmiModelDEscription", 1))
    (finding,) = verify(fmu)
    assert finding.verdict == FAILED
    assert "CRC" in finding.why


@pytest.mark.parametrize(("name", "mode", "why"), [
    ("../evil.so", 0o644, "would be written outside its folder"),
    ("lib", stat.S_IFLNK | 0o777, "is a link"),
])  # fmt: skip
def test_an_archive_that_would_leave_its_folder_is_not_unpacked(fmus, tmp_path, name, mode, why):
    shutil.copy(fmus / "gain.fmu", tmp_path / "evil.fmu")
    with zipfile.ZipFile(tmp_path / "evil.fmu", "a") as file:
        member = zipfile.ZipInfo(name)
        member.external_attr = mode << 16
        file.writestr(member, "/etc/passwd")
    (finding,) = verify(tmp_path / "evil.fmu")
    assert finding.verdict == FAILED
    assert why in finding.why


def test_a_missing_binary_fails_and_leaves_the_rest_open(fmus, tmp_path):
    fmu = repack(fmus / "gain.fmu", tmp_path / "bare.fmu", lambda name, data: None if "binaries" in name else data)
    findings = by_name(verify(fmu))
    assert findings["platform"].verdict == FAILED
    assert findings["units"].verdict == REMARK
    assert findings["steps"].verdict == NOT_APPLICABLE
    assert findings["steps"].why == "The check 'platform' failed."


def test_a_binary_that_is_none_fails(fmus, tmp_path):
    fmu = repack(fmus / "gain.fmu", tmp_path / "text.fmu", lambda name, data: b"text" if "binaries" in name else data)
    findings = by_name(verify(fmu))
    assert findings["exported functions"].verdict == FAILED
    assert "cannot be loaded" in findings["exported functions"].why


def test_a_model_description_that_is_no_xml_fails(fmus, tmp_path):
    rewrite(fmus / "gain.fmu", tmp_path / "broken.fmu", lambda xml: xml.replace("</fmiModelDescription>", ""))
    findings = by_name(verify(tmp_path / "broken.fmu"))
    assert findings["model description"].verdict == FAILED
    assert findings["memory"].verdict == NOT_APPLICABLE


def test_a_model_description_against_the_rules_fails_twice_and_runs(fmus, tmp_path):
    """Two variables of one name."""
    rewrite(fmus / "gain.fmu", tmp_path / "twins.fmu", lambda xml: xml.replace('name="offset[2]"', 'name="offset[1]"'))
    findings = by_name(verify(tmp_path / "twins.fmu", only=["rules, by FMPy", "rules, by fmutool", "units", "steps"]))
    assert "offset[1]" in findings["rules, by FMPy"].why
    assert "offset[1]" in findings["rules, by fmutool"].why
    assert findings["units"].verdict == REMARK
    assert findings["steps"].verdict == PASSED


def test_of_model_exchange_everything_but_the_behaviour_is_checked(exchange_fmus):
    findings = by_name(verify(exchange_fmus / "BouncingBall3.fmu"))
    assert "FMI 3.0 for model exchange" in findings["model description"].why
    assert findings["exported functions"].verdict == PASSED
    assert findings["steps"] == Finding("steps", NOT_APPLICABLE, "It is for model exchange.")
    assert not [each for each in findings.values() if each.verdict == FAILED]


# --- behaviour ---

ROGUE = """
import ctypes, os
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Rogue(Fmi2Slave):
    shared = []

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.hidden = 0.0, 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        self.y = self.u
        {body}
        return True
"""

ROGUES = {
    "crashes": ("ctypes.string_at(0)", "steps", "crashed its process: SIG"),
    "hangs": ("while t > 0.5 and True: pass", "steps", "did not answer within 3 s"),
    "raises a signal without a name": ("os.kill(os.getpid(), 40)", "steps", "crashed its process: "),
    "cuts the report short": ("open('report', 'a').write('[\"pas'); os._exit(3)", "steps", "exit code 0x3"),
    "ends the process": ("os._exit(3)", "steps", "ended its process with exit code 0x3"),
    "ends the process quietly": ("os._exit(0)", "steps", "ended its process with exit code 0x0"),
    "raises": ("1 / 0", "steps", "Step 0 of 0.01 s is fatal"),
    "refuses": ("if t > 0.5: return False", "steps", "Step 51 of 0.01 s is discarded"),
    "computes nonsense": ("self.y = float('nan')", "steps", "output is not finite after step 0"),
    "hides a state": ("self.hidden += 1; self.y = self.hidden", "save and restore", "differ from step 0 on"),
    "hides a state from bytes": ("self.hidden += 1; self.y = self.hidden", "serialize", "differ from step 0 on"),
    "shares a state": ("self.shared.append(t); self.y = len(self.shared)", "two instances", "differ from step 0 on"),
    "forgets to reset": ("self.shared.append(t); self.y = len(self.shared)", "reset", "differ from step 0 on"),
    "leaks": ("self.shared.append(bytes(1000))", "memory", "Its process grew by"),
    "dislikes NaN": ("if self.u != self.u: ctypes.string_at(0)", "not a number", "crashed its process: SIG"),
}


def rogue(folder, body):
    (folder / "rogue.py").write_text(ROGUE.format(body=body))
    with contextlib.redirect_stdout(io.StringIO()):
        can = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
        return FmuBuilder.build_FMU(folder / "rogue.py", dest=folder, **can)


@pytest.mark.skipif(sys.platform == "win32", reason="signals are named otherwise there")
@pytest.mark.parametrize("case", ROGUES)
def test_an_fmu_that_misbehaves_is_caught_at_it(tmp_path, case):
    body, check, why = ROGUES[case]
    findings = by_name(verify(rogue(tmp_path, body), only=[check], limit=3.0))
    assert findings["start"].verdict == PASSED
    assert findings[check].verdict == FAILED
    assert why in findings[check].why
    assert not findings[check].why.endswith("Its log ends with: ")


def test_what_follows_a_crash_is_still_checked(tmp_path):
    only = ["steps", "readable", "wrong token", "first outputs", "log messages"]
    findings = by_name(verify(rogue(tmp_path, "ctypes.string_at(0)"), only=only))
    assert findings["steps"].verdict == findings["log messages"].verdict == FAILED
    assert findings["readable"].verdict == findings["first outputs"].verdict == PASSED


# --- the command ---


def test_the_command_prints_a_table_and_exits_1_on_a_failure(fmus, tmp_path):
    (tmp_path / "bad.fmu").write_text("no archive")
    result = invoke(["verify", str(tmp_path / "bad.fmu")])
    assert result.exit_code == 1
    for word in ("bad.fmu", "archive", "failed", "is not an FMU"):
        assert word in result.stdout


def test_the_command_prints_json(fmus):
    result = invoke(["verify", str(fmus / "gain.fmu"), "--json"])
    findings = {f["check"]: f["verdict"] for f in json.loads(result.stdout)[str(fmus / "gain.fmu")]}
    assert findings["steps"] == PASSED
    assert findings["fixed parameter"] == REMARK  # pythonfmu lets a host set anything at any time
    assert result.exit_code == 1
