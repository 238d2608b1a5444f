"""``gossamer twin``: tables and results of a run in, a table of zones and a JSON file out."""

import json
from pathlib import Path

import meshio
import numpy as np
import pytest
import xarray as xr
from command_line import invoke
from gossamer import TwinAnswer
from gossamer.damage import _compared
from gossamer.records import find_in_results
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import Answer, MembraneForward, ResponseRecord
from gossamer_models.twin.simulation import SensedForward
from gossamer_orchestrator import OrchestratorError, ResultsError
from reading_pages import read_page, values
from saving import save_results

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

STEP, STEPS = 3e-4, 400
MESH = ("--elements-per-side", "4", "--order", "1")
TRUE = np.zeros(16)
TRUE[5], TRUE[10] = 0.3, 0.15


@pytest.fixture
def call():
    return lambda *arguments: invoke(["twin", *(str(a) for a in arguments)])


@pytest.fixture(scope="module")
def forward():
    return SensedForward(MembraneForward(square_structure(4, 1), {"mass_damping": 30.0}), default_artifact())


@pytest.fixture(scope="module")
def strain(forward):
    return forward.forward.strain(TRUE[None], {}, {}, STEPS, STEP)


def table(path, values):
    """Write a record as a meter may: in ms and per cent, with decimal commas."""
    rows = [";".join(map(repr, [1e3 * STEP * (k + 1), *row])) for k, row in enumerate((100.0 * values).T.tolist())]
    head = "time [ms];" + ";".join(f"strain[{k}] [%]" for k in range(1, 5))
    path.write_text("\n".join([head, *rows]).replace(".", ","))
    return path


@pytest.fixture
def results(tmp_path, forward, strain):
    """Results of a run of membrane and sensors, its rest at time 0 included."""
    resistance = forward.resistance(strain, STEP)[0]
    time = STEP * np.arange(STEPS + 1)
    variables = {"gauge.strain": (("time", "strain_index"), np.vstack([np.zeros(4), strain[0].T]))}
    parameters = forward.bank.parameters
    fmus = {"gauge": {"model": "membrane", "parameters": {"mass_damping": 30.0, "other": 1.0}}}
    connections = []
    for k in range(4):
        variables[f"r{k}.resistance"] = ("time", np.r_[1.0, resistance[k]])
        fmus[f"r{k}"] = {"model": "sensor", "parameters": {n: float(v[k]) for n, v in parameters.items()}}
        connections.append([f"gauge.strain[{k + 1}]", f"r{k}.strain"])
    attributes = {
        "schema": "gossamer.results",
        "version": 1,
        "fmus": json.dumps(fmus),
        "connections": json.dumps(connections),
    }
    data = xr.Dataset(variables, coords={"time": time, "strain_index": np.arange(1, 5)}, attrs=attributes)
    return save_results(data, tmp_path)[0]


def test_a_table_gives_the_damage_of_each_zone(call, tmp_path, strain):
    path = table(tmp_path / "r.csv", strain[0])
    result = call(path, *MESH, "--set", "mass_damping=30", "--noise", "1e-5")
    assert result.exit_code == 0, result.stderr
    assert result.stdout.split() == [str(tmp_path / "twin.json"), str(tmp_path / "twin/report.html")]
    page, charts = read_page(tmp_path / "twin/report.html")
    assert page.inside["verdict"].startswith("Damaged in the first 0.12 s: zone 6 by 30.00 ± ")
    assert "within its bound" in page.inside[None]
    measured, read = charts["Sensor 2"]["traces"]
    assert values(measured["y"]) == pytest.approx(100.0 * strain[0, 1], rel=1e-5)
    assert values(read["y"]) == pytest.approx(100.0 * strain[0, 1], abs=1e-3)
    assert values(charts["Damage"]["traces"][0]["y"]) == pytest.approx(100.0 * TRUE, abs=1e-2)
    assert charts["Damage"]["layout"]["xaxis"]["range"] == [0.4, 16.6]  # has ticks at zones alone
    np.testing.assert_allclose(json.loads((tmp_path / "twin.json").read_text())["damage"], TRUE, atol=1e-4)
    assert "30.00 ±" in result.stderr
    assert "valid: chi2 per sample" in result.stderr


