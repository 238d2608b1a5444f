"""Every mistake in the text of a scenario is refused with its line, its name and what to do."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import ScenarioError, load_scenario, make_plan, parse_scenario

TEXT_REFUSALS = {
    "syntax": (
        ("step = 0.1", "step = 0.1.2"),
        "chain.toml:3: Expected newline .* column 11. Correct the TOML syntax there.",
    ),
    "unknown key": (("step = 0.1", "step = 0.1\nstpo = 2.0"), "chain.toml:4: unknown key 'stpo'. Did you mean 'stop'?"),
    "unknown key in a component": (
        ('fmu = "gain"\n', 'fmu = "gain"\nparamters = {}\n'),
        "chain.toml:8: unknown key 'paramters' in 'components.source'. Did you mean 'parameters'?",
    ),
    "missing key": (("stop = 1.0\n", ""), "chain.toml:1: key 'stop' is missing. Add it."),
    "missing key in a connection": (
        ('to = "integral.u"', ""),
        "chain.toml:13: key 'to' in 'connections' is missing. Add it.",
    ),
    "wrong type": (("step = 0.1", 'step = "0.1"'), "chain.toml:3: 'step': input should be a valid number, not '0.1'."),
    "step not positive": (("step = 0.1", "step = 0.0"), "chain.toml:3: 'step': input should be greater than 0, not 0.0."),
    "infinite stop": (("stop = 1.0", "stop = inf"), "chain.toml:4: 'stop': input should be a finite number, not inf."),
    "stop before start": (("stop = 1.0", "stop = -1.0"), r"chain.toml:4: 'stop' \(-1 s\) must lie after 'start' \(0 s\)"),
    "stop between steps": (
        ("stop = 1.0", "stop = 1.04"),
        "chain.toml:4: 'stop' = 1.04 s is not a whole number of steps of 0.1 s after 'start'. The nearest is 1.",
    ),
    "absurdly many steps": (
        ("step = 0.1", "step = 1e-9"),
        r"chain.toml:3: 'step' = 1e-09 s makes 1e\+09 steps .* at most 1e\+08 are allowed. Use a longer 'step'",
    ),
    "uncountable steps": (("stop = 1.0", "stop = 1e308"), "'step' = 0.1 s makes more steps than can be counted from"),
    "absurdly rare records": (
        ("[[connections]]", "[record]\nevery = 100000000000000000000\n[[connections]]"),
        "chain.toml:14: 'every' in 'record': input should be less than or equal to 100000000",
    ),
    "unknown array of tables": (
        ("[[connections]]", "[[records]]\n[[connections]]"),
        "chain.toml:13: unknown key 'records'. Did you mean 'record'?",
    ),
    "no number": (
        ("u = 2.0", "u = nan"),
        r"^chain.toml:8: 'u' in 'components.source.inputs': should be a finite number, true, false, "
        "a text, or an array of these, not nan.$",
    ),
    "keys without end": (("stop = 1.0", "stop = 1.0\n" + 3000 * "a." + "b = 1"), "chain.toml: .* nested too deeply"),
    "nested without end": (("stop = 1.0", "stop = " + 100_000 * "["), "chain.toml: .* nested too deeply"),
    "unknown master": (
        ("step = 0.1", 'step = 0.1\nmaster = "gauss"'),
        "chain.toml:4: 'master': input should be 'gauss-seidel' or 'jacobi', not 'gauss'.",
    ),
    "endpoint without a dot": (
        ('to = "integral.u"', 'to = "integral"'),
        "chain.toml:15: 'to' in 'connections': write component.variable, not 'integral'.",
    ),
    "component name": (("[components.source]", '[components."1st"]'), "'1st' cannot be a name. Use letters"),
    "probability": (
        ('to = "integral.u"', 'to = "integral.u"\ndropout = { probability = 2.0 }'),
        "chain.toml:16: 'probability' in 'connections.dropout': input should be less than or equal to 1, not 2.0.",
    ),
    "event outside the run": (
        ('to = "integral.u"', 'to = "integral.u"\n[[events]]\ntime = 1.5\ncomponent = "source"\nset = { u = 1.0 }'),
        "chain.toml:17: the event at 1.5 s lies outside the run, 0 to 1 s. Move it",
    ),
}


@pytest.mark.parametrize("case", TEXT_REFUSALS)
def test_a_mistake_in_the_text_is_refused(chain, case):
    change, message = TEXT_REFUSALS[case]
    with pytest.raises(ScenarioError, match=message):
        chain(change)


INLINE = """
step = 0.1
stop = 1.0
connections = [
    # braces { and commas, in a comment
    { from = "a.y", to = "b.u" },
    { from = "b.y", to = "c.u" }, { from = "b.y", to = "c.offset[1]" },
    { from = "b.y", to = "c.nothing" },
]
[components]
a = { fmu = "gain", inputs = { u = 0.0, "offset[*]" = 0.0 } }
b = { fmu = "gain", inputs = { "offset[*]" = 0.0 } }
c = { fmu = "gain", inputs = { "offset[2]" = 0.0 } }
"""


def test_the_line_of_an_element_of_an_inline_array_is_found(fmus):
    with pytest.raises(ScenarioError, match="scenario:8: FMU 'gain' has no input 'nothing'"):
        make_plan(parse_scenario(INLINE), fmus)
    with pytest.raises(ScenarioError, match="scenario:11: FMU 'gain' has no parameter 'x'"):
        make_plan(parse_scenario(INLINE.replace('"gain", inputs', '"gain", parameters = { x = 1 }, inputs', 1)), fmus)


def test_a_missing_scenario_file_is_refused_with_a_suggestion(tmp_path):
    (tmp_path / "damaged.toml").write_text("")
    with pytest.raises(ScenarioError, match=r"there is no scenario file .*damged.toml. Did you mean 'damaged.toml'\?"):
        load_scenario(tmp_path / "damged.toml")
