"""The notebooks run from the top to the end, as a user has them in a checkout, and leave what they say."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
NAMES = sorted(path.stem for path in (DOCS / "notebooks").glob("*.ipynb"))
WIDGETS = "application/vnd.jupyter.widget-state+json"


@pytest.fixture(scope="module")
def hook():
    """The hook of the site that makes pages of notebooks."""
    pytest.importorskip("mkdocs", reason="the site needs the packages of the extra docs")
    spec = importlib.util.spec_from_file_location("notebooks", DOCS / "site/hooks/notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    """Return an executed notebook by name; each runs once, in a copy of the documents."""
    done = {}

    def get(name):
        if name not in done:
            docs = tmp_path_factory.mktemp(name) / "docs"
            shutil.copytree(DOCS / "notebooks", docs / "notebooks", ignore=shutil.ignore_patterns("out"))
            shutil.copytree(DOCS / "studies", docs / "studies", ignore=shutil.ignore_patterns("__pycache__"))
            shutil.copy(DOCS / "make_synthetic_records.py", docs)
            # in a process of its own, as a notebook is: event loops and sockets are none of pytest's business
            command = [sys.executable, "-c", "from nbclient.cli import main; main()", "--inplace", "--timeout=200"]
            subprocess.run([*command, f"{name}.ipynb"], cwd=docs / "notebooks", check=True, timeout=300)
            done[name] = nbformat.read(docs / f"notebooks/{name}.ipynb", as_version=4)
        return done[name]

    return get


def outputs(notebook, kind):
    """List the outputs of a MIME type, in order."""
    each = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    return [output["data"][kind] for output in each if kind in output.get("data", {})]


def printed(notebook, stream):
    each = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    return "".join(output["text"] for output in each if output.get("name") == stream)


@pytest.mark.parametrize("name", NAMES)
def test_it_is_kept_without_outputs(name):
    for cell in nbformat.read(DOCS / f"notebooks/{name}.ipynb", as_version=4).cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


@pytest.mark.parametrize("name", NAMES)
def test_it_runs_without_a_warning(executed, name):
    assert "Warning" not in printed(executed(name), "stderr")


def test_run_and_look_finds_the_damage_that_it_sets(executed):
    shown = next(text for text in outputs(executed("run_and_look"), "text/html") if "Damaged:" in text)
    verdict = re.search(r"Damaged: zone 11 lost (\d+\.\d) ± .* and zone 1 lost (\d+\.\d) ±", shown)
    assert float(verdict[1]) == pytest.approx(30.0, abs=2.0)  # the mean error of the detector without noise: 0.8 %
    assert float(verdict[2]) == pytest.approx(10.0, abs=2.0)
    assert "data:image/png" in shown
    assert "<pre" in shown
    assert len(outputs(executed("run_and_look"), "image/png")) == 2


def test_the_progress_of_a_run_is_a_bar_in_the_notebook(executed):
    widgets = executed("run_and_look").metadata["widgets"][WIDGETS]["state"].values()
    shown = [str(each["state"]["outputs"]) for each in widgets if each["model_name"] == "OutputModel"]
    assert any("simulated s per s" in each and "100%" in each for each in shown)


def test_the_sensor_that_was_identified_flies(executed):
    notebook = executed("identify_and_fly")
    said = re.search(r"largest strain (\S+) %, largest error (\S+) % of the range", printed(notebook, "stdout"))
    assert 2.1 < float(said[1]) < 7.5  # more than the prestrain, less than the record
    assert float(said[2]) < 1.0
    assert len(outputs(notebook, "image/png")) == 2  # the notebook shows its own plots after Gossamer has drawn
    shown = " ".join(outputs(notebook, "text/html"))
    judged = re.search(r"predicted with an error \(NRMSE\) of (\S+) % for synthetic_dataset_3.csv", shown)
    assert float(judged[1]) < 2.0  # the noise alone is 0.24 % of the range


def test_its_page_shows_text_code_and_what_the_code_shows(executed, hook):
    shown = hook.page(executed("run_and_look"), "run_and_look.ipynb", run=True)
    assert shown.startswith("# Run and look")
    assert '```python\nrun = gossamer.run("damaged"' in shown
    assert "Damaged: zone 11 lost" in shown
    assert "&lt;xarray.Dataset&gt;" in shown
    assert shown.count("<img ") == 3  # that of the run, and two plots
    assert "simulated s per s" not in shown
    assert "Widget" not in shown


@pytest.mark.parametrize("name", NAMES)
def test_a_page_of_a_notebook_that_was_not_run_says_so(hook, name):
    notebook = nbformat.read(DOCS / f"notebooks/{name}.ipynb", as_version=4)
    shown = hook.page(notebook, f"{name}.ipynb", run=False)
    assert shown.count("```python") == sum(cell.cell_type == "code" for cell in notebook.cells)
    assert "`make site` runs it" in shown
    assert "output" not in shown
    assert "`make site` runs it" not in hook.page(notebook, f"{name}.ipynb", run=True)
