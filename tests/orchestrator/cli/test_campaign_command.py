"""``gossamer campaign``: one path on stdout, mistakes with their lines, every key documented."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gossamer.descriptions import load_campaign
from gossamer.pages.campaign import campaign_page
from gossamer_models import campaign as models
from gossamer_orchestrator import ScenarioError
from gossamer_orchestrator.scenario.source import shipped_scenarios
from reading_pages import read_page, values

DOCS = Path(__file__).parents[3] / "docs" / "campaigns.md"
RIGHT = """
title = "Right"
cases = 6
chunk = 4
stop = 0.003

[membrane]
elements_per_side = 4
order = 1
parameters = { mass_damping = 10.0 }

[damage]
zones = [1, 2]

[vary]
pressure_amplitude = { factor = [0.9, 1.1] }

[noise]
strain = { uniform = [0.0, 0.02] }
"""
CHAIN = "[chain]\ncompensator_parameters = { dead_bnd = 1.0 }\n"


@pytest.fixture
def call():
    return lambda *arguments: invoke([str(a) for a in arguments])


def written(folder: Path, *changes: tuple[str, str], more: str = "") -> Path:
    text = RIGHT.lstrip()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "c.toml"
    path.write_text(text + more)
    return path


def test_a_campaign_prints_its_store_and_goes_on_where_it_stopped(call, tmp_path):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    path, out = written(tmp_path), tmp_path / "a.zarr"
    result = call("campaign", path, "--out", out, "--workers", 1)
    page = tmp_path / "a" / "report.html"
    assert (result.exit_code, result.stdout.split()) == (0, [str(out), str(page)]), result.stderr
    assert "Right" in result.stderr
    assert "cases per second" in result.stderr
    data = models.read_campaign(out)
    assert data.attrs["campaign.toml"] == path.read_text()
    assert data.sizes == {"case": 6, "sensor": 4, "time": 10, "zone": 16}
    again = call("campaign", path, "--out", out)
    assert (again.exit_code, again.stdout.split()) == (0, [str(out), str(page)])
    assert "All cases were there before this run." in read_page(page)[0].inside[None]
    other = call("campaign", written(tmp_path, ("cases = 6", "cases = 7")), "--out", out)
    assert (other.exit_code, other.stdout) == (1, "")
    assert "cases: 6 there, 7 here" in other.stderr
    (tmp_path / "file").write_text("no folder")
    blocked = call("campaign", path, "--out", tmp_path / "file" / "a.zarr")
    assert blocked.exit_code == 1
    assert blocked.stderr.startswith(f"cannot use {tmp_path / 'file'}")
    assert blocked.stderr.endswith("Name another place with --out.\n")


def test_the_page_shows_what_was_drawn_and_the_histories(call, tmp_path):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    path, out = written(tmp_path, ("cases = 6", "cases = 40"), ("chunk = 4", "chunk = 40")), tmp_path / "a.zarr"
    assert call("campaign", path, "--out", out, "--workers", 1).exit_code == 0
    data = models.read_campaign(out)
    page, charts = read_page(tmp_path / "a/report.html")
    assert page.inside["verdict"] == "All 40 cases are simulated."
    assert "1 to 2 zones lose 5 to 50 % of their stiffness." in page.inside[None]
    assert "Varied: pressure_amplitude times 0.9 to 1.1." in page.inside[None]
    there = data["damage"].to_numpy() > 0.0
    assert values(charts["Cases with damage in a zone"]["traces"][0]["y"]) == there.sum(axis=0).tolist()
    assert sum(values(charts["Damage of damaged zones"]["traces"][0]["y"])) == there.sum()
    assert sum(values(charts["Amplitude of the built-in follower pressure"]["traces"][0]["y"])) == 40
    low, high, middle, *few = charts["Sensor 2"]["traces"]
    strain = 100.0 * data["strain"].to_numpy()[:, 1]
    for trace, share in ((low, 5), (high, 95), (middle, 50)):
        assert values(trace["y"]) == pytest.approx(np.percentile(strain, share, axis=0), rel=1e-5)
    assert [each["name"] for each in few] == ["case 0", "case 20", "case 39"]


def test_cases_that_failed_are_listed_with_what_was_drawn(call, tmp_path):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    path, out = written(tmp_path), tmp_path / "a.zarr"
    assert call("campaign", path, "--out", out, "--workers", 1).exit_code == 0
    data = models.read_campaign(out).load()
    data["failed"][4] = True
    data["strain"][4] = np.nan
    page = campaign_page("mine", data, models.Summary(cases=6, failed=1, simulated=6, seconds=2.0))
    assert page.sentence == "1 of 6 cases failed; their histories are not a number."
    assert page.more[0] == "This run simulated 6 of them in 2.0 s, 3 cases a second."
    assert f"<td>{float(data['pressure_amplitude'][4]):.6g}</td>" in "".join(map(str, page.facts))
    strains = page.charts[-1].traces
    assert all(np.isfinite(each["y"]).all() for each in strains)
    assert [each["name"] for each in strains[3:]] == ["case 0", "case 2", "case 5"]


MISTAKES = {
    "syntax": (("cases = 6", "cases = "), r"^c.toml:2: Invalid value, column 9\. Correct the TOML syntax there\.$"),
    "unknown key": (("chunk", "chnk"), r"^c.toml:3: unknown key 'chnk'\. Did you mean 'chunk'\?$"),
    "unknown key of a table": (("zones", "zone"), r"^c.toml:12: unknown key 'zone' in 'damage'\. Did you mean 'zones'\?$"),
    "unknown key of a range": (("factor", "fator"), "^c.toml:15: unknown key 'fator' in 'vary.press.*'factor'"),
    "unknown distribution": (("uniform", "unifrm"), "^c.toml:18: unknown key 'unifrm' in 'noise.strain'.*'uniform'"),
    "unknown parameter": (
        ("{ mass_damping", "{ mass_damp"),
        r"^c.toml:9: the membrane has no 'mass_damp'\. Did you mean 'mass_damping'\?$",
    ),
    "unknown quantity": (
        ("pressure_amplitude", "pressure_amplitud"),
        r"^c.toml:15: the membrane has no 'pressure_amplitud' to vary\. Did you mean 'pressure_amplitude'\?$",
    ),
    "text for a number": (("cases = 6", 'cases = "6"'), "^c.toml:2: 'cases': input should be a valid integer, not '6'"),
    "another sampling": (("cases = 6", 'cases = 6\nsampling = "sobol"'), "^c.toml:3: 'sampling': input should be 'random'"),
    "one number for two": (("[1, 2]", "[1]"), r"^c.toml:12: 'zones' needs two numbers, \[low, high\]\.$"),
    "three numbers for two": (("[1, 2]", "[1, 2, 3]"), r"^c.toml:12: 'zones' needs two numbers, \[low, high\]\.$"),
    "infinite": (("[0.9, 1.1]", "[0.9, inf]"), "^c.toml:15: .*should be a finite number"),
    "wrong order": (("[1, 2]", "[2, 1]"), r"^c.toml:12: 'zones' is \[2, 1\]. Write two numbers from 0 to 16"),
    "beyond the range": (("[0.9, 1.1]", "[0.9, 1000]"), "^c.toml:15: 'pressure_amplitude' reaches 1e[+]07; .* 1e[+]06 Pa"),
    "part of a step": (("0.003", "0.0031"), "^c.toml:4: 'stop' = 0.0031 s is no whole number of steps"),
    "table for a list": (("[1, 2]", "{ a = 1 }"), "^c.toml:12: 'zones' in 'damage': input should be a valid array"),
    "a date": (("cases = 6", "cases = 2020-01-01"), "^c.toml:2: 'cases': input should be a valid integer, not '2020-01-01'"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_has_its_line_and_says_what_to_do(mistake, tmp_path):
    change, message = MISTAKES[mistake]
    with pytest.raises(ScenarioError, match=message):
        load_campaign(written(tmp_path, change))


def test_all_mistakes_are_reported_at_once(call, tmp_path):
    result = call("campaign", written(tmp_path, ("chunk", "chnk"), ("{ mass_damping", "{ mass_damp")))
    assert result.exit_code == 1
    assert [line.split(": ")[0] for line in result.stderr.splitlines()] == ["c.toml:9", "c.toml:3"]


def test_a_parameter_that_the_chain_does_not_have_is_named_with_its_line(call, tmp_path):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    result = call("campaign", written(tmp_path, more=CHAIN), "--out", tmp_path / "a.zarr")
    assert result.exit_code == 1
    assert result.stderr == "c.toml:20: the compensator has no parameter 'dead_bnd'. Did you mean 'dead_band'?\n"
    assert not (tmp_path / "a.zarr").exists()


def test_an_artifact_is_looked_for_beside_the_file(tmp_path):
    campaign, _ = load_campaign(written(tmp_path, more='[chain]\nartifact = "mine.json"\n'))
    assert campaign.chain.artifact == str(tmp_path / "mine.json")


def test_a_table_of_loads_is_looked_for_beside_the_file(tmp_path):
    (tmp_path / "shake.csv").write_text("time [ms],base_acceleration [m/s2]\n0,0\n1,5\n2,0\n")
    path = written(tmp_path)
    path.write_text(path.read_text().replace("[membrane]", '[membrane]\nload = "shake.csv"'))
    campaign, _ = load_campaign(path)
    assert campaign.membrane.load.values == {"base_acceleration": (0.0, 5.0, 0.0)}
    assert campaign.membrane.load.length == pytest.approx(2e-3)


def test_an_interruption_says_how_to_go_on(call, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(models, "run_campaign", interrupted)
    result = call("campaign", written(tmp_path), "--out", tmp_path / "a.zarr")
    assert (result.exit_code, result.stdout) == (130, "")
    assert "finished chunks are kept" in result.stderr
    assert "Run the same command again" in result.stderr


def test_unknown_campaigns_are_refused_with_a_suggestion(call):
    assert "no shipped campaign of that name. Did you mean 'training'?" in call("campaign", "trainin").stderr


@pytest.mark.parametrize("name", shipped_scenarios("campaign"))
def test_shipped_campaigns_are_right(name):
    campaign, _ = load_campaign(shipped_scenarios("campaign")[name])
    assert campaign.title
    assert campaign.chunks > 1


def test_what_a_file_says_is_what_python_says(tmp_path):
    campaign, _ = load_campaign(written(tmp_path))
    assert campaign == models.CampaignPlan(
        title="Right",
        cases=6,
        chunk=4,
        stop=0.003,
        membrane=models.Mesh(elements_per_side=4, order=1, parameters={"mass_damping": 10.0}),
        damage=models.Damage(zones=(1, 2)),
        vary={"pressure_amplitude": models.Vary(factor=(0.9, 1.1))},
        noise=models.MeasurementNoise(strain=models.Distribution(uniform=(0.0, 0.02))),
    )


def test_every_key_is_documented():
    page = DOCS.read_text()
    tables = (
        models.CampaignPlan,
        models.Mesh,
        models.Damage,
        models.MeasurementNoise,
        models.Chain,
        models.Vary,
        models.Distribution,
    )
    keys = {field.name for table in tables for field in fields(table)}
    missing = [key for key in keys if f"`{key}`" not in page and f"`[{key}]`" not in page and f"{{ {key} =" not in page]
    assert missing == []
