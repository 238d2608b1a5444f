"""Every scenario that does not fit its FMUs is refused with the line, the name and what to do."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from gossamer_orchestrator import ResultsError, ScenarioError, make_plan, parse_scenario
from gossamer_orchestrator.run.stream import check_space

INTEGRAL = '[components.integral]\nfmu = "integrator"'


WIRE = '[[connections]]\nfrom = "source.y"\nto = "integral.u"'


def more(text: str) -> tuple[str, str]:
    return (WIRE, f"{WIRE}\n{text}")


PLAN_REFUSALS = {
    "missing fmu": (
        ('fmu = "gain"', 'fmu = "gane"'),
        "chain.toml:7: there is no FMU 'gane' in .*Did you mean 'gain'\\? Build the FMUs with 'gossamer build'",
    ),
    "missing estimator": (
        ('fmu = "gain"', 'fmu = "estimator"'),
        "chain.toml:7: there is no FMU 'estimator' in .* as the shipped scenario 'own_sensor_filter' does.",
    ),
    "missing fmu file": (('fmu = "gain"', 'fmu = "nowhere/gain.fmu"'), "chain.toml:7: there is no FMU 'nowhere/gain.fmu'"),
    "unknown component": (
        ('to = "integral.u"', 'to = "integrl.u"'),
        r"chain.toml:15: there is no component 'integrl' \(in 'integrl.u'\). Did you mean 'integral'",
    ),
    "unknown output": (
        ('from = "source.y"', 'from = "source.yy"'),
        "chain.toml:14: FMU 'gain' has no output 'yy'. Did you mean 'y'?",
    ),
    "component without a variable": (
        ('from = "source.y"', 'from = "source"'),
        "chain.toml:14: 'from' in 'connections': write component.variable, not 'source'.",
    ),
    "output as input": (
        ('to = "integral.u"', 'to = "integral.y"'),
        "chain.toml:15: 'integral.y' is a Real output; a connection needs a Real input. Known: u.",
    ),
    "doubly connected": (
        more('[[connections]]\nfrom = "source.y"\nto = "integral.u"'),
        "chain.toml:18: input 'integral.u' is connected twice, first at chain.toml:15. Remove one",
    ),
    "unconnected": (
        (WIRE, ""),
        r"chain.toml:10: component 'integral' has inputs that are neither connected nor given: u. Connect them or add "
        r'inputs = { "u" = 0 }',
    ),
    "partly given": (
        ('"offset[*]" = 0.0', '"offset[1]" = 0.0'),
        r"chain.toml:6: component 'source' has inputs that are neither connected nor given: offset\[2\]",
    ),
    "connected and given": (
        (INTEGRAL, f"{INTEGRAL}\ninputs = {{ u = 1.0 }}"),
        "chain.toml:12: input 'integral.u' is connected and given a value. Remove one of the two.",
    ),
    "unknown input": (("u = 2.0", "v = 2.0, u = 2.0"), "chain.toml:8: FMU 'gain' has no input 'v'. "),
    "unknown parameter": (
        (INTEGRAL, f"{INTEGRAL}\nparameters = {{ limt = 1.0 }}"),
        "chain.toml:12: FMU 'integrator' has no parameter 'limt'. Did you mean 'limit'?",
    ),
    "pattern without match": (('"offset[*]" = 0.0', '"offset*" = 0.0, "shift*" = 1.0'), r"has no input 'shift\*'"),
    "parameter out of range": (
        ('fmu = "gain"', 'fmu = "bounded"\nparameters = { factor = 11 }'),
        "chain.toml:8: parameter 'factor' of FMU 'bounded' must lie in -10 to 10 m, not 11.",
    ),
    "input out of range": (  # and not "neither connected nor given" too
        ("u = 2.0", 'u = "two"'),
        "^chain.toml:8: input 'u' of FMU 'gain' is of type Real and cannot be 'two'.$",
    ),
    "input too large": (
        ("u = 2.0", f"u = 1{400 * '0'}"),
        r"input 'u' of FMU 'gain' is of type Real and cannot be larger than 1.79769e\+308.",
    ),
    "parameter among inputs": (
        ("u = 2.0", "factor = 1.0, u = 2.0"),
        "chain.toml:8: 'factor' is a parameter, which is fixed during the run. Put it under parameters.",
    ),
    "input among parameters": (
        (INTEGRAL, f"{INTEGRAL}\nparameters = {{ u = 1.0 }}"),
        "chain.toml:12: 'u' is an input. Put it under inputs.",
    ),
    "event on a parameter": (
        more('[[events]]\ntime = 0.5\ncomponent = "source"\nset = { factor = 1.0 }'),
        "chain.toml:19: 'factor' is a parameter, which is fixed during the run. Put it under parameters.",
    ),
    "array as a scalar": (
        ('to = "integral.u"', 'to = "source.offset"'),
        r"chain.toml:15: 'source.y' is a scalar and 'source.offset' is an array of 2 elements. Connect arrays of one size, "
        r"or one element, such as 'offset\[1\]'.",
    ),
    "misspelt origin alone": (
        ('from = "source.y"', 'from = "source.x"'),
        "^chain.toml:14: FMU 'gain' has no output 'x'. [^\n]*$",
    ),
    "swapped": (
        ('from = "source.y"\nto = "integral.u"', 'from = "integral.u"\nto = "source.y"'),
        "^chain.toml:14: 'integral.u' is an input and 'source.y' an output. Swap from and to.$",
    ),
    "unknown component to record": (
        more('[record]\nvariables = [\n  "sauce.*",\n]'),
        "chain.toml:18: no variable to record matches 'sauce.\\*'. There is no component 'sauce'. Did you mean 'source'?",
    ),
    "parameter of another type": (
        ('fmu = "gain"', 'fmu = "bounded"\nparameters = { factor = "ten" }'),
        "chain.toml:8: parameter 'factor' of FMU 'bounded' is of type Real and cannot be 'ten'.",
    ),
    "event on an unknown component": (
        more('[[events]]\ntime = 0.5\ncomponent = "sauce"\nset = { u = 1.0 }'),
        "chain.toml:18: there is no component 'sauce'. Did you mean 'source'?",
    ),
    "event on an unknown input": (
        more('[[events]]\ntime = 0.5\ncomponent = "source"\nset = { uu = 1.0 }'),
        "chain.toml:19: FMU 'gain' has no input 'uu'. Did you mean 'u'?",
    ),
    "event on a connected input": (
        more('[[events]]\ntime = 0.5\ncomponent = "integral"\nset = { u = 1.0 }'),
        "chain.toml:19: input 'integral.u' is connected, so no event can set it",
    ),
    "nothing to record": (
        more('[record]\nvariables = [\n  "source.*",\n  "integral.x",\n]'),
        "chain.toml:19: no variable to record matches 'integral.x'. Did you mean 'integral.[uy]'",
    ),
    "order with a stranger": (
        ("step = 0.1", 'step = 0.1\norder = ["source", "integrl"]'),
        "chain.toml:4: 'order' names a component 'integrl' that is not there. Did you mean 'integral'\\?\n"
        "chain.toml:4: 'order' must name every component once; missing: integral.",
    ),
    "order under jacobi": (
        ("step = 0.1", 'step = 0.1\nmaster = "jacobi"\norder = ["source", "integral"]'),
        "chain.toml:5: 'order' has no meaning for master = \"jacobi\"",
    ),
}


@pytest.mark.parametrize("case", PLAN_REFUSALS)
def test_a_scenario_that_does_not_fit_its_fmus_is_refused(chain, fmus, case):
    change, message = PLAN_REFUSALS[case]
    with pytest.raises(ScenarioError, match=message):
        make_plan(chain(change), fmus)


def test_all_mistakes_are_reported_at_once(chain, fmus):
    scenario = chain(('from = "source.y"', 'from = "source.z"'), ("u = 2.0", "v = 2.0"))
    with pytest.raises(ScenarioError) as caught:
        make_plan(scenario, fmus)
    assert [line.split(": ")[0] for line in str(caught.value).splitlines()] == [
        "chain.toml:14",  # no output z
        "chain.toml:8",  # no input v
        "chain.toml:6",  # u not given
    ]


def test_what_is_wrong_with_an_fmu_or_their_folder_is_said_once(fmus, tmp_path, two_gains):
    (tmp_path / "gain.fmu").write_text("no FMU")
    text = two_gains("gain", "gain")
    with pytest.raises(ScenarioError, match=r"^scenario:4: [^\n]*gain.fmu is not an FMU. It is text.$"):
        make_plan(parse_scenario(text), tmp_path)
    message = r"^scenario: there is no folder \S+ with FMUs. Build them: gossamer build --out \S+, or name [^\n]*$"
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(text), tmp_path / "none")


def test_results_that_do_not_fit_on_the_disk_are_refused_before_the_run(chain, fmus, tmp_path, monkeypatch):
    plan = make_plan(chain(("stop = 1.0", "stop = 1e7")), fmus)
    assert len(plan.columns) == 5
    monkeypatch.setattr("shutil.disk_usage", lambda _folder: SimpleNamespace(free=4_000_000_000))
    message = r"chain.toml:1: 5 scalars at 100000001 points take 4.8 GB, and .* has 4 GB free. Record fewer .* 'every'"
    with pytest.raises(ResultsError, match=message):
        check_space(plan, tmp_path)


def test_a_pattern_that_sets_different_quantities_is_told(fmus, caplog):
    text = 'step = 0.1\nstop = 1.0\n[components.m]\nfmu = "{}"\ninputs = {{ "*" = 1.0 }}\n'
    make_plan(parse_scenario(text.format("gain")), fmus)
    assert caplog.text == ""
    make_plan(parse_scenario(text.format("metre")), fmus)
    assert "scenario:5: '*' sets variables of different units to 1.0: u, offset[1], offset[2]" in caplog.text
