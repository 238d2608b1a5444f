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
        "The chain of FMUs: build it, run it, sweep it, verify it, look at it.",
        {
            "build": Words(
                "Build FMUs.", "dict of str to Path", "FMUs by name.", 'gossamer.build("membrane", order=6)'
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
            "view": Words(
                "Open a page in the browser; that of a run is written first if it is missing or old.",
                "Path",
                "The page.",
                'gossamer.view("out/damaged")',
            ),
        },
    ),
    "learning": (
        "What is learnt from measured records: a sensor, how good it is, and damage.",
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
            "twin": Words(
                "Fit a simulation to a record: the damage of each zone, with its standard deviation.",
                "TwinAnswer",
                "Damage by zone with its deviation, and whether it is valid; displayed in a notebook.",
                'gossamer.twin("out/damage_begins", stop=0.25).data["damage"]',
                "The record begins when the load sets in. A CSV file has the columns time, and strain[1] to strain[4] or\n"
                "resistance[1] to resistance[4]; empty cells are gaps.",
            ),
        },
    ),
}
RESULTS = ("Assessment", "Identification", "Run", "Sweep", "TwinAnswer", "Verification")


def texts() -> dict[Path, str]:
    """Return the text of every file, by path."""
    return {FOLDER / f"{stem}.py": _formatted(_file(title, commands)) for stem, (title, commands) in FILES.items()}


def _formatted(text: str) -> str:
    command = [sys.executable, "-m", "ruff", "format", "--quiet", "--stdin-filename", str(FOLDER / "made.py"), "-"]
    return subprocess.run(command, input=text, stdout=subprocess.PIPE, text=True, encoding="utf-8", check=True).stdout


def _file(title: str, commands: dict[str, Words]) -> str:
    functions = "\n\n".join(_function(command, words) for command, words in commands.items())
    taken = {each for words in commands.values() for each in RESULTS if each == words.returns}
    imports = [f"from .results import {', '.join(sorted(taken))}"]
    if "Path\n" in functions or "Path]" in functions:
        imports.insert(0, "from pathlib import Path\n")
    lines = "\n".join(f"    {line}".rstrip() for line in "\n".join(imports).splitlines())
    return f'''"""{title}

Made by ``docs/make_front_door.py`` from the table of the command line: change the command, then run ``make goldens``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
{lines}


{functions}
'''.replace("from collections.abc import Mapping, Sequence", _abc(functions))


def _abc(functions: str) -> str:
    names = [name for name in ("Mapping", "Sequence") if f"{name}[" in functions]
    return f"from collections.abc import {', '.join(names)}"


def _function(command: str, words: Words) -> str:
    taken = parameters(command).values()
    arguments = [_signature(each) for each in taken if each.is_argument]
    options = [_signature(each) for each in taken if not each.is_argument]
    signature = "".join(f"    {each},\n" for each in [*arguments, *(["*"] if options else []), *options])
    returns = words.returns.replace("dict of str to Path", "dict[str, Path]")
    body = "\n".join(f"    {line}".rstrip() for line in _docstring(taken, words).splitlines())
    return f'''def {command}(
{signature}) -> {returns}:
    """{body.strip()}
    """
    given = locals()
    from . import table, work

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
    one, said = ("str | PathLike[str]", "path") if path else (taken.kind.__name__, taken.kind.__name__)
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
