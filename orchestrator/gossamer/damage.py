"""The digital twin of a record: the damage of each zone, and how certain it is."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.inputs import check_outputs
from gossamer_orchestrator.errors import require

from .arguments import AnyPath, File, Files, NamesWithCommas, command, names_of, several
from .options import TwinOptions
from .records import KnownRecord, beside, find_record, find_records, keep_records, name_of
from .results import INVALID, Saved, as_png, typed, zone_coordinates
from .working import json_file, progress_bar, save_page, say, stderr

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.twin import Answer, ResponseRecord

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, repr=False)
class TwinAnswer(Saved):
    """Damage that a simulation fitted to a record shows.

    Attributes
    ----------
    files : list of Path
        JSON file of the answer, and its page if it could be written.
    answer : gossamer_models.twin.Answer
        The whole answer: validity, doubts, and what else was fitted.
    compared : str
        A sentence if only the beginning of the record was compared, else empty.
    shown : bool
        Whether the zones are shown, not withheld.
    """

    answer: Answer
    compared: str
    shown: bool = True

    @property
    def data(self) -> xr.Dataset:
        """``damage``, ``deviation``, ``probability``, 95 % ``bounds`` [1] by ``zone``, with its ``name`` and those that it
        was answered ``together_with``; ``covariance`` [1]; of ``growth`` [1] since the last inspection its deviation and
        probability. Not a number is what has no value or is withheld.
        """  # noqa: D205
        import numpy as np
        import xarray as xr

        answer, ratio, n = self.answer, {"units": "1"}, self.answer.damage.size
        values = {
            "damage": (["zone"], answer.value),
            "deviation": (["zone"], answer.deviation),
            "probability": (["zone"], answer.probability),
            "bounds": (["zone", "bound"], answer.bounds),
            "covariance": (["zone", "other_zone"], answer.covariance),
        }
        grown = {name: getattr(answer, name) for name in ("growth", "growth_deviation", "growth_probability")}
        values |= {name: (["zone"], each) for name, each in grown.items() if each is not None}
        together = [", ".join(others) for others in answer.together_with]
        return xr.Dataset(
            {name: (axes, np.where(self.shown, each, np.nan), ratio) for name, (axes, each) in values.items()},
            coords=zone_coordinates(answer.zones)
            | {"other_zone": np.arange(1, n + 1), "bound": ["low", "high"], "together_with": ("zone", together)},
            attrs={"valid": int(answer.valid), "chi2_per_sample": answer.chi2_per_sample, "chi2_bound": answer.chi2_bound},
        )

    def exit_code(self) -> int:
        """Return the exit code."""
        return 0 if self.answer.valid else INVALID

    @property
    def _verdict(self) -> str:
        chi2 = f"chi2 per sample {self.answer.chi2_per_sample:.3f}, bound {self.answer.chi2_bound:.3f}"
        return f"{'NOT ' * (not self.answer.valid)}valid: {chi2}"

    @property
    def sentence(self) -> str:
        """Whether the answer is valid."""
        return f"{self._verdict.capitalize()}."

    def lines(self) -> list[str]:
        """Return whether the answer is valid, what else was fitted, and which part of the record was compared."""
        from .pages.twin import nuisance_cells

        fitted = [f"{name}: {text}" for name, text in nuisance_cells(self.answer) if not name.startswith("pressure[")]
        each = [
            f"record {k}: chi2 per sample {record.chi2_per_sample:.3f}, bound {record.chi2_bound:.3f}"
            for k, record in enumerate(self.answer.records, 1)
        ]
        return [self._verdict, *fitted, *each, *filter(None, (self.answer.further, self.compared))]

    def doubts(self) -> list[str]:
        """Return reasons for doubt."""
        return [f"{text[0].upper()}{text[1:]}." for text in self.answer.doubts]

    def more(self) -> list[str]:
        """Return reasons for doubt, what would tell explanations apart, and which part of the record was compared."""
        return [*self.doubts(), *filter(None, (self.answer.further, self.compared))]

    def picture(self) -> bytes | None:
        """Draw the damage of the zones, unless it is withheld."""
        from .pages.twin import answer_chart

        return as_png(answer_chart(self.answer)) if self.shown else None

    def tables(self) -> list[TableText]:
        """Return a row per zone, and for each fault and explanation if faults were weighed."""
        from .pages.twin import explanation_cells, zone_cells

        return [zone_cells(self.answer, shown=self.shown), *explanation_cells(self.answer, shown=self.shown)]

    def to_json(self) -> dict[str, Any]:
        """Return the answer."""
        from .pages.twin import NUISANCE_UNITS

        units = dict.fromkeys(("damage", "deviation", "probability", "covariance", "bounds"), "1") | NUISANCE_UNITS
        return {"file": self.path, "page": self.page, **self.answer.as_json(show_invalid=self.shown), "units": units}


@command
def twin(
    records: Files,
    *,
    since: AnyPath | None = None,
    repaired: NamesWithCommas = "none",
    fit: NamesWithCommas = "none",
    known: NamesWithCommas = "none",
    stop: float | None = None,
    sparse: bool = True,
    mesh_error: bool | None = None,
    faults: bool | None = None,
    healthy: AnyPath | None = None,
    show_invalid: bool = False,
    out: File | None = None,
    **options: Unpack[TwinOptions],
) -> TwinAnswer:
    """Fit a simulation to records: the damage of each zone, with its standard deviation.

    A CSV file has the columns time, and strain[1], strain[2], ... or resistance[1], ...; empty cells are gaps. Columns with
    the names of the membrane's inputs, such as pressure [kPa], are its loads; without them the record begins when the
    built-in load sets in. With a column state in place of time, each row is a reading at rest under its loads. Results of a
    run bring setup, loads, and the parameters of the membrane and of the sensors along.

    Several records have one damage of each zone, and one value of each number of the structure; loads, clock, offsets and
    noise are those of each.

    Parameters
    ----------
    records
        Results of a run (results.nc, results.csv or their folder), or a CSV file; or several of one structure.
    since
        The answer of the last inspection, JSON: damage does not heal, so what has grown since is at least 0.
    repaired
        Zones that were repaired since then, with commas between: they begin without damage.
    fit
        What else is unknown, with commas between: the phase of the built-in load, a load by its name, such as pressure, or,
        of results of a run, the model of the sensors: sensor.
    known
        What is known exactly of offset, gain, clock, amplitude, frequency, damping, modulus, density, prestrain and sensor,
        the model of sensors of resistance; with commas between, or all. What is not is fitted along with the damage, each
        near to what it should be. Sensors of a run keep to their model, unless another one is named.
    stop
        Use the record up to this time [s]; by default, of a long one as much as a fit of some minutes takes.
    sparse
        Drop the zones that the record does not need.
    mesh_error
        Allow for what finer meshes change, from simulations that take minutes once; by default of a table with a setup, not
        of results of a run, whose mesh is that of the twin.
    faults
        Weigh what else may have gone wrong as an explanation beside damage: loss of gas, tension or prestress, a loose
        support or sensor, mass, and the [[faults]] of the setup; by default of a structure that was calibrated.
    healthy
        Record of the same structure without damage, under the same loads: what it has beside the simulation is taken from
        the other, and of the error of the mesh what damage changes is left.
    show_invalid
        Show the damage of the zones even if the answer is not valid; otherwise it is withheld.
    out
        JSON file to write; twin.json beside the record by default.
    **options
        Record and twin, see ``TwinOptions``.

    Returns
    -------
    TwinAnswer
        Damage by zone with its deviation, and whether it is valid; displayed in a notebook.

    Examples
    --------
    >>> gossamer.twin("out/damaged").data["damage"]

    On the command line::

        gossamer run damaged && gossamer twin out/damaged/results.nc

        gossamer twin measured.csv --known frequency,gain --set pressure_amplitude=9500

        gossamer twin states.csv --setup sail

        gossamer twin states.csv --setup sail --healthy before.csv

        gossamer twin first.csv second.csv --since january.json --out july.json
    """
    from gossamer_files import write_text
    from gossamer_models.twin import Earlier, MeshErrors, Twin, inspect
    from gossamer_models.twin.nuisances import BY_DEFAULT
    from gossamer_orchestrator.results.files import TWIN

    from .pages.twin import twin_page

    sources, console = [Path(each) for each in several(records)], stderr()
    require(sources, "there is no record to fit. Name one or more.")
    path = beside(sources[0], TWIN) if out is None else json_file(out)
    keep_records(*sources)
    check_outputs([out, path])
    with console.status("reading"):
        every = find_records(sources, options, stop)
        found = every[0]
        before = None if healthy is None else find_record(Path(healthy), options).record
        earlier = None if since is None else Earlier.read(Path(since))
    for each in every:
        logger.info("%d samples of %s, %g s apart", each.record.samples, each.record.kind, each.record.step)
    with progress_bar("fitting") as bar:
        bar.update(text="compiling,")
        wanted = options["setup"] is not None and not found.of_run if mesh_error is None else mesh_error
        errors = None
        if wanted and not found.structure.starts_in_plane:  # the error of the square is known

            def report(what: str, done: int, total: int) -> None:
                bar.update(done, total, f"{done} of {total} {what},")

            errors = MeshErrors(found.structure, found.parameters, report=report)
        exact = names_of(known)
        of_run = found.of_run and options["sensor"] is None and "sensor" not in exact
        exact = BY_DEFAULT if exact == ("all",) else (*exact, *["sensor"] * of_run)
        fitting = Twin(
            **found.twin(options["sensor"]),
            mesh_error=errors,
            healthy=before,
            nuisances=names_of(fit),
            known=exact,
            sparse=sparse,
            whole=stop is not None,
            faults="known" if _weighs_faults(found, before, faults) else (),
        )
        bar.update(text="what the sensors tell apart,")

        def simulating(seconds: float, made: int) -> None:
            bar.update(text=f"{seconds:.3g} s of the record, {made} simulations,")

        for sentence in fitting.untold(found.record, simulating) if len(every) == 1 else ():
            say(sentence)
        of_all = [each.record for each in every]
        answer = inspect(fitting, of_all, since=earlier, repaired=names_of(repaired), report=simulating)
    shown = answer.valid or show_invalid
    logger.info("%d simulations for %d values", answer.simulations, answer.samples)
    write_text(path, json.dumps(answer.as_json(show_invalid=shown), indent=1) + "\n")
    each_compared = zip(sources, of_all, answer.records or (answer,), strict=True)
    compared = " ".join(filter(None, (_compared(source, given, each.record, stop) for source, given, each in each_compared)))
    names = [name_of(source) for source in sources]
    pages = save_page(lambda: twin_page(names, answer, compared, shown=shown), path.with_suffix(""))
    return TwinAnswer(files=[path, *pages], answer=answer, compared=compared, shown=shown)


def _weighs_faults(found: KnownRecord, healthy: ResponseRecord | None, asked: bool | None) -> bool:
    """Tell whether faults are weighed beside damage."""
    if asked is not None:
        return asked
    return healthy is None and (found.calibration or found.structure.setup.calibration) is not None


def _compared(path: Path, given: ResponseRecord, used: ResponseRecord, stop: float | None) -> str:
    """Say which part of a record was compared; nothing if it is all of it."""
    if used.samples >= given.samples:
        return ""
    whole = f"{'a record of' if stop is None else 'the first'} {given.step * given.samples:.3g} s"
    later = f"For damage that begins later use 'gossamer watch {typed(path)}'."
    return f"Compared: 0 to {used.step * used.samples:.3g} s of {whole}. {later}"
