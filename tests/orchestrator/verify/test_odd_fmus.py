"""FMUs in C that are odd but right raise no alarm; those that misbehave are named, and leave no process behind."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import zipfile
from pathlib import Path

import pytest
from gossamer_orchestrator.verify import FAILED, NOT_APPLICABLE, PASSED, REMARK, verify
from odd import build

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="its FMUs are written for Linux")

# until it is fed a time that lies behind its end
BRIEF = 'stopTime="0.5" stepSize="0.01"'


@pytest.fixture
def odd(tmp_path):
    """Return a function that makes an FMU of some C statements and tells what ``verify`` finds, by check."""
    pytest.importorskip("ziglang")

    def make(*only, limit=20.0, **how):
        return {each.check: each for each in verify(build(tmp_path / "odd.fmu", **how), only=only or None, limit=limit)}

    return make


def failures(findings):
    return [each for each in findings.values() if each.verdict == FAILED]


def test_a_plain_one_has_no_failure_and_a_fixed_parameter_that_can_be_set_late_is_a_remark(odd):
    """FMI 2.0 forbids the host to set it; what the FMU does then is undefined."""
    findings = odd()
    assert failures(findings) == []
    assert findings["fixed parameter"].verdict == REMARK
    assert findings["fixed parameter"].why == "'p' is fixed, but can be set after initialization, which a host must not do."
    assert "processes" not in findings


def test_one_that_ends_the_simulation_itself_has_no_failure(odd):
    """As FMI 2.0 has it: fmi2Discard, and fmi2Terminated is true; after that a step is an error."""
    ending = "if (time + size > 0.3) { one->over = 1; return fmi2Discard; }"
    for experiment in ('stopTime="1" stepSize="0.01"', 'stepSize="0.01"'):
        findings = odd(step=ending, experiment=experiment)
        assert failures(findings) == []
        assert findings["steps"].verdict == REMARK
        assert "ends the simulation in step 30 of 0.01 s, by t = 0.31 s" in findings["steps"].why
        assert findings["memory"].verdict == PASSED


def test_one_that_refuses_to_go_on_after_its_stop_time_has_no_failure(odd):
    findings = odd(step="if (time + size > 0.5 + 1e-9) return fmi2Error;", experiment=BRIEF)
    assert failures(findings) == []
    assert findings["steps"].why.startswith("50 steps of 0.01 s")


@pytest.mark.parametrize(
    ("experiment", "step"),
    [('stepSize="0"', 0.01), ('stopTime="2" stepSize="-1"', 0.02), ('stopTime="INF" stepSize="INF"', 0.01)],
)
def test_a_default_experiment_that_means_nothing_is_left_out(odd, experiment, step):
    findings = odd("steps", experiment=experiment)
    assert findings["steps"].why == f"100 steps of {step:g} s with start values, outputs finite."


def test_a_discarded_step_without_an_end_is_a_failure_with_one_full_stop(odd):
    findings = odd("steps", "reset", step="if (time > 0.3) return fmi2Discard;")
    assert findings["steps"].why == "Step 31 of 0.01 s is discarded."
    assert findings["reset"].why == "fmi2DoStep failed with status 2 (discard)."


def test_the_limit_holds_for_a_call_not_for_a_check(odd):
    """A hundred steps of 20 ms take longer than the limit of 1 s."""
    findings = odd("steps", step="usleep(20000);", limit=1.0)
    assert failures(findings) == []


@pytest.mark.parametrize("where", ["load", "instantiation", "step"])
@pytest.mark.parametrize("how", ["for (;;) pause();", "for (;;) ;", "raise(SIGSTOP);"])
def test_a_call_that_does_not_return_is_ended(odd, where, how):
    findings = odd("steps", **{where: how}, limit=1.0)
    check = {"load": "exported functions", "instantiation": "start", "step": "steps"}[where]
    assert findings[check].verdict == FAILED
    assert findings[check].why == "The FMU did not answer within 1 s."


def ended(process):
    """Tell whether a process has ended, be it that nobody has asked for its code yet."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except FileNotFoundError:
        return True


@pytest.mark.parametrize(("how", "children"), [
    ("if (time == 0) for (int i = 0; i < 5; i++) start;", 5),
    ("if (time == 0) { if (!fork()) { setsid(); start; _exit(0); } wait(NULL); }", 1),
    ("if (time == 0) { start; for (;;) pause(); }", 1),
])  # fmt: skip
def test_processes_that_it_starts_are_ended_and_reported(odd, tmp_path, how, children):
    """Children, a daemon that has left the group, and a child of a process that hangs itself."""
    start = "{ int child = fork(); if (!child) for (;;) pause(); note(child); }"
    findings = odd("steps", step=how.replace("start;", start), limit=1.0)
    assert findings["processes"].verdict == REMARK
    started = [int(line) for line in (tmp_path / "pids").read_text().split()]
    assert len(started) == children
    assert f"It left {children} running process" in findings["processes"].why
    patience = time.monotonic() + 10.0
    while not all(map(ended, started)) and time.monotonic() < patience:
        time.sleep(0.01)  # a signal takes a moment
    assert all(map(ended, started))


def test_a_child_that_returns_from_a_step_changes_no_verdict(odd):
    """Both processes come back from the first step: one continues, the other must not write into the report."""
    findings = odd("steps", "reset", "two instances", step="if (time == 0) fork();")
    assert failures(findings) == []
    assert [findings[name].verdict for name in ("steps", "reset", "two instances")] == [PASSED] * 3


