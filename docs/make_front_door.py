"""Write the functions of ``import gossamer`` from the table of the command line: ``python docs/make_front_door.py``.

Names, defaults, types and explanations are those of the commands; what a function returns, and an example, stand here.
"""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import NamedTuple

from gossamer.table import NAMED, Parameter, parameters

FOLDER = Path(__file__).resolve().parents[1] / "orchestrator/gossamer"
WIDTH = 116  # of explanations


class Words(NamedTuple):
    """What the command line does not say of a function."""

    summary: str
    returns: str
    about: str
    example: str
    more: str = ""


MODELS = """Models:

- auto: chooses sensor, relaxation, regularisation, direct inverse and compensator by predicting the later parts of the
  training stretch. Sensor and compensator; ``build`` takes the compensator that was chosen.
- preisach: modified Preisach with modal densities. Sensor and compensator.
- preisach-hats: the same with hat functions, which follow rich records more closely. Sensor and compensator.
- fractional-sub-model-1: fractional integrals, Eq. (3.21) of the thesis. Sensor.
- fractional-model-1, fractional-sub-model-2: with phases, Eqs. (3.15) and (3.25). Offline only, no FMUs."""

FILES = {
    "chain": (
        "The chain of FMUs: build it, run it, sweep it, verify it.",
        {
            "demo": Words(
                "Build the FMUs, and find damage that begins during a run.",
                "Run",
                "Data, verdict and judgements; a path of the folder for results; displayed in a notebook.",
                "gossamer.demo()",
            ),
            "build": Words(
                "Build FMUs.", "dict of str to Path", "FMUs by name.", 'gossamer.build("membrane", order=6)'
            ),
            "validate": Words(
                "Check a scenario and its FMUs without running it.",
                "Validation",
                "Components in stepping order, connections and warnings; displayed in a notebook.",
                'gossamer.validate("my_scenario.toml")',
                "What it refuses, ``run`` refuses before its first step. It starts the FMUs in a process of their own.",
            ),
            "run": Words(
                "Run a scenario.",
                "Run",
                "Data, verdict and judgements; a path of the folder for results; displayed in a notebook.",
                'gossamer.run("damaged", set={"membrane.damage[1]": 0.3}, out="out/deeper")',
                "The FMUs run in a process of their own, and results are on the disk within a second. Whatever ends\n"
                "the run, what it reached is kept, and ``resume`` continues it.",
            ),
            "sweep": Words(
                "Run a scenario with many values.",
                "Sweep",
                "Cases and how they ended, and the data of all along ``case``.",
                'gossamer.sweep("damaged", set={"membrane.damage[1]": [0.0, 0.1, 0.2], "seed": range(1, 4)})',
                "Several runs at once, a folder per case. The same call again runs what is missing.",
            ),
            "verify": Words(
                "Check FMUs against FMI and against their declared capabilities.",
                "Verification",
                "Findings by FMU; ``passed`` if no check failed.",
                'assert gossamer.verify("out/fmus/sensor.fmu").passed',
            ),
        },
    ),
    "files": (
        "Files: look into FMUs, begin a scenario, write scenarios and results for people and for other programs.",
        {
            "new": Words(
                "Write a scenario of your own, with a comment on every table and key.",
                "Path",
                "The scenario.",
                'gossamer.new("my_scenario")',
                "It runs as it is. A file that is there is not overwritten.",
            ),
            "info": Words(
                "Look into an FMU: parameters, inputs and outputs.",
                "FmuInfo",
                "Variables by name; displayed in a notebook.",
                'gossamer.info("out/fmus/sensor.fmu").variables["rest_strain"]["unit"]',
            ),
            "view": Words(
                "Open a page in the browser; that of a run is written first if it is missing or old.",
                "Path",
                "The page.",
                'gossamer.view("out/damaged")',
            ),
            "report": Words(
                "Write the page of a run from its results.", "Path", "The page.", 'gossamer.report("out/damaged")'
            ),
            "plot": Words(
                "Draw the pictures of a run again, from its results.",
                "list of Path",
                "The pictures.",
                'gossamer.plot("out/damaged", format="svg")',
            ),
            "export_vtk": Words(
                "Write the membranes of a run for ParaView.",
                "list of Path",
                "For each membrane the .pvd, which ParaView opens.",
                'gossamer.export_vtk("out/sail")',
            ),
            "export_ssp": Words(
                "Write a scenario and its FMUs as one .ssp for other tools.",
                "Path",
                "The .ssp.",
                'gossamer.export_ssp("damaged")',
            ),
            "container": Words(
                "Merge a scenario and its FMUs into one FMU.",
                "Path",
                "The FMU.",
                'gossamer.container("damaged", fmi=3)',
            ),
        },
    ),
    "learning": (
        "What is learnt from measured records: a sensor, and how good it is.",
        {
            "identify": Words(
                "Identify a sensor from measured strain and resistance.",
                "Identification",
                "Artifact, errors and records; a path of the artifact; displayed in a notebook.",
                'gossamer.identify("measured.csv", modes=7, relaxations=7, train="0:200", out="out/mine/sensor.json")',
                MODELS,
            ),
            "assess": Words(
                "Judge an identified sensor on other records, without fitting it.",
                "Assessment",
                "Errors and records; displayed in a notebook.",
                'gossamer.assess("out/mine/sensor.json", "other.csv", fit_scales=True)',
            ),
        },
    ),
    "damage": (
        "Damage, how certain it is, and what finds it: twin, detectors, sensors in the right places.",
        {
            "twin": Words(
                "Fit a simulation to a record: the damage of each zone, with its standard deviation.",
                "TwinAnswer",
                "Damage by zone with its deviation, and whether it is valid; displayed in a notebook.",
                'gossamer.twin("out/damaged").data["damage"]',
                "The record begins when the load sets in. A CSV file has the columns time, and strain[1] to strain[4] or\n"
                "resistance[1] to resistance[4]; empty cells are gaps.",
            ),
            "watch": Words(
                "Watch a record as if it arrived live: an alarm when damage begins, then when and where.",
                "Watching",
                "Alarms, onsets and damages, and the score of each window; displayed in a notebook.",
                'gossamer.watch("out/damage_begins").report.alarms',
                "The record begins, undamaged, when the load sets in.",
            ),
            "campaign": Words(
                "Simulate the cases of a campaign: random damage, load, material and sensors.",
                "Campaign",
                "What was drawn, and the histories; a path of the store; displayed in a notebook.",
                'gossamer.train(gossamer.campaign("training"))',
                "The same call again goes on after an interruption; the numbers depend on the file alone.",
            ),
            "train": Words(
                "Train a detector on simulated damage.",
                "TrainedDetector",
                "Artifact, and its errors on cases that were held out; a path of the artifact; displayed in a notebook.",
                'gossamer.build("detector", artifact=gossamer.train("my_scenario.toml"))',
                "Runs the campaign first if that has not been done, which takes many minutes; the training takes some.",
            ),
            "assess_detector": Words(
                "Judge detectors, and the twin, under many conditions.",
                "DetectorAssessment",
                "Errors, false calls and probability of detection; a path of the folder; displayed in a notebook.",
                'gossamer.assess_detector(artifact="mine.json", cases=100).data["error_damaged"].sel(condition="clean")',
                "The same call again goes on after an interruption.",
            ),
            "place_sensors": Words(
                "Choose where strain sensors let damage be found best.",
                "SensorPlacement",
                "Smallest damage that is found by zone, and the sensors; displayed in a notebook.",
                'gossamer.place_sensors(count=4, check=40).data["a90"]',
            ),
        },
    ),
}


