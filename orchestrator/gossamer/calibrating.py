"""Calibrate a structure on its healthy records: what its numbers are, and how well they are known."""

from __future__ import annotations

import json
import os
import re
import tomllib
from dataclasses import asdict, dataclass
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.inputs import check_outputs
from gossamer_files.options import option
from gossamer_orchestrator.errors import require
from gossamer_orchestrator.scenario.source import find_scenario, read_text
from gossamer_orchestrator.words import counted, uncertain

from .arguments import File, Files, Values, assigned, command, several
from .options import TwinOptions
from .records import find_records, keep_records, numbers_by_name
from .results import INVALID, Saved, typed
from .working import json_file, progress_bar

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.membrane import Setup, Surveyed
    from gossamer_models.twin import Calibration


@dataclass(frozen=True, kw_only=True, repr=False)
class Calibrated(Saved):
    """Numbers of a structure, as its healthy records tell them.

    Attributes
    ----------
    files : list of Path
        JSON file of the calibration, or the setup that carries it.
    calibration : gossamer_models.twin.Calibration
        Factors on the numbers of the setup, their covariance, and doubts.
    survey : gossamer_models.membrane.Surveyed or None
        The shape as built.
    """

    calibration: Calibration
    survey: Surveyed | None = None

    @property
    def data(self) -> xr.Dataset:
        """``factor`` and ``deviation`` [1] by ``number``, of places [m]; ``covariance`` of logarithms, and of places."""
        import xarray as xr

        known, ratio = self.calibration, {"units": "1"}
        values = {"factor": known.factors, "deviation": known.deviation, "prior": known.prior}
        table: dict[str, Any] = {name: ("number", each, ratio) for name, each in values.items()}
        table["covariance"] = (("number", "other_number"), known.covariance, ratio)
        names = list(known.names)
        return xr.Dataset(table, {"number": names, "other_number": names}, {"valid": int(known.valid)})

    def exit_code(self) -> int:
        """Return the exit code."""
        return 0 if self.calibration.valid else INVALID

    @property
    def sentence(self) -> str:
        """How many numbers were calibrated, and whether they may be used."""
        known = self.calibration
        what = f"{counted(len(known.names), 'number')} on {counted(len(known.chi2_per_sample), 'healthy record')}"
        return f"Calibrated {what}{': NOT valid' * bool(known.doubts)}."

    def doubts(self) -> list[str]:
        """Return reasons for doubt, and what the records do not decide."""
        return [f"{text[0].upper()}{text[1:]}." for text in (*self.calibration.doubts, *self.calibration.untold)]

    def lines(self) -> list[str]:
        """Return how well each record, and the survey, is explained."""
        known, seen = self.calibration, self.survey
        pairs = enumerate(zip(known.chi2_per_sample, known.chi2_bound, strict=True), 1)
        found = [f"record {k}: chi2 per sample {chi2:.3f}, bound {bound:.3f}" for k, (chi2, bound) in pairs]
        if seen is not None:
            before, after, left_out = (f"{1e3 * each:.3g} mm" for each in (seen.before, seen.after, seen.left_out))
            away = f"{before} from the drawing at rest, {after} from {counted(seen.modes, 'smooth mode')} beside it"
            found.append(f"survey: points are {away}, and {left_out} if left out (rms)")
        return found

    def hints(self) -> list[str]:
        """Return how to use it."""
        use = "--setup" if self.path.suffix == ".toml" else "--calibration"
        return [f"Use it: gossamer twin record.csv {use} {typed(self.path)}"] if self.calibration.valid else []

    def tables(self) -> list[TableText]:
        """Return a row per number, and a table of places."""
        from gossamer_files.tables import TableText

        known, places = self.calibration, [name.startswith("place_") for name in self.calibration.names]
        units = [(1e3, 1e3, "mm") if place else (1.0, 100.0, "%") for place in places]
        rows = [
            (name, uncertain(unit * float(value), unit * float(deviation)), f"{share * prior:.3g} {sign}")
            for name, value, deviation, prior, (unit, share, sign) in zip(
                known.names, known.factors, known.deviation, known.prior, units, strict=True
            )
        ]
        titles = {False: ("times that of the setup", "Calibration"), True: ("off its point [mm]", "Places of sensors")}
        return [
            TableText(("number", column, "known before to"), list(compress(rows, (each == of for each in places))), title)
            for of, (column, title) in titles.items()
            if of in places
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the calibration, and what the survey told."""
        survey = {} if self.survey is None else {"survey": asdict(self.survey)}
        return {"file": self.path, **self.calibration.as_json(), **survey}


@command
def calibrate(
    files: Files,
    *,
    prior: Values | None = None,
    survey: File | None = None,
    mesh_error: bool | None = None,
    out: File = "out/calibration.json",
    **options: Unpack[TwinOptions],
) -> Calibrated:
    """Calibrate a structure on records of it without damage, all records together.

    Finds what the records decide of thickness, density, Young's modulus, prestress, tension of edges, damping, and gains and
    places of gauges, and says which combinations they do not. Load, clock and offsets are fitted for each record by itself.
    Tests whether every record is healthy. gossamer twin and gossamer watch take the values, and what is uncertain stays so
    there; a setup that carries them starts every model with them.

    Parameters
    ----------
    files
        Healthy records: CSV files, or results of runs.
    prior
        How far a number may be off, NAME=VALUE, one standard deviation as a share: thickness=0.05; of places of sensors in
        metres, place=0.002; 0 for what is known. May be repeated. By default what the setup says in its table priors.
    survey
        CSV file of points of the surface at rest under the loads of the start, columns x [mm], y [mm], z [mm] or of another
        unit, in the axes of the mesh: smooth modes of how far the shape was built from the drawing go into the setup.
    mesh_error
        Whether finer elements are simulated too; by default for measured records.
    out
        JSON file to write, or a TOML file: the setup with its calibration, which takes its place.
    **options
        Records and structure, see ``TwinOptions``.

    Returns
    -------
    Calibrated
        Values and deviations; displayed in a notebook.

    Examples
    --------
    >>> gossamer.calibrate(["first.csv", "second.csv"], setup="dish.toml").calibration.factors

    On the command line::

        gossamer calibrate first.csv second.csv --setup dish.toml --out dish.json
        gossamer twin later.csv --setup dish.toml --calibration dish.json
        gossamer calibrate first.csv --setup dish.toml --out known.toml && gossamer twin later.csv --setup known.toml
    """
    from gossamer_files import write_text
    from gossamer_models import twin
    from gossamer_models.membrane import surveyed, with_shape

    paths, setup = [Path(each) for each in several(files)], options["setup"]
    path = Path(out) if Path(out).suffix == ".toml" else json_file(out)
    keep_records(*paths)
    check_outputs([path, path.with_suffix(".json")])
    if path.suffix == ".toml":
        require(
            setup is not None, f"{path} would be a setup. Name the drawing with {option('setup')}, or write a .json file."
        )
    shaped = survey is None or (setup is not None and path.suffix == ".toml")
    require(shaped, f"a shape belongs to a setup. Name the drawing with {option('setup')}, and a .toml file to write.")
    require(options["calibration"] is None, f"a calibration begins with the drawing. Leave {option('calibration')} out.")
    with progress_bar("calibrating") as bar:
        bar.update(text="reading,")
        found = find_records(paths, options)
        first = found[0]
        known, seen = first.twin(options["sensor"]), None
        structure = known.pop("structure")
        if survey is not None:
            bar.update(text="finding the shape as built,")
            seen = surveyed(structure, twin.read_survey(Path(survey)))
            structure = with_shape(structure, seen.built)
        answer = twin.calibrate(
            structure,
            [each.record for each in found],
            priors=numbers_by_name(assigned(prior), "NAME=VALUE", "prior"),
            mesh_error=not first.of_run if mesh_error is None else mesh_error,
            report=lambda text: bar.update(text=f"{text},"),
            **known,
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    carrying = setup is not None and path.suffix == ".toml" and answer.valid
    path = path if carrying else path.with_suffix(".json")
    text = _carrying(find_scenario(str(setup), "membrane"), path, structure.setup, answer) if carrying else ""
    write_text(path, text or json.dumps(answer.as_json(), indent=1) + "\n")
    return Calibrated(files=[path], calibration=answer, survey=seen)


def _carrying(source: Path, path: Path, setup: Setup, calibration: Calibration) -> str:
    """Return the text of a setup, for another file, with a calibration at its end."""
    text = read_text(source, "setup")
    first = re.search(r"(?m)^[ \t]*\[\[?[A-Za-z]", text)  # of the tables
    head, tables = (text[: first.start()], text[first.start() :]) if first else (text, "")
    known = calibration.known
    factors = [name for name in setup.scalable if name in (*known.names, *setup.factors)]
    top = {
        "mesh": json.dumps(Path(os.path.relpath(source.parent / setup.mesh, path.parent)).as_posix()),
        **({"factors": json.dumps(factors)} if factors else {}),
    }
    for name, value in top.items():
        line = re.search(rf"(?m)^[ \t]*{name}[ \t]*=[ \t]*(\[[^\]]*\]|\"[^\"\n]*\"|'[^'\n]*')", head)
        start, end = line.span() if line else (len(head), len(head))
        before = "" if line or head[-1:] in ("", "\n") else "\n"
        head = f"{head[:start]}{before}{name} = {value}{head[end:] if line else chr(10)}"
    rows = {name: json.dumps(getattr(known, name)) for name in ("names", "covariance", "gains", "places", "drawing")}
    rows["parameters"] = "{ " + ", ".join(f"{json.dumps(k)} = {v!r}" for k, v in known.parameters.items()) + " }"
    lines = [f"{name} = {value}" for name, value in rows.items()]
    title = "[calibration]  # by gossamer calibrate, from healthy records"
    shape = [f"{name} = {json.dumps(value)}" for name, value in asdict(setup.built).items()] if setup.built else []
    built = ["", "[built]  # by gossamer calibrate, from a survey", *shape] if shape else []
    found = "\n".join([f"{head}{tables}".rstrip(), *built, "", title, *lines, ""])
    try:
        written = tomllib.loads(found)
    except tomllib.TOMLDecodeError:
        written = {}
    there = written.get("mesh"), written.get("calibration", {}).get("names")
    advice = f"{source.name} is written in a way that this cannot add to. Write a .json file, and use it with"
    require(there == (json.loads(top["mesh"]), list(known.names)), f"{advice} {option('calibration')}.")
    return found