def test_verify_leaves_no_process_when_it_is_interrupted(odd, tmp_path, request):
    pids = tmp_path / "pids"
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's job in the background ignores it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, usual))

    def interrupt():
        while not pids.exists():
            time.sleep(0.02)
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        odd("steps", step="if (time == 0) { note(getpid()); for (;;) pause(); }")
    (worker,) = (int(line) for line in pids.read_text().split())
    assert worker != os.getpid()
    assert ended(worker)


def test_parameters_that_are_overwritten_in_the_initialization_are_named_with_what_fmi_says(odd):
    overwrites = "one->value[2] = 0.5;"
    (kept, again, lost) = (odd("stated parameters", **how)["stated parameters"] for how in (
        {}, {"entry": overwrites}, {"entry": overwrites, "exit": overwrites},
    ))  # fmt: skip
    assert (kept.verdict, kept.why) == (PASSED, "1 parameters set before the initialization hold after it.")
    law = "FMI: what a host sets before the initialization is the start value. Not kept"
    assert (again.verdict, again.why) == (REMARK, f"{law} unless set again in the initialization mode: p.")
    assert (lost.verdict, lost.why) == (FAILED, f"{law}, not even set again in the initialization mode: p.")


@pytest.mark.parametrize(("check", "how"), [
    ("wrong state", {"step": "if (!one->begun) abort();"}),
    ("fixed parameter", {"setting": "if (one->begun == 2 && r[0] == 2) abort();"}),
    ("wrong token", {"instantiation": 'if (strcmp(guid, "{odd}")) abort();'}),
])  # fmt: skip
def test_a_crash_where_the_host_breaks_the_rules_is_a_remark(odd, check, how):
    findings = odd(check, **how)
    assert failures(findings) == []
    assert findings[check].verdict == REMARK
    assert findings[check].why == "The host breaks a rule of FMI here. The FMU crashed its process: SIGABRT."


def test_a_message_without_text_is_a_remark(odd):
    findings = odd("log messages", step='SAY("");')
    assert (findings["log messages"].verdict, findings["log messages"].why) == (REMARK, "It logs messages without text.")


def test_outputs_that_differ_are_named_with_how_much(odd):
    """The input swings about 0 by 0.01, so an output that is counted up by 1e-6 of all steps differs by 1e-4 of its size."""
    counts = "static double n; one->value[0] = 1.0 + 1e-6 * n++;"
    findings = odd("reset", step=counts, experiment='stopTime="1" stepSize="0.01"')
    why = "After a reset, the outputs differ from step 0 on, y first: 1.0 and 1.0001, by up to 0.0001, 1.0e-04 of its size."
    assert (findings["reset"].verdict, findings["reset"].why) == (FAILED, why)


def test_fmi_1_is_not_applicable(tmp_path):
    counts = 'numberOfContinuousStates="0" numberOfEventIndicators="0"'
    xml = f'<fmiModelDescription fmiVersion="1.0" modelName="old" modelIdentifier="old" guid="x" {counts}><ModelVariables/>'
    with zipfile.ZipFile(tmp_path / "old.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", f"{xml}</fmiModelDescription>")
    findings = verify(tmp_path / "old.fmu")
    assert {each.verdict for each in findings[1:]} == {NOT_APPLICABLE}
    assert findings[1].why == "It is FMI 1.0; only FMI 2.0 and 3.0 for co-simulation and model exchange are checked."


MANIFESTS = {
    "1.0.0-rc.1": """<fmiReferences><Experiment name="ramp" startTime="0.0" stopTime="1.0" stepSize="0.25"><Parameters
        source="p.ssv"/><Stimuli source="in.csv"/><References source="results/ref.csv"/></Experiment></fmiReferences>""",
    "1.0.0-alpha.1": """<fmiReferences><Related role="experiment/smoke-test" source="e.xml"/></fmiReferences>""",
}
EXPERIMENTS = """<Experiments><Experiment name="ramp" startTime="0.0" stepSize="0.25"><Stimuli source="in.csv"/>
    <References source="results/ref.csv"/></Experiment></Experiments>"""
SSV = '<ParameterSet><Parameters><Parameter name="p"><Real value="0.5"/></Parameter></Parameters></ParameterSet>'


@pytest.mark.parametrize("version", MANIFESTS)
def test_an_fmu_is_compared_with_the_results_that_it_carries(tmp_path, version):
    """Its output is its input where the step began: 2 t one step late."""
    path, verdicts = build(tmp_path / "odd.fmu"), []
    for last in (1.5, 1.6):
        rows = "".join(f"{0.25 * k},{y}\n" for k, y in enumerate([0.0, 0.0, 0.5, 1.0, last]))
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(tmp_path / "new.fmu", "w") as new:
            for name in old.namelist():
                new.writestr(name, old.read(name))
            files = {"fmi-ls-manifest.xml": MANIFESTS[version], "e.xml": EXPERIMENTS, "in.csv": "time,u\n0,0\n1,2\n"}
            for name, text in (files | {"results/ref.csv": f"time,y\n{rows}", "p.ssv": SSV}).items():
                new.writestr(f"extra/org.fmi-standard.fmi-ls-ref/{name}", text)
        (finding,) = (each for each in verify(tmp_path / "new.fmu", only=["reference results"]) if "reference" in each.check)
        verdicts.append((finding.verdict, finding.why))
    good = "ramp: it gives its own results, within 0.0e+00 of the largest."
    assert verdicts == [(PASSED, good), (FAILED, "ramp: y is 1.5 at t = 1 s, and 1.6 in its results.")]