def texts() -> dict[Path, str]:
    """Return the text of every file, by path."""
    return {
        FOLDER / f"{stem}.py": _formatted(_file(stem, title, commands)) for stem, (title, commands) in FILES.items()
    }


def _formatted(text: str) -> str:
    command = [sys.executable, "-m", "ruff", "format", "--quiet", "--stdin-filename", str(FOLDER / "made.py"), "-"]
    return subprocess.run(command, input=text, stdout=subprocess.PIPE, text=True, encoding="utf-8", check=True).stdout


def _file(stem: str, title: str, commands: dict[str, Words]) -> str:
    functions = "\n\n".join(_function(stem, command, words) for command, words in commands.items())
    taken = {words.returns for words in commands.values() if words.returns.isidentifier() and words.returns != "Path"}
    imports = [f"from .results.{stem} import {', '.join(sorted(taken))}"]
    if any("Path" in words.returns for words in commands.values()):
        imports.insert(0, "from pathlib import Path\n")
    lines = "\n".join(f"    {line}".rstrip() for line in "\n".join(imports).splitlines())
    return f'''"""{title}

Made by ``docs/make_front_door.py`` from the table of the command line: change the command, then run ``make goldens``.
"""

from __future__ import annotations

{_abc(functions)}from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
{lines}


{functions}
'''


