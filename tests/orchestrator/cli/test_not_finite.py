"""A number that is not finite, in whatever file of whatever command, ends it with exit code 3 and is named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gossamer_models.sensor.artifact import DEFAULT_PATH

MEMBRANES = Path(__file__).parents[3] / "orchestrator/membranes"


def write(name, columns, **odd):
    """Write columns as CSV; a cell of row 9 of the columns in ``odd`` is another text."""
    rows = [[f"{value:g}" for value in row] for row in zip(*columns.values(), strict=True)]
    rows[9] = [odd.get(title, cell) for title, cell in zip(columns, rows[9], strict=True)]
    Path(name).write_text("\n".join(map(",".join, [list(columns), *rows])) + "\n")


@pytest.fixture
def files(tmp_path, monkeypatch, fmus):
    """Files in the working directory that hold one number that is not finite; those that are called good hold none."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(fmus, "fmus")
    shutil.copytree(MEMBRANES, "membranes")
    t = 0.1 * np.arange(400)
    strain = 0.02 * (1.0 - np.cos(t))
    record = {"time": t, "strain": strain, "resistance": 100.0 + 40.0 * strain}
    twin = {"time": t, **{f"strain[{k}]": strain for k in (1, 2, 3, 4)}}
    write("good.csv", record)
    write("infinite.csv", record, resistance="inf")
    write("healthy.csv", twin)
    write("record.csv", twin, **{"strain[2]": "-inf"})
    write("load.csv", twin | {"pressure [Pa]": 0.0 * t}, **{"pressure [Pa]": "inf"})
    chain = 'step = 0.1\nstop = 1.0\n[components.i]\nfmu = "integrator"\n'
    Path("fed.toml").write_text(f'{chain}[[inputs]]\nto = "i.u"\nfile = "infinite.csv"\ncolumn = "resistance"\n')
    Path("stated.toml").write_text(f"{chain}inputs = {{ u = nan }}\n")
    drum = Path("membranes/drum.toml").read_text()
    Path("membranes/nan.toml").write_text(drum.replace("density = 1390.0", "density = nan"))
    Path("campaign.toml").write_text("cases = 8\nseed = 3\nstop = inf\n[damage]\nzones = [1, 2]\ndepth = [0.3, 0.5]\n")
    card = json.loads(DEFAULT_PATH.read_text())
    Path("good.json").write_text(json.dumps(card))
    Path("nan.json").write_text(json.dumps(card | {"resistance_at_rest": float("nan")}))
    Path("answers").mkdir()
    Path("answers/2027-01-15.json").write_text('{"zones": ["a"], "damage": [NaN], "deviation": [0.1]}')


@pytest.mark.parametrize("command", [
    "run fed.toml --fmus fmus", "run stated.toml --fmus fmus", "validate fed.toml --fmus fmus",
    "validate stated.toml --fmus fmus",
    "container stated.toml --fmus fmus", "export-ssp stated.toml --fmus fmus",
    "assess nan.json good.csv", "recover good.json infinite.csv", "build sensor --artifact nan.json",
    "flight compensator --artifact nan.json",
    "twin record.csv", "twin load.csv", "watch record.csv", "watch load.csv",
    "calibrate record.csv --setup membranes/drum.toml",
    "twin healthy.csv --since answers/2027-01-15.json", "inspect answers", "build membrane --setup membranes/nan.toml",
    "modes membranes/nan.toml", "reduce membranes/nan.toml", "place-sensors --setup membranes/nan.toml",
    "twin good.csv --setup membranes/nan.toml", "campaign campaign.toml", "train campaign.toml",
])  # fmt: skip
def test_a_number_that_is_not_finite_ends_every_command_that_reads_it_with_exit_code_3(files, command):
    result = invoke(command.split())
    assert result.exit_code == 3, result.output