def test_a_file_without_an_ending_gets_one_so_that_its_page_has_a_folder(call, results, tmp_path):
    result = call(results, *MESH, "--kind", "strain", "--out", tmp_path / "answer")
    assert result.stdout.split() == [str(tmp_path / "answer.json"), str(tmp_path / "answer/report.html")]
    page, _ = read_page(tmp_path / "answer/report.html")
    assert ("title", {}) in page.tags
    assert f"Digital twin of {tmp_path.name}" in (tmp_path / "answer/report.html").read_text(encoding="utf-8")
    again = call(results, *MESH, "--kind", "strain", "--out", tmp_path / "answer")
    assert (again.exit_code, again.stdout) == (0, result.stdout)


@pytest.mark.parametrize("ending", ["", ".json"])
def test_the_page_of_a_run_is_not_replaced(call, results, tmp_path, ending):
    refused = call(results, *MESH, "--out", f"{tmp_path}{ending}")
    assert refused.exit_code == 1
    assert f"would replace that of the run in {tmp_path}. Name another file with --out." in refused.stderr


def test_what_was_compared_of_a_longer_record_is_said():
    given, used = (ResponseRecord(step=3e-4, values=np.zeros((4, n)), kind="strain", noise=None) for n in (5100, 1000))
    sentence = _compared(Path("out/my run"), given, used, None)
    assert sentence == (
        "Compared: 0 to 0.3 s of a record of 1.53 s. For damage that begins later use 'gossamer watch \"out/my run\"'."
    )
    assert _compared(Path("out"), given, used, 1.53).startswith("Compared: 0 to 0.3 s of the first 1.53 s.")
    assert _compared(Path("out"), used, used, None) == ""


def test_an_answer_that_is_not_valid_is_written_and_its_page_says_so(call, tmp_path, strain):
    """The noise is estimated from the record."""
    noisy = strain[0] + np.random.default_rng(0).normal(0.0, 2e-3, strain[0].shape)
    given = (table(tmp_path / "r.csv", noisy), *MESH, "--set", "mass_damping=10", "--known", "all")
    result = call(*given)
    assert result.exit_code == 3, result.output
    written = json.loads((tmp_path / "twin.json").read_text())
    assert (written["valid"], written["damage"]) == (False, None)
    assert "withheld" in result.stderr
    page, charts = read_page(tmp_path / "twin/report.html")
    assert page.inside["verdict"] == "Not valid. The damage of the zones is withheld."
    assert "Damage" not in charts
    assert "ABOVE its bound" in page.inside[None]
    assert "Most likely the damping is" in page.inside[None]
    assert call(*given, "--show-invalid").exit_code == 3
    assert len(json.loads((tmp_path / "twin.json").read_text())["deviation"]) == 16
    page, charts = read_page(tmp_path / "twin/report.html")
    assert page.inside["verdict"].startswith("Not valid. What it says, not to be used:")
    assert "Damage" in charts


@pytest.mark.parametrize(
    ("kind", "fit", "off"), [("resistance", "none", 0), ("resistance", "sensor", 4), ("strain", "none", 0)]
)
def test_results_of_a_run_bring_their_parameters_and_sensors_that_keep_to_their_model(
    call, results, tmp_path, kind, fit, off
):
    result = call(results, *MESH, "--kind", kind, "--fit", fit, "--out", tmp_path / "t.json")
    assert result.exit_code == 0, result.stderr
    answer = json.loads((tmp_path / "t.json").read_text())
    np.testing.assert_allclose(answer["damage"], TRUE, atol=1e-3)
    assert len(answer["sensor_errors"]) == off


def test_units_of_edited_results_are_read(results):
    data = xr.open_dataset(results, engine="scipy").load()
    name = next(str(each) for each in data.data_vars if str(each).endswith(".strain") and data[each].ndim == 2)
    in_percent = data.assign({name: (100.0 * data[name]).assign_attrs(units="%")})
    expected = find_in_results(data, "strain").record.values
    np.testing.assert_allclose(find_in_results(in_percent, "strain").record.values, expected)
    with pytest.raises(OrchestratorError, match=r"strain is in 'm', which is no unit of strain\. Write 1\."):
        find_in_results(data.assign({name: data[name].assign_attrs(units="m")}), "strain")


