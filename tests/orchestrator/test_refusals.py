"""Every mistake in a scenario is refused with its line, its name and what to do."""

from __future__ import annotations

import stat
import zipfile

import pytest
from gossamer_orchestrator import (
    FmuError,
    FmuFile,
    Recorder,
    ScenarioError,
    load_scenario,
    make_plan,
    parse_scenario,
)
from gossamer_orchestrator.fmi import archive

INTEGRAL = '[components.integral]\nfmu = "integrator"'
WIRE = '[[connections]]\nfrom = "source.y"\nto = "integral.u"'

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
    "step not positive": (
        ("step = 0.1", "step = 0.0"),
        "chain.toml:3: 'step': input should be greater than 0, not 0.0.",
    ),
    "infinite stop": (("stop = 1.0", "stop = inf"), "chain.toml:4: 'stop': input should be a finite number, not inf."),
    "stop before start": (
        ("stop = 1.0", "stop = -1.0"),
        r"chain.toml:4: 'stop' \(-1 s\) must lie after 'start' \(0 s\)",
    ),
    "stop between steps": (
        ("stop = 1.0", "stop = 1.04"),
        "chain.toml:4: 'stop' = 1.04 s is no whole number of steps of 0.1 s after 'start'; the nearest is 1.",
    ),
    "absurdly many steps": (
        ("step = 0.1", "step = 1e-9"),
        r"chain.toml:3: 'step' = 1e-09 s makes 1e\+09 steps .* at most 1e\+08 are run. Use a longer 'step'",
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
        r"^chain.toml:8: 'u' in 'components.source.inputs': should be a finite number, true, false or a text, not nan.$",
    ),
    "nested without end": (("stop = 1.0", "stop = " + 100_000 * "["), "chain.toml: .* nested too deeply"),
    "unknown master": (
        ("step = 0.1", 'step = 0.1\nmaster = "gauss"'),
        "chain.toml:4: 'master': input should be 'gauss-seidel' or 'jacobi', not 'gauss'.",
    ),
    "endpoint without a dot": (
        ('to = "integral.u"', 'to = "integral"'),
        "chain.toml:15: 'to' in 'connections': write component.variable, not 'integral'.",
    ),
    "component name": (("[components.source]", '[components."1st"]'), "'1st' cannot be a name: use letters"),
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


def more(text: str) -> tuple[str, str]:
    return (WIRE, f"{WIRE}\n{text}")


PLAN_REFUSALS = {
    "missing fmu": (
        ('fmu = "gain"', 'fmu = "gane"'),
        "chain.toml:7: there is no FMU 'gane' in .*Did you mean 'gain'\\? Build the FMUs with 'gossamer build'",
    ),
    "missing fmu file": (
        ('fmu = "gain"', 'fmu = "nowhere/gain.fmu"'),
        "chain.toml:7: there is no FMU 'nowhere/gain.fmu'",
    ),
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
        "^chain.toml:8: input 'u' of FMU 'gain' is a Real and cannot be 'two'.$",
    ),
    "input too large": (
        ("u = 2.0", f"u = 1{400 * '0'}"),
        r"input 'u' of FMU 'gain' is a Real and cannot be larger than 1.79769e\+308.",
    ),
    "parameter among inputs": (
        ("u = 2.0", "factor = 1.0, u = 2.0"),
        "chain.toml:8: 'factor' is a parameter: put it under parameters; it is fixed during the run.",
    ),
    "input among parameters": (
        (INTEGRAL, f"{INTEGRAL}\nparameters = {{ u = 1.0 }}"),
        "chain.toml:12: 'u' is an input: put it under inputs.",
    ),
    "event on a parameter": (
        more('[[events]]\ntime = 0.5\ncomponent = "source"\nset = { factor = 1.0 }'),
        "chain.toml:19: 'factor' is a parameter: put it under parameters; it is fixed during the run.",
    ),
    "array as a scalar": (
        ('to = "integral.u"', 'to = "source.offset"'),
        r"chain.toml:15: FMU 'gain' has no input 'offset'. It is an array: offset\[1\] .. offset\[2\].",
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
        "chain.toml:18: nothing to record fits 'sauce.\\*'. There is no component 'sauce'. Did you mean 'source'?",
    ),
    "parameter of another type": (
        ('fmu = "gain"', 'fmu = "bounded"\nparameters = { factor = "ten" }'),
        "chain.toml:8: parameter 'factor' of FMU 'bounded' is a Real and cannot be 'ten'.",
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
        "chain.toml:19: nothing to record fits 'integral.x'. Did you mean 'integral.[uy]'",
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


def two_gains(a: str, b: str, extra: str = "") -> str:
    return (
        f'step = 0.1\nstop = 1.0\n[components]\na = {{ fmu = "{a}", inputs = {{ u = 1500.0, "offset[*]" = 0.0 }} }}\n'
        f'b = {{ fmu = "{b}", inputs = {{ "offset[*]" = 0.0 }} }}\n'
        f'[[connections]]\nfrom = "a.y"\nto = "b.u"\n{extra}'
    )


def test_units_of_another_dimension_are_refused(fmus):
    message = (
        r"scenario:8: units of 'a.y' and 'b.u': 'Pa' \(kg m-1 s-2\) is not 'm' \(m\). Connect variables of one unit."
    )
    for extra in ("", "gain = 2.0"):
        with pytest.raises(ScenarioError, match=message):
            make_plan(parse_scenario(two_gains("pascal", "metre", extra)), fmus)


def test_units_of_another_scale_are_refused_with_the_conversion_that_is_then_accepted(fmus):
    from gossamer_orchestrator import run_scenario

    message = r"'Pa' \(kg m-1 s-2\) is not 'kPa' \(1000 kg m-1 s-2\). Convert with gain = 0.001."
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(two_gains("pascal", "kilo")), fmus)
    data = run_scenario(parse_scenario(two_gains("pascal", "kilo", "gain = 0.001")), fmus)
    assert data["b.y"].values[-1] == pytest.approx(1.5)
    assert data["a.y"].attrs == {"units": "Pa", "long_name": "what comes out"}


