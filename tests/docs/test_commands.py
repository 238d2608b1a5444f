"""Every command and snippet of the pages: commands parse, and a test runs them, or a list says why none does."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import gossamer
import pytest
from gossamer.arguments import declared
from gossamer.cli import COMMON, parsed
from gossamer.cli import commands as known_commands
from gossamer_orchestrator.scenario.source import shipped_scenarios

ROOT = Path(__file__).resolve().parents[2]
PATTERNS = ("*.md", "docs/*.md", "docs/tools/*.md", "docs/site/**/*.md", "fmus/*/README.md")
PAGES = sorted({path.relative_to(ROOT).as_posix() for pattern in PATTERNS for path in ROOT.glob(pattern)})
CLI = "tests/orchestrator/cli"
TUTORIALS = "tests/docs/test_tutorials.py"

# Which test runs a command of gossamer, with options of its own.
RUN_BY = {
    "assess": f"{CLI}/test_assess_sensor_command.py",
    "assess-detector": f"{CLI}/test_assess_command.py",
    "build": TUTORIALS,
    "calibrate": f"{CLI}/test_calibrate_command.py",
    "campaign": f"{CLI}/test_campaign_command.py",
    "container": "tests/orchestrator/exchange/test_container.py",
    "demo": "tests/test_wheel.py",
    "export-ssp": "tests/orchestrator/exchange/test_ssp_export.py",
    "export-vtk": "tests/orchestrator/results/test_surface.py",
    "flight": f"{CLI}/test_flight_command.py",
    "identify": TUTORIALS,
    "info": TUTORIALS,
    "inspect": f"{CLI}/test_inspect_command.py",
    "modes": f"{CLI}/test_modes_command.py",
    "new": "tests/orchestrator/scenario/test_new_scenario.py",
    "place-sensors": f"{CLI}/test_place_sensors_command.py",
    "plot": "tests/orchestrator/results/test_surface.py",
    "recover": f"{CLI}/test_recover_command.py",
    "reduce": f"{CLI}/test_reduce_command.py",
    "report": "tests/orchestrator/results/test_report.py",
    "run": TUTORIALS,
    "sweep": "tests/orchestrator/run/test_sweep.py",
    "train": f"{CLI}/test_train_command.py",
    "twin": f"{CLI}/test_twin_command.py",
    "validate": f"{CLI}/test_validate_command.py",
    "verify": "tests/orchestrator/verify/test_verify.py",
    "view": TUTORIALS,
    "watch": f"{CLI}/test_watch_command.py",
}
OTHER_PROGRAMS = {
    "make": "the tests are run by it",
    "pip": "changes the environment; tests/test_wheel.py installs Gossamer into one of its own",
    "jupyter": "opens a browser; tests/docs/test_notebooks.py runs the notebooks",
    "source": "for a shell that a user types into",
    "dask": "tests/models/test_campaign_cluster.py starts scheduler and workers on free ports",
    "python docs/make_synthetic_records.py": TUTORIALS,
    "python docs/examples/ex01_basilisk.py": "tests/hosts/test_basilisk.py, where Basilisk is installed",
    "python -c": "reads the JSON that tests/orchestrator/cli/test_common_options.py checks",
    "cc": "tests/fmus/test_c_code.py compiles the sources with a prefix",
    "fmusim": "not on a package index; the page says that it is not tested",
}
SNIPPETS = {
    "README.md": "tests/test_readme.py",
    "docs/python.md": "tests/test_readme.py",
    "docs/scenario.md": "keys as in the scenarios of tests/orchestrator/run/test_interruptions.py",
    "docs/campaigns.md": "below; the second simulates 1000 cases, with the calls of tests/models/test_campaign_run.py",
    "docs/clusters.md": "Slurm, of which the page says that it is not tried",
    "docs/setup.md": TUTORIALS,
    "docs/twin.md": "the calls of tests/models/test_twin.py",
    "docs/site/tutorials/debris.md": TUTORIALS,
    "docs/site/tutorials/first_run.md": TUTORIALS,
    "docs/site/tutorials/own_mesh.md": TUTORIALS,
    "docs/site/tutorials/own_sensor.md": TUTORIALS,
    "docs/site/tutorials/own_structure.md": TUTORIALS,
    "docs/site/tutorials/python.md": TUTORIALS,
    "docs/tools/basilisk.md": "tests/hosts/test_basilisk.py, where Basilisk is installed",
    "docs/tools/container.md": "the calls of tests/orchestrator/exchange/test_container.py",
    "docs/tools/ecos.md": "the calls of tests/hosts/test_ecos.py",
    "docs/tools/fmpy.md": "the calls of tests/hosts/test_fmpy.py",
    "docs/tools/libcosim.md": "the calls of tests/hosts/test_libcosim.py",
    "docs/tools/omsimulator.md": "OMSimulator is not on the machine; the page says that it is not tested",
    "docs/tools/pathsim.md": "the calls of tests/hosts/test_pathsim.py",
}
PROGRAMS = {"gossamer", "python", *(name.split()[0] for name in OTHER_PROGRAMS)}
OF_A_READER = {
    "my_scenario",
    "my_scenario.toml",
    "my_sensor.toml",
    "my_sail.toml",
    "my_strip.toml",
    "hit.toml",
    "inspection.toml",
    "my_campaign.toml",
    "mine.toml",
    "dish.toml",
    "flight.toml",
    "other.ssp",
}
FENCED = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def commands(page):
    """List the commands that a page shows on lines of their own, as words."""
    text = text_of(page)
    shells = "".join(block for language, block in FENCED.findall(text) if language == "sh")
    indented = "\n".join(line for line in FENCED.sub("", text).splitlines() if line.startswith("    "))
    found = []
    for line in f"{shells}\n{indented}".replace("\\\n", " ").splitlines():
        for part in re.split(r" && | \| ", re.sub(r"(^|\s)#.*", "", line)):
            try:
                words = shlex.split(part)
            except ValueError:  # prose or a formula
                continue
            if words and words[0] in PROGRAMS:
                found.append(words)
    return found


ALL = [(page, words) for page in PAGES for words in commands(page)]
GOSSAMER = {name.replace("_", "-"): function for name, function in known_commands().items()}


def test_there_are_commands_to_check():
    assert len(ALL) > 80
    assert sum(words[0] == "gossamer" for _, words in ALL) > 60


@pytest.mark.parametrize("command", sorted({shlex.join(words) for _, words in ALL if words[0] == "gossamer"}))
def test_a_command_of_a_page_is_one_that_the_program_understands(command):
    _, *words = shlex.split(command)
    if words == ["--help"]:
        return
    _, given, _ = parsed(words)  # refuses what it does not know
    source = given.get("scenario") or given.get("campaign") or ""
    if source and not source.startswith("docs/"):
        assert source in {*OF_A_READER, *shipped_scenarios(), *shipped_scenarios("campaign")}


def test_every_command_is_run_by_a_test_or_a_list_says_why_not():
    for page, words in ALL:
        if words[0] == "gossamer":
            if words[1] == "--help":
                continue
            file = RUN_BY[words[1]]
            tested = (ROOT / file).read_text(encoding="utf-8")
            if file == TUTORIALS:
                tested = "".join(text_of(each) for each in PAGES if "tutorials/" in each)
                assert f"gossamer {words[1]}" in tested, words
            else:
                assert f'"{words[1]}"' in tested, (page, words)
        else:
            assert any(shlex.join(words).startswith(each) for each in OTHER_PROGRAMS), (page, words)


def test_every_command_of_the_program_is_on_a_page():
    shown = {words[1] for _, words in ALL if words[0] == "gossamer"}
    said = {name for page in PAGES for name in re.findall(r"`gossamer ([\w-]+)", text_of(page))}
    assert set(GOSSAMER) <= shown | said
    assert set(GOSSAMER) == set(RUN_BY)


def test_commands_within_sentences_have_options_that_exist():
    for page in PAGES:
        for command in re.findall(r"`gossamer ([^`]+)`", text_of(page)):
            name, *words = command.split()
            if name.startswith("-") or "|" in command:
                continue
            names = [each.replace("_", "-") for each in declared(GOSSAMER[name])]
            known = {f"--{no}{each}" for each in names for no in ("", "no-")} | {
                f for each in COMMON.values() for f in each[0]
            }
            for word in words:
                assert not word.startswith("--") or word in known | {"--help"}, f"{page}: gossamer {command}"


def test_every_page_with_a_snippet_is_in_the_list():
    shown = {page for page in PAGES for language, _ in FENCED.findall(text_of(page)) if language not in ("math", "text")}
    assert shown == set(SNIPPETS)
    for reason in SNIPPETS.values():
        for file in re.findall(r"tests/[\w/]+\.py", reason):
            assert (ROOT / file).is_file(), file


def test_the_campaign_that_a_page_reads_is_read(tmp_path, monkeypatch):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    from gossamer_models.campaign import CampaignPlan, Mesh, run_campaign

    monkeypatch.chdir(tmp_path)
    small = CampaignPlan(cases=4, stop=0.003, membrane=Mesh(elements_per_side=4, order=1))
    run_campaign(small, tmp_path / "out/campaigns/training.zarr", workers=1)
    names = {}
    exec(dict(FENCED.findall(text_of("docs/campaigns.md").partition("## From Python")[0]))["python"], names)
    assert names["reading"].sizes == names["strain"].sizes


def test_the_page_on_python_names_every_function():
    section = text_of("docs/python.md")
    functions = {*known_commands(), "load"}
    assert functions <= set(gossamer.__all__)
    assert functions <= set(re.findall(r"`(\w+)`", section))