def test_a_sensor_that_does_not_move_is_named(call, tmp_path, strain):
    values = strain[0].copy()
    values[1] = 0.02
    path = table(tmp_path / "r.csv", values)
    result = call(path, *MESH, "--set", "mass_damping=30", "--noise", "1e-5")
    assert result.exit_code == 0
    assert "Sensor 2 does not move and is left out." in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "colour=1"), "no parameter 'colour'"),
        (("--set", "density=heavy"), "'heavy' is no number"),
        (("--stop", "0.003"), "needs 60 or more"),
        (("--stop", "inf"), "--stop is inf. Write a positive number."),
        (("--fit", "offset,colour"), "no nuisance 'colour'"),
        (("--sensor", "missing.json", "--kind", "resistance"), "needs the columns time and resistance"),
    ],
)
def test_a_mistake_is_said_alone(call, tmp_path, strain, arguments, message):
    result = call(table(tmp_path / "r.csv", strain[0]), *MESH, *arguments)
    assert result.exit_code == 1
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""


def test_results_without_resistance_say_what_to_record(call, results, tmp_path):
    data = xr.open_dataset(results, engine="scipy").load()
    bare = save_results(data.drop_vars([f"r{k}.resistance" for k in range(4)]), tmp_path / "bare")[0]
    result = call(bare, *MESH, "--kind", "resistance")
    assert result.exit_code == 1
    assert "Add sensor?.resistance to [record]" in result.stderr


def test_compensated_strain_is_moved_back_and_its_noise_is_what_is_stated(results, strain):
    data = xr.open_dataset(results, engine="scipy").load()
    with pytest.raises(ResultsError, match=r"Add compensator\?\.strain to \[record\]"):
        find_in_results(data, "compensated")
    late = {f"compensator{k}.strain": ("time", np.r_[np.zeros(25), strain[0, k - 1, :-24]]) for k in range(1, 5)}
    late["compensator2.delay"] = ("time", np.full(STEPS + 1, 24 * STEP))
    late["compensator2.strain_deviation"] = ("time", np.linspace(1e-3, 3e-3, STEPS + 1))
    record = find_in_results(data.assign(late), "compensated").record
    np.testing.assert_allclose(record.values[1, :-24], strain[0, 1, :-24])
    assert np.isnan(record.values[1, -24:]).all()
    np.testing.assert_allclose(record.values[0, 24:], strain[0, 0, :-24])
    np.testing.assert_allclose(record.least_noise, [0.0, 2e-3, 0.0, 0.0])
    assert record.noise_deviation()[1] == pytest.approx(2e-3)


def test_the_table_has_a_column_of_remarks_only_where_there_is_one():
    known = dict.fromkeys(("damage", "deviation", "probability"), np.zeros(16))
    known |= {"zones": tuple(f"rim {k}" for k in range(16)), "together_with": ((),) * 16}
    fields = dict.fromkeys(Answer.__dataclass_fields__) | known
    headings = [
        list(shown.head)
        for zones in ((), (3,))
        for shown in TwinAnswer(files=[Path()], compared="", answer=Answer(**fields | {"unresolved": zones})).tables()
    ]
    assert headings == [["zone", "damage [%]", "P(damaged)"], ["zone", "damage [%]", "P(damaged)", "remark"]]


@pytest.fixture
def strip(tmp_path):
    """Write a setup: a strip 1 m by 0.1 m of two halves, pulled at its end, without Poisson's ratio."""
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.0, 1.0, 5), [0.0, 0.1]))
    corner = np.arange(4)
    halves = {"near": [corner[:2]], "far": [corner[2:]]}
    ends = {"left": np.flatnonzero(x == 0.0), "right": np.flatnonzero(x == 1.0), "all": np.arange(10)}
    points, quads = np.column_stack([x, y, 0.0 * x]), corner[:, None] + [0, 1, 6, 5]
    meshio.Mesh(points, {"quad": quads}, point_sets=ends, cell_sets=halves).write(tmp_path / "strip.inp")
    (tmp_path / "strip.toml").write_text(
        """mesh = "strip.inp"
        regions = [{ youngs_modulus = 1e8, poisson_ratio = 0.0, density = 1000.0, thickness = 1e-4 }]
        supports = [{ group = "left" }, { group = "all", fixed = "yz" }]
        zones = [{ group = "near", name = "near the hub" }, { group = "far" }]
        loads = [{ name = "pull", kind = "force", groups = ["right"], direction = [1.0, 0.0, 0.0], start = 2.0 }]
        [[sensors]]
        point = [0.3, 0.05, 0.0]
        direction = [1.0, 0.0, 0.0]
        [[sensors]]
        point = [0.8, 0.05, 0.0]
        direction = [1.0, 0.0, 0.0]
        """
    )
    return tmp_path / "strip.toml"