def test_a_variable_without_a_unit_fits_any(fmus):
    make_plan(parse_scenario(two_gains("pascal", "gain")), fmus)


RING = """
step = 0.5
stop = 2.0
[components]
a = {{ fmu = "{fmu}"{inputs} }}
b = {{ fmu = "gain", inputs = {{ "offset[*]" = 0.0 }} }}
[[connections]]
from = "a.{output}"
to = "b.u"
[[connections]]
from = "b.y"
to = "a.u"
"""


def test_an_algebraic_loop_is_refused_with_its_path(fmus):
    text = RING.format(fmu="gain", output="y", inputs=', inputs = { "offset[*]" = 0.0 }')
    for master in ("", 'master = "jacobi"\n'):
        with pytest.raises(
            ScenarioError, match=r":\d+: algebraic loop: b.y -> a.u -> a.y -> b.u -> b.y. Cut one[^\n]*$"
        ):
            make_plan(parse_scenario(master + text), fmus)


def test_a_circle_without_feedthrough_needs_an_order(fmus):
    text = RING.format(fmu="delay", output="last_u", inputs="")
    with pytest.raises(
        ScenarioError, match=r"components feed each other in a circle: a -> b -> a. Name them in 'order'"
    ):
        make_plan(parse_scenario(text), fmus)


def test_what_is_wrong_with_an_fmu_or_their_folder_is_said_once(fmus, tmp_path):
    (tmp_path / "gain.fmu").write_text("no FMU")
    text = two_gains("gain", "gain")
    with pytest.raises(ScenarioError, match=r"^scenario:4: [^\n]*gain.fmu is no FMU. It is text.$"):
        make_plan(parse_scenario(text), tmp_path)
    message = r"^scenario: there is no folder \S+ with FMUs. Build them: gossamer build --out \S+, or name [^\n]*$"
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(text), tmp_path / "none")


def test_a_table_of_absurd_size_is_refused_before_it_is_made(chain, fmus):
    plan = make_plan(chain(("stop = 1.0", "stop = 1e7")), fmus)
    assert len(plan.columns) == 5
    message = r"chain.toml:1: 5 variables at 100000001 points take 4.8 GB, more than 2. Record fewer .* 'every' = 3"
    with pytest.raises(ScenarioError, match=message):
        Recorder(plan)


def test_a_pattern_that_sets_different_quantities_is_told(fmus, caplog):
    text = 'step = 0.1\nstop = 1.0\n[components.m]\nfmu = "{}"\ninputs = {{ "*" = 1.0 }}\n'
    make_plan(parse_scenario(text.format("gain")), fmus)
    assert caplog.text == ""
    make_plan(parse_scenario(text.format("metre")), fmus)
    assert "scenario:5: '*' sets variables of different units to 1.0: u, offset[1], offset[2]" in caplog.text


