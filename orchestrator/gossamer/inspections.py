"""Inspect a structure again and again: calibrate it, answer every inspection on the last one, tell how damage grows."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.inputs import check_outputs, keep
from gossamer_files.options import option
from gossamer_orchestrator.errors import require
from gossamer_orchestrator.words import counted

from .arguments import AnyPath, File, command
from .options import TwinOptions
from .results import INVALID, Saved, as_png, zone_coordinates
from .working import progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.membrane import Structure
    from gossamer_models.twin import InspectionHistory, ResponseRecord

CALIBRATION, CSV_FILE = "calibration.json", "history.csv"
SIMULATED = 1e-4  # noise of simulated records [1], unless it is stated


@dataclass(frozen=True, kw_only=True)
class SimulatedRecord:
    """A record that is simulated in place of a measured one.

    Attributes
    ----------
    damage : mapping of str to float
        Of zones by name [1].
    parameters : mapping of str to float
        Parameters and inputs of the membrane that differ from the setup.
    seed : int
        Of the noise.
    """

    damage: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class InspectedDay:
    """An inspection.

    Attributes
    ----------
    date : str
        YYYY-MM-DD.
    records : tuple of str
        CSV files, relative to the file.
    simulated : tuple of SimulatedRecord
        In place of, or beside, files.
    repaired : tuple of str
        Zones that were repaired since the last one.
    """

    date: str
    records: tuple[str, ...] = ()
    simulated: tuple[SimulatedRecord, ...] = ()
    repaired: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class HealthyRecords:
    """What the structure is calibrated on.

    Attributes
    ----------
    records, simulated
        As of ``InspectedDay``.
    priors : mapping of str to float
        As ``--prior`` of ``gossamer calibrate``.
    """

    records: tuple[str, ...] = ()
    simulated: tuple[SimulatedRecord, ...] = ()
    priors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class InspectionPlan:
    """The inspections of a structure.

    Attributes
    ----------
    inspections : tuple of InspectedDay
        In any order.
    healthy : HealthyRecords or None
        From when it was whole; without them the structure is taken as drawn.
    title : str
        One line.
    setup : str
        A setup, as of ``--setup``; empty for the square of the thesis.
    noise : float or None
        Standard deviation of a sample of strain [1]; None to estimate it, and 1e-4 in simulated records.
    step, stop : float
        Of simulated records [s].
    mesh_error : bool
        Whether the mesh of the setup errs; false where its own mesh made the records.
    """

    inspections: tuple[InspectedDay, ...]
    healthy: HealthyRecords | None = None
    title: str = ""
    setup: str = ""
    noise: float | None = None
    step: float = 3e-4
    stop: float = 0.3
    mesh_error: bool = True


@dataclass(frozen=True, kw_only=True, repr=False)
class Inspections(Saved):
    """Damage of a structure over time.

    Attributes
    ----------
    files : list of Path
        CSV table of the history, its page if it could be written, and the answers.
    history : gossamer_models.twin.InspectionHistory
        All inspections.
    """

    history: InspectionHistory

    @property
    def data(self) -> xr.Dataset:
        """``damage`` and ``deviation`` [1] by ``date`` and ``zone``; ``growth`` and its deviation [1/month] by ``zone``."""
        import numpy as np
        import xarray as xr

        known, units = self.history, {"units": "1"}
        values: dict[str, Any] = {
            name: (("date", "zone"), getattr(known, name), units) for name in ("damage", "deviation", "low", "high")
        }
        growth = {"growth": known.growth[:, 0], "growth_deviation": known.growth[:, 1]}
        values |= {name: (("zone",), each, {"units": "1/month"}) for name, each in growth.items()}
        dates = {"date": np.array([str(day) for day in known.dates])}
        return xr.Dataset(values, dates | zone_coordinates(known.zones), {"valid": known.valid.astype(int)})

    def exit_code(self) -> int:
        """Return the exit code: whether the last inspection can be used."""
        return 0 if self.history.valid[-1] else INVALID

    @property
    def sentence(self) -> str:
        """What is there and what grows."""
        known = self.history
        what = f"{counted(len(known.dates), 'inspection')} from {known.dates[0]} to {known.dates[-1]}"
        return f"{what}: {'; '.join(known.sentences()) or 'no zone grows'}."

    def doubts(self) -> list[str]:
        """Return why inspections were withheld."""
        known = self.history
        return [
            f"{day} is not valid: {'; '.join(doubts) or 'no reason was kept'}."
            for day, valid, doubts in zip(known.dates, known.valid, known.doubts, strict=True)
            if not valid
        ]

    def picture(self) -> bytes | None:
        """Draw the damages over time."""
        from .pages.history import damage_over_time

        return as_png(damage_over_time(self.history))

    def tables(self) -> list[TableText]:
        """Return a row per zone that was damaged."""
        from .pages.history import history_table

        return [history_table(self.history)]

    def to_json(self) -> dict[str, Any]:
        """Return damage by date, and growth."""
        known, growth = self.history, self.history.growth.tolist()
        return {
            "file": self.path,
            "page": self.page,
            "dates": [str(day) for day in known.dates],
            "valid": known.valid.tolist(),
            "zones": list(known.zones),
            "damage": [[None if value != value else value for value in row] for row in known.damage.tolist()],
            "growth": [None if rate != rate else [rate, sigma] for rate, sigma in growth],
            "faults": {name: each.tolist() for name, each in known.faults.items()},
            "units": {"damage": "1", "growth": "1/month", "faults": "1"},
        }


@command
def inspect(what: AnyPath, *, setup: File | None = None, out: File | None = None) -> Inspections:
    """Answer the inspections of a structure one after the other, and tell how damage grows.

    A TOML file names the setup, healthy records to calibrate on, and for each inspection its date and records
    (docs/twin.md; gossamer new inspection writes one). Of a folder with answers of gossamer twin whose names begin with
    their dates, such as 2027-01-15.json, the page and the table are written.

    Parameters
    ----------
    what
        TOML file, or folder of answers.
    setup
        Of a folder of answers: the setup of their structure, which the page then draws.
    out
        Folder to write; out/NAME by default, or the folder of answers.

    Returns
    -------
    Inspections
        Damage by date and zone; displayed in a notebook.

    Examples
    --------
    >>> gossamer.inspect("inspection.toml").data["damage"]

    On the command line::

        gossamer new inspection && gossamer inspect inspection.toml
    """
    from gossamer_files import write_text
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import InspectionHistory

    from .descriptions import load_structure
    from .pages.history import history_page

    source = Path(what)
    structure = None if setup is None else load_structure(setup)
    if source.is_dir():
        folder, title = source if out is None else Path(out), source.resolve().name
        keep(*source.glob("*.json"))
        history = InspectionHistory.read(source)
        other = structure is not None and structure.zone_names != history.zones
        advice = "Name the setup of their structure"
        require(not other, f"the answers in {source} are of other zones than those of {setup}. {advice}.")
    else:
        plan, _ = load_plan(source)
        folder, title = Path("out") / source.stem if out is None else Path(out), plan.title or source.stem
        check_outputs([folder / CSV_FILE])
        msg = f"{source.name} names its setup itself. Leave {option('setup')} out."
        require(structure is None, msg)
        structure = load_structure(plan.setup) if plan.setup else square_structure()
        history = _answered(plan, structure, source.parent, folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / CSV_FILE, _csv(history))
    pages = save_page(lambda: history_page(title, history, structure), folder)
    return Inspections(files=[folder / CSV_FILE, *pages], history=history)


def load_plan(path: Path) -> tuple[InspectionPlan, Any]:
    """Read and check a file of inspections.

    Raises
    ------
    ScenarioError
        It has mistakes, one line per mistake.
    OrchestratorError
        It has no inspections, or a date makes no sense or stands twice.
    """
    from .descriptions import read_description

    tables = {"inspections": InspectedDay, "healthy": HealthyRecords, "simulated": SimulatedRecord}
    plan, source = read_description(path, "file of inspections", InspectionPlan, tables)
    require(plan.inspections, f"{path.name} has no inspections. Write [[inspections]] with 'date' and 'records'.")
    seen = set[date]()
    for each in plan.inspections:
        try:
            day = date.fromisoformat(each.date)
        except ValueError:
            day = None
        require(day is not None, f"{path.name}: {each.date!r} is no date. Write YYYY-MM-DD.")
        assert day is not None
        require(day not in seen, f"{path.name}: {each.date} stands twice. Give its records to one inspection.")
        require(each.records or each.simulated, f"{path.name}: the inspection of {each.date} has no records.")
        seen.add(day)
    healthy = () if plan.healthy is None else plan.healthy.records
    for name in (*healthy, *(name for each in plan.inspections for name in each.records)):
        require((path.parent / name).exists(), f"{path.name} names a record that is not there: {path.parent / name}.")
    return plan, source


def _answered(plan: InspectionPlan, structure: Structure, beside: Path, folder: Path) -> InspectionHistory:
    """Calibrate, answer every inspection, and write each answer as soon as it is there."""
    from gossamer_files import write_text
    from gossamer_models.twin import Earlier, InspectionHistory, MeshErrors, Twin, calibrate
    from gossamer_models.twin import inspect as inspect_records

    names = structure.zone_names
    for each in plan.inspections:
        for name in (*each.repaired, *(name for record in each.simulated for name in record.damage)):
            require(name in names, f"{each.date}: there is no zone {name!r}. Choose from {', '.join(names)}.")
    answers, earlier, calibration = dict[date, dict[str, Any]](), None, None
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bar("inspecting") as bar:
        if plan.healthy is not None:
            records = [*_records(plan, plan.healthy, structure, beside)]
            calibration = calibrate(
                structure,
                records,
                priors=plan.healthy.priors,
                mesh_error=plan.mesh_error,
                report=lambda text: bar.update(text=f"healthy records, {text},"),
            )
            write_text(folder / CALIBRATION, json.dumps(calibration.as_json(), indent=1) + "\n")
            wrong = f"the healthy records give no calibration: {'; '.join(calibration.doubts)}"
            require(calibration.valid, f"{wrong}. See {folder / CALIBRATION}.")
        known: dict[str, Any] = {"calibration": calibration, "faults": "known"}
        if not plan.mesh_error:
            known["discrepancy"] = None
        elif not structure.starts_in_plane:
            parameters = {} if calibration is None else calibration.parameters
            applied = structure if calibration is None else calibration.applied(structure, None)[0]
            known["mesh_error"] = MeshErrors(applied, parameters)
        twin = Twin(structure, **known)
        days = sorted((date.fromisoformat(each.date), each) for each in plan.inspections)
        repaired = set[str]()  # since the last inspection that was valid
        for k, (day, each) in enumerate(days):
            bar.update(k, len(days), f"{day},")
            repaired |= {*each.repaired}
            records = [*_records(plan, each, structure, beside)]
            answer = inspect_records(twin, records, since=earlier, repaired=sorted(repaired) if earlier else ())
            if answer.valid:
                earlier, repaired = Earlier.of(answer), set[str]()
            answers[day] = found = answer.as_json()
            write_text(folder / f"{day}.json", json.dumps(found, indent=1) + "\n")
    return InspectionHistory.of(answers)


def _records(
    plan: InspectionPlan, of: HealthyRecords | InspectedDay, structure: Structure, beside: Path
) -> list[ResponseRecord]:
    """Read and simulate the records of an inspection."""
    from .records import find_records

    options = TwinOptions(
        kind=None,
        noise=plan.noise,
        setup=plan.setup or None,
        begins=None,
        set=None,
        calibration=None,
        sensor=None,
        elements_per_side=4,
        order=4,
    )
    measured = [each.record for each in find_records([beside / name for name in of.records], options)]
    return [*measured, *(_simulated(plan, each, structure) for each in of.simulated)]


def _simulated(plan: InspectionPlan, of: SimulatedRecord, structure: Structure) -> ResponseRecord:
    import numpy as np
    from gossamer_models.membrane.setup import SCALABLE
    from gossamer_models.twin import MembraneForward, ResponseRecord
    from gossamer_models.twin.calibration import with_factors

    damage = np.array([[of.damage.get(name, 0.0) for name in structure.zone_names]])
    forward = MembraneForward(with_factors(structure, SCALABLE), of.parameters)
    samples = round(plan.stop / plan.step)
    strain = forward.strain(damage, {}, {}, samples, plan.step)[0]
    sigma = SIMULATED if plan.noise is None else plan.noise
    noise = sigma * np.random.default_rng(of.seed).standard_normal(strain.shape)
    return ResponseRecord(step=plan.step, values=strain + noise, noise=sigma)


def _csv(history: InspectionHistory) -> str:
    """Return a row for each date and zone."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["date", "valid", "zone", "damage [1]", "deviation [1]", "low [1]", "high [1]"])
    for k, day in enumerate(history.dates):
        for z, zone in enumerate(history.zones):
            numbers = (history.damage[k, z], history.deviation[k, z], history.low[k, z], history.high[k, z])
            written = ["" if value != value else f"{value:.6g}" for value in numbers]
            rows.writerow([day, int(history.valid[k]), zone, *written])
    return text.getvalue()