def states(path, far, off=0.0, gain=1.0):
    """Write the readings of a strip, whose far zone has lost some stiffness, under three forces; of its second gauge a gain.

    Of St Venant and Kirchhoff: the force of both nodes over the section is E (1 - d) (e + e^2/2) (1 + e).
    """
    rows = []
    for force in (2.0, 4.0, 6.0):
        stretched = [np.roots([0.5, 1.5, 1.0, -2.0 * force / 1e-5 / (1e8 * left)]) for left in (1.0, 1.0 - far)]
        strain = [float(roots[np.abs(roots - 0.05).argmin()].real) + off * force for roots in stretched]
        rows += [f"{force:g} N,{1e3 * force:g},{strain[0]!r},{gain * strain[1]!r}"] * 2
    path.write_text("\n".join(["state,pull [mN],strain[1],strain[2]", *rows]))
    return path


def test_what_a_healthy_record_has_beside_the_simulation_is_taken_away(call, strip, tmp_path):
    options = ("--setup", strip, "--noise", "1e-5", "--known", "all")
    after, before = states(tmp_path / "after.csv", 0.3, off=1e-3), states(tmp_path / "before.csv", 0.0, off=1e-3)
    result = call(after, *options, "--healthy", before)
    assert result.exit_code == 0, result.stderr
    np.testing.assert_allclose(json.loads((tmp_path / "twin.json").read_text())["damage"], [0.0, 0.3], atol=2e-3)
    before.write_text(before.read_text().replace("2 N,", "two,"))
    assert "the healthy record has other load states" in call(after, *options, "--healthy", before).stderr
    alone = call(after, *options, "--healthy", before, "--no-mesh-error")
    assert "only where the error of the mesh is known. Use it with a setup, and with --mesh-error." in alone.stderr


def test_a_setup_carries_its_calibration_and_every_later_twin_knows_it(call, strip, tmp_path):
    strip.write_text("priors = { gain = 0.1, modulus = 0.0, thickness = 0.0, density = 0.0 }\n" + strip.read_text())
    healthy, torn = (states(tmp_path / f"{far:g}.csv", far, gain=1.05) for far in (0.0, 0.3))
    known = tmp_path / "later" / "known.toml"
    given = ["--setup", str(strip), "--noise", "1e-5", "--no-mesh-error", "--out", str(known)]
    result = invoke(["calibrate", str(healthy), *given])
    assert result.exit_code == 0, result.output
    assert f"gossamer twin record.csv --setup {known}" in " ".join(result.stderr.split())
    text = known.read_text()
    assert 'mesh = "../strip.inp"' in text
    assert "[calibration]" in text
    result = call(torn, "--setup", known, "--noise", "1e-5", "--known", "amplitude")
    assert result.exit_code == 0, result.stderr
    answer = json.loads((tmp_path / "twin.json").read_text())
    np.testing.assert_allclose(answer["estimate"], [0.0, 0.3], atol=0.02)
    gains = [answer["nuisances"][f"gain[{k}]"] for k in (1, 2)]
    assert gains[1][0] / gains[0][0] == pytest.approx(1.05, abs=0.005)  # which of them is right, one load does not tell
    again = invoke(["calibrate", str(healthy), *given[:1], str(known), *given[2:-1], str(tmp_path / "twice.toml")])
    assert "the setup is calibrated. Begin with the drawing." in " ".join(again.stderr.split())


def test_load_states_of_a_setup_give_damage_by_the_names_of_its_zones(call, strip, tmp_path):
    table = states(tmp_path / "states.csv", 0.3)
    result = call(table, "--setup", strip, "--noise", "1e-5", "--known", "all")
    assert result.exit_code == 0, result.stderr
    answer = json.loads((tmp_path / "twin.json").read_text())
    assert answer["zones"] == ["near the hub", "far"]
    np.testing.assert_allclose(answer["damage"], [0.0, 0.3], atol=1e-4)
    page, _ = read_page(tmp_path / "twin/report.html")
    assert page.inside["verdict"].startswith("Damaged in 3 load states: zone far by 30.00 ±")
    table.write_text(table.read_text().replace("pull", "pul"))
    refused = call(table, "--setup", strip, "--noise", "1e-5")
    assert refused.exit_code == 1
    assert "the membrane has no load 'pul'. Did you mean 'pull'?" in refused.stderr