def _abc(functions: str) -> str:
    names = [name for name in ("Mapping", "Sequence") if f"{name}[" in functions]
    return f"from collections.abc import {', '.join(names)}\n" if names else ""


def _function(stem: str, command: str, words: Words) -> str:
    taken = parameters(command).values()
    arguments = [_signature(each) for each in taken if each.is_argument]
    options = [_signature(each) for each in taken if not each.is_argument]
    signature = "".join(f"    {each},\n" for each in [*arguments, *(["*"] if options else []), *options])
    returns = {"dict of str to Path": "dict[str, Path]", "list of Path": "list[Path]"}.get(words.returns, words.returns)
    body = "\n".join(f"    {line}".rstrip() for line in _docstring(taken, words).splitlines())
    return f'''def {command}(
{signature}) -> {returns}:
    """{body.strip()}
    """
    given = vars()
    from . import table
    from .work import {stem} as work

    with table.words_of_python("{command}"):
        return work.{command}(**table.values("{command}", given))
'''


def _signature(taken: Parameter) -> str:
    default = "" if taken.default is inspect.Parameter.empty else f" = {_default(taken)}"
    return f"{taken.name}: {_type(taken)}{default}"


def _default(taken: Parameter) -> str:
    default = str(taken.default) if isinstance(taken.default, Path) else taken.default
    return json.dumps(default) if isinstance(default, str) else repr(default)


def _type(taken: Parameter, *, words: bool = False) -> str:
    """Return the type of a parameter as Python writes it, or in words."""
    metavar = taken.about.metavar or ""
    path = taken.kind is Path or (taken.is_argument and taken.kind is str and not taken.many)
    plain = "str" if issubclass(taken.kind, str) else taken.kind.__name__
    one, said = ("str | PathLike[str]", "path") if path else (plain, plain)
    if taken.many and metavar.startswith(NAMED):
        one, said = "Mapping[str, object] | Sequence[str]", "mapping, sequence of str"
    elif taken.many:
        one, said = f"{one} | Sequence[{one}]", f"{said}, sequence of {said}"
    elif metavar == "NUMBER":
        one, said = "float | str", "float, str"
    elif metavar == "NAMES":
        one, said = "str | Sequence[str]", "str, sequence of str"
    elif metavar == "LIST" or "," in metavar:
        one, said = "str | Sequence[float]", "sequence of float, str"
    if not words:
        return one + " | None" * taken.optional
    return " or ".join(f"{said}{', None' * taken.optional}".rsplit(", ", 1))


def _docstring(taken: list[Parameter], words: Words) -> str:
    lines = [words.summary, ""]
    if words.more:
        lines += [*words.more.splitlines(), ""]
    lines += ["Parameters", "----------"]
    for each in taken:
        default = "" if each.default in (inspect.Parameter.empty, None) else f", default {_default(each)}"
        lines.append(f"{each.name} : {_type(each, words=True)}{default}")
        lines += textwrap.wrap(each.about.help, WIDTH - 8, initial_indent="    ", subsequent_indent="    ")
    lines += ["", "Returns", "-------", words.returns, f"    {words.about}", ""]
    lines += ["Raises", "------", "OrchestratorError", "    As the command does; the message says what to do.", ""]
    lines += ["Examples", "--------", f">>> {words.example}"]
    return "\n".join(lines)


if __name__ == "__main__":
    for path, text in texts().items():
        path.write_text(text, encoding="utf-8")
        print(path)