@pytest.mark.parametrize("factor", ["0", "INF", "NaN"])
def test_units_that_no_number_converts_are_refused(other_unit, tmp_path, factor):
    other_unit("a", "y", "m", 'm="1"')
    other_unit("b", "u", "z", f'm="1" factor="{factor}"')
    for extra in ("", "gain = 2.0"):
        with pytest.raises(ScenarioError, match=r"units of 'a.y' and 'b.u': .* Connect variables of one unit."):
            make_plan(parse_scenario(two_gains("a", "b", extra)), tmp_path)


def test_a_missing_scenario_file_is_refused_with_a_suggestion(tmp_path):
    (tmp_path / "damaged.toml").write_text("")
    with pytest.raises(ScenarioError, match=r"there is no scenario file .*damged.toml. Did you mean 'damaged.toml'\?"):
        load_scenario(tmp_path / "damged.toml")


def test_a_file_that_is_no_archive_is_refused(tmp_path):
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(FmuError, match=r"text.fmu is no FMU. It is text."):
        FmuFile(tmp_path / "text.fmu")


def test_what_a_file_is_instead_of_an_fmu_is_said(fmus, tmp_path):
    half = (fmus / "gain.fmu").read_bytes()[:3000]
    contents = {"half": half, "picture": b"\x89PNG\r", "nothing": b"", "data": b"\0\1"}
    for name, content in contents.items():
        (tmp_path / f"{name}.fmu").write_bytes(content)
    make_archive(tmp_path / "structure.fmu", "SystemStructure.ssd")
    for name, what in {
        "half": "It is not a whole ZIP archive. Build or copy it again.",
        "picture": "It is a picture",
        "nothing": "It is empty.",
        "data": "It is some other data.",
        "structure": "It is an SSP; 'gossamer run' takes it.",
        "halv": "there is no file .*halv.fmu. Did you mean 'half.fmu'?",
        "": "is no FMU. It is a folder.",
    }.items():
        with pytest.raises(FmuError, match=what):
            FmuFile(tmp_path / f"{name}.fmu" if name else tmp_path)
    with pytest.raises(ScenarioError, match=r"gain.fmu is no scenario, .* It is an FMU; 'gossamer info' and"):
        load_scenario(fmus / "gain.fmu")


def test_an_fmu_is_unpacked_only_as_far_as_it_said(fmus, monkeypatch):
    file = FmuFile(fmus / "gain.fmu")
    monkeypatch.setattr(archive, "MAX_BYTES", 10)
    with pytest.raises(FmuError, match="come out of it"):
        file.folder()
    file.close()


def make_archive(path, name="modelDescription.xml", content="<fmiModelDescription/>", mode=0o644):
    with zipfile.ZipFile(path, "w") as file:
        member = zipfile.ZipInfo(name)
        member.external_attr = mode << 16
        file.writestr(member, content)
    return path


@pytest.mark.parametrize("name", ["../../evil.so", "/etc/evil", "a\\b", "C:evil"])
def test_an_archive_that_leaves_its_folder_is_refused(tmp_path, name):
    with pytest.raises(FmuError, match="would be written outside its folder"):
        FmuFile(make_archive(tmp_path / "evil.fmu", name))


def test_a_link_in_an_archive_is_refused(tmp_path):
    with pytest.raises(FmuError, match="'lib' is a link"):
        FmuFile(make_archive(tmp_path / "link.fmu", "lib", "/etc/passwd", stat.S_IFLNK | 0o777))


def test_an_absurdly_large_archive_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "MAX_BYTES", 10)
    with pytest.raises(FmuError, match="It is not unpacked"):
        FmuFile(make_archive(tmp_path / "bomb.fmu"))


def test_an_archive_without_or_with_a_broken_model_description_is_refused(tmp_path):
    with pytest.raises(FmuError, match=r"holds no modelDescription.xml"):
        FmuFile(make_archive(tmp_path / "empty.fmu", "readme.txt"))
    with pytest.raises(FmuError, match=r"its modelDescription.xml is not valid"):
        FmuFile(make_archive(tmp_path / "broken.fmu"))


def test_an_fmu_without_a_binary_for_this_machine_is_refused_when_it_is_started(fmus, tmp_path, chain):
    from gossamer_orchestrator import run_scenario

    with zipfile.ZipFile(fmus / "gain.fmu") as old, zipfile.ZipFile(tmp_path / "gain.fmu", "w") as new:
        for member in old.infolist():
            if not member.filename.endswith(".so"):
                new.writestr(member, old.read(member))
    (tmp_path / "integrator.fmu").write_bytes((fmus / "integrator.fmu").read_bytes())
    message = (
        r"cannot be started: It has no binaries/\w+/ToyGain.\w+, which this machine needs; it has binaries for win64.$"
    )
    with pytest.raises(FmuError, match=message):
        run_scenario(chain(), tmp_path)
