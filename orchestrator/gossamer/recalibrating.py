"""Sensors identified again in flight, without a gauge: a twin that explains the record knows what they felt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.inputs import check_outputs
from gossamer_orchestrator.errors import require
from gossamer_orchestrator.words import counted, uncertain

from .arguments import AnyPath, File, several
from .options import TwinOptions
from .records import find_record, keep_records
from .results import Saved
from .working import progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.twin.recalibration import Recalibrated
    from gossamer_orchestrator.pages import Page


@dataclass(frozen=True, kw_only=True, repr=False)
class Recalibration(Saved):
    """Sensors that were identified again.

    Attributes
    ----------
    files : list of Path
        An artifact for each, and the page.
    sensors : dict of int to gossamer_models.twin.recalibration.Recalibrated
        By number, from 1.
    name : str
        Of the record.
    step : float
        Its step [s].
    left_out : tuple of int
        Sensors without a reading in half of it, which were not identified.
    """

    sensors: dict[int, Recalibrated]
    name: str
    step: float
    left_out: tuple[int, ...]

    @property
    def data(self) -> xr.Dataset:
        """By ``sensor``: how far it was off its model ``before`` and ``after``, ``deviation`` of recovered strain [1]."""
        import xarray as xr

        found, ratio = self.sensors.values(), {"units": "1"}
        columns = {name: [getattr(each, name) for each in found] for name in ("before", "after", "deviation", "covered")}
        table: dict[str, Any] = {name: ("sensor", values, ratio) for name, values in columns.items()}
        return xr.Dataset(table, {"sensor": list(self.sensors)})

    @property
    def sentence(self) -> str:
        """How many, and how far they were off."""
        worst = max(self.sensors.values(), key=lambda each: each.before)
        off = f"off by up to {100.0 * worst.before:.3g} % of their range, now {100.0 * worst.after:.3g} %"
        return f"Identified {counted(len(self.sensors), 'sensor')} again, from the strain of the twin: {off}."

    def doubts(self) -> list[str]:
        """Say which sensors were left out, and where tables are those of the old sensor."""
        return [f"Sensor {k} was not identified: it has no reading in half of the record." for k in self.left_out] + [
            f"Sensor {k} felt {each.strain[0]:.4g} to {each.strain[1]:.4g} of strain, {100.0 * each.covered:.0f} % of its "
            "full scale; beyond that its tables are the old ones."
            for k, each in self.sensors.items()
            if each.covered < 1.0
        ]

    def tables(self) -> list[TableText]:
        """Return a row per sensor."""
        from gossamer_files.tables import TableText

        rows = [
            (
                str(k),
                *(f"{100.0 * value:.3g} %" for value in (each.before, each.after)),
                uncertain(*each.gain),
                uncertain(*each.offset, "ohm"),
                f"{each.deviation:.2g}",
                f"{each.strain[0]:.4g} to {each.strain[1]:.4g}",
            )
            for k, each in self.sensors.items()
        ]
        head = (
            "sensor",
            "old model off",
            "new model off",
            "gain [1]",
            "offset",
            "deviation of recovered strain [1]",
            "strain [1]",
        )
        return [TableText(head, rows, "Off what the sensor reads, beside an offset, rms over its range")]

    def describe(self) -> Page:
        """Return its page."""
        from .pages.recalibration import recalibration_page

        return recalibration_page(self.name, self.step, self.sensors, self.sentence, self.doubts(), self.tables())

    def hints(self) -> list[str]:
        """Return how to build one."""
        return [f"Build one: gossamer build sensor compensator --artifact {self.path}"]

    def to_json(self) -> dict[str, Any]:
        """Return the figures."""
        names = ("before", "after", "deviation", "strain", "covered", "gain", "offset")
        found = [{"sensor": k, **{name: getattr(each, name) for name in names}} for k, each in self.sensors.items()]
        return {"files": self.files, "sensors": found, "left_out": self.left_out}


def recalibrated_from(
    record: AnyPath | Sequence[AnyPath], out: Path, sensor: File | None, setup: File | None, origin: str
) -> Recalibration:
    """Identify the sensors of a record again, see ``identify``.

    Raises
    ------
    OrchestratorError, DataError
        There are several records, or the twin does not explain this one.
    """
    from gossamer_models.twin import MeshErrors, Twin, recalibrate

    paths = [Path(each) for each in several(record)]
    require(len(paths) == 1, f"a twin explains one record at a time, not {len(paths)}. Name one.")
    options = TwinOptions(
        kind="resistance", noise=None, setup=setup, begins=None, set=None, sensor=sensor, elements_per_side=4, order=4
    )
    with progress_bar("identify") as bar:
        bar.update(text="reading,")
        found = find_record(paths[0], options)
        numbers = range(1, found.structure.n_sensors + 1)
        keep_records(paths[0])
        check_outputs(out / f"sensor_{k}.json" for k in numbers)
        errors = None
        if setup is not None and not found.of_run and not found.structure.starts_in_plane:
            errors = MeshErrors(found.structure, found.parameters)
        known = found.twin(sensor)
        twin = Twin(**known, mesh_error=errors, nuisances=("sensor",) if found.of_run else ())
        answer = twin.fit(
            found.record, lambda seconds, made: bar.update(text=f"twin: {seconds:.3g} s of the record, {made} simulations,")
        )
        why = ". ".join(answer.doubts)
        require(answer.valid, f"the twin does not explain the record, so its strain is no reference: {why}")
        again = recalibrate(answer, twin.bank, paths[0].name + (f", {origin}" if origin else ""))
    files = []
    for k, each in again.items():
        path = out / f"sensor_{k}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        each.artifact.write(path)
        files.append(path)
    missing = tuple(k for k in numbers if k not in again)
    done = Recalibration(files=files, sensors=again, name=paths[0].name, step=found.record.step, left_out=missing)
    return replace(done, files=[*files, *save_page(done.describe, out)])
