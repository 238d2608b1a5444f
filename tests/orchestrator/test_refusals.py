"""Every mistake in a scenario is refused with its line, its name and what to do."""

from __future__ import annotations

import stat
import zipfile

import pytest
from gossamer_orchestrator import FmuError, FmuFile, ScenarioError, archive, load_scenario, make_plan, parse_scenario

INTEGRAL = '[components.integral]\nfmu = "integrator"'
WIRE = '[[connections]]\nfrom = "source.y"\nto = "integral.u"'

TEXT_REFUSALS = {
    "syntax": (("step = 0.1", "step = 0.1.2"), "chain.toml: .*line 3.* Correct the TOML syntax"),
    "unknown key": (("step = 0.1", "step = 0.1\nstpo = 2.0"), "chain.toml:4: unknown key 'stpo'. Did you mean 'stop'?"),
    "unknown key in a component": (
        ('fmu = "gain"\n', 'fmu = "gain"\nparamters = {}\n'),
        "chain.toml:8: unknown key 'paramters' in 'components.source'. Did you mean 'parameters'?",
    ),
    "missing key": (("stop = 1.0\n", ""), "chain.toml: key 'stop' is missing. Add it."),
    "missing key in a connection": (
        ('to = "integral.u"', ""),
        "chain.toml:13: key 'to' in 'connections.0' is missing. Add it.",
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
    "unknown master": (
        ("step = 0.1", 'step = 0.1\nmaster = "gauss"'),
        "chain.toml:4: 'master': input should be 'gauss-seidel' or 'jacobi', not 'gauss'.",
    ),
    "endpoint without a dot": (
        ('to = "integral.u"', 'to = "integral"'),
        "chain.toml:15: 'to' in 'connections.0'.*integral",
    ),
    "component name": (("[components.source]", '[components."1st"]'), "'1st' cannot be a name: use letters"),
    "probability": (
        ('to = "integral.u"', 'to = "integral.u"\ndropout = { probability = 2.0 }'),
        "chain.toml:16: 'probability' in 'connections.0.dropout': input should be less than or equal to 1, not 2.0.",
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
        "chain.toml:10",  # integral.u not connected
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


def test_a_missing_scenario_file_is_refused_with_a_suggestion(tmp_path):
    (tmp_path / "damaged.toml").write_text("")
    with pytest.raises(ScenarioError, match=r"there is no scenario file .*damged.toml. Did you mean 'damaged.toml'\?"):
        load_scenario(tmp_path / "damged.toml")


def test_a_file_that_is_no_archive_is_refused(tmp_path):
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(FmuError, match="is no FMU: File is not a zip file"):
        FmuFile(tmp_path / "text.fmu")


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
    with pytest.raises(FmuError, match=r"source: .*cannot be started: Cannot find shared library"):
        run_scenario(chain(), tmp_path)
