"""Where strain sensors tell most of damage."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.inputs import check_outputs
from gossamer_files.options import option
from gossamer_files.tables import TableText

from .arguments import Count, CountOrNone, File, Folder, NamesWithCommas, NotNegative, Values, assigned, command, names_of
from .records import numbers_by_name
from .results import Saved, first_of, zone_coordinates
from .working import need_setup, progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.placement import Placement, Placing
    from gossamer_orchestrator.pages import Page


@dataclass(frozen=True, kw_only=True, repr=False)
class SensorPlacement(Saved):
    """Sensors that were chosen.

    Attributes
    ----------
    files : list of Path
        Table, picture, sensors and page.
    result : gossamer_models.placement.Placing
        Everything that was found.
    """

    result: Placing

    @property
    def path(self) -> Path:
        """The sensors as tables of a setup."""
        return self.files[2]

    @property
    def placements(self) -> dict[str, Placement]:
        """The membrane's own sensors, if they are known, and the chosen ones."""
        return self.result.placements

    @property
    def data(self) -> xr.Dataset:
        """``a90`` and ``deviation`` [1] by ``placement``, "own" and "chosen", and ``zone`` with its ``name``; ``point`` [m]
        and ``direction`` [1] of each chosen ``sensor`` by ``axis``.
        """  # noqa: D205
        import xarray as xr

        found, placements, sensors = self.result, self.placements, self.result.chosen.sensors
        values: dict[str, Any] = {
            name: (("placement", "zone"), [getattr(each, name) for each in placements.values()], {"units": "1"})
            for name in ("a90", "deviation")
        }
        for name, unit in (("point", "m"), ("direction", "1")):
            values[name] = (("sensor", "axis"), [getattr(each, name) for each in sensors], {"units": unit})
        coords = {"placement": list(placements), "sensor": range(1, len(sensors) + 1), "axis": list("xyz")}
        coords |= zone_coordinates(found.structure.zone_names)
        return xr.Dataset(values, coords, {"noise": found.noise, "samples": found.samples})

    @property
    def lost(self) -> dict[str, list[int]]:
        """Zones that sensors do not find."""
        from gossamer_models.twin.least_squares import MOST_DAMAGE

        found = {name: (p.a90 >= MOST_DAMAGE).nonzero()[0] + 1 for name, p in self.placements.items()}
        return {name: zones.tolist() for name, zones in found.items() if zones.size}

    @property
    def sentence(self) -> str:
        """The smallest damage that is found in the worst zone."""
        from gossamer_models.placement.plots import damage_text
        from gossamer_orchestrator.words import counted

        own, chosen = self.result.own, self.result.chosen
        worst = f"With {len(chosen.sensors)} chosen sensors the worst zone has a90 = {damage_text(chosen.a90.max())} damage"
        if own is None:
            return f"{worst}."
        worst += f"; with the membrane's own {len(own.sensors)} it has {damage_text(own.a90.max())}."
        if chosen.a90.max() < own.a90.max():
            return worst
        many = counted(len(chosen.sensors), "sensor")
        return f"No placement of {many} was found that is better than the membrane's own. {worst}"

    def more(self) -> list[str]:
        """Return what a90 is, which zones are not found, and whether the check agrees."""
        return [
            "a90 is the damage that is detected in 90 % of cases at 5 % false alarms.",
            *self._told,
            *(f"The {name} sensors do not find zones {', '.join(map(str, zones))}." for name, zones in self.lost.items()),
            *self._checked,
            "The model is taken to be exact, so real sensors find less.",
        ]

    @property
    def _told(self) -> list[str]:
        """What numbers of sensors tell, and what they do not."""
        seen = [each for each in self.result.curve if each[1] < 1.0]
        curve = [f"{count} {'give' if count > 1 else 'gives'} {100.0 * worst:.2g} %" for count, worst in seen]
        told = [f"Deviation of the worst zone by the number of sensors: {', '.join(curve)}."] * bool(curve)
        if self.result.curve and self.result.curve[-1][1] > self.result.target:
            told.append(
                f"No number of sensors reaches {100.0 * self.result.target:.2g} %: measure the loads and state what is "
                f"{option('known')}, average more samples, or load it in another way."
            )
        return [*told, *self.result.unseen]

    @property
    def _checked(self) -> list[str]:
        """Whether fits to simulated records err as predicted."""
        return [
            f"{check.records} fits with the {name} sensors: their mean square error over the predicted variance, "
            f"{check.spread:.3f}, {'agrees' if check.agrees else 'does NOT agree'} with 1 ± {check.spread_error:.3f}; "
            f"{100.0 * check.false_alarms:.1f} % false alarms (5), a90 found in {100.0 * check.found:.1f} % (90)."
            for name, p in self.placements.items()
            if (check := p.check) is not None
        ]

    def lines(self) -> list[str]:
        """Return what was chosen from what, whether the check agrees, and where the sensors are."""
        found = self.result
        lines = [
            f"{len(found.chosen.sensors)} of {found.candidates} candidates; {found.record}, with white noise of deviation "
            f"{found.noise:.3g}; a90 of 95 % stands for 95 % or more.",
            *self._told,
            *self._checked,
        ]
        for k, sensor in enumerate(found.chosen.sensors):
            point, direction = (", ".join(f"{x:.4g}" for x in v) for v in (sensor.point, sensor.direction))
            lines.append(f"sensor {k + 1}: point ({point}) m, direction ({direction})")
        return lines

    def picture(self) -> bytes | None:
        """Return where the sensors are, and the a90 of each zone."""
        return first_of(self.files, ".png")

    def tables(self) -> list[TableText]:
        """Return the smallest damage that is found by zone, and the worst."""
        shown = self.placements
        checked = {name: p.check for name, p in shown.items() if p.check is not None}
        head = [f"a90 [%], {len(p.sensors)} {name} sensors" for name, p in shown.items()]
        head += [f"{name}: deviation, predicted and of {c.records} fits [%]" for name, c in checked.items()]
        rows = [
            (
                str(k + 1),
                name,
                *(f"{100.0 * p.a90[k]:.2f}" for p in shown.values()),
                *(f"{100.0 * c.predicted[k]:.2f}, {100.0 * c.observed[k]:.2f}" for c in checked.values()),
            )
            for k, name in enumerate(self.result.structure.zone_names)
        ]
        rows.append(("worst", "", *(f"{100.0 * p.a90.max():.2f}" for p in shown.values()), *[""] * len(checked)))
        caption = "Smallest damage that is found" + ", and deviation at 30 % damage" * bool(checked)
        return [TableText(("zone", "name", *head), rows, caption)]

    def describe(self) -> Page:
        """Return the page: the smallest damage that is found, by zone and on the membrane, and its check."""
        from gossamer_models.placement.plots import placement_charts
        from gossamer_orchestrator.pages import Page, table

        found = self.result
        sensors = [
            (f"{name} {k + 1}", *(", ".join(f"{x:.4g}" for x in v) for v in (s.point, s.direction)), f"{s.gauge_length:g}")
            for name, p in self.placements.items()
            for k, s in enumerate(p.sensors)
        ]
        about = [
            ("Candidates", found.candidates),
            ("Record", found.record),
            ("Deviation of the noise of a sample [1]", f"{found.noise:.4g}"),
            ("Simulated cases", found.simulations),
        ]
        return Page(
            title="Placement of sensors",
            kind="none" if all(p.check is None or p.check.agrees for p in self.placements.values()) else "invalid",
            sentence=self.sentence,
            more=self.more(),
            charts=placement_charts(self.result),
            facts=[
                *self.tables(),
                table(("sensor", "point [m]", "direction", "length [m]"), sensors, "Sensors"),
                table((), about, "The choice"),
            ],
            how="All zones, the loads' amplitudes, the damping and an offset of each sensor are unknown together.",
        )

    def to_json(self) -> dict[str, Any]:
        """Return both placements."""
        found = self.result
        placements = {
            name: {
                "sensors": [
                    {"point_m": each.point, "direction": each.direction, "gauge_length_m": each.gauge_length}
                    for each in p.sensors
                ],
                "deviation": p.deviation,
                "a90": p.a90,
                "check": None if p.check is None else {**asdict(p.check), "agrees": p.check.agrees},
            }
            for name, p in self.placements.items()
        }
        about = {name: getattr(found, name) for name in ("noise", "candidates", "curve", "unseen")}
        return {"files": self.files, "zones": found.structure.zone_names, **placements, **about}


@command
def place_sensors(
    *,
    setup: File | None = None,
    mesh: File | None = None,
    count: Count | None = None,
    target: NotNegative = 0.02,
    noise: float | None = None,
    set: Values | None = None,
    load: File | None = None,
    known: NamesWithCommas = "none",
    stop: float | None = None,
    step: float | None = None,
    points: Count = 64,
    gauge_length: NotNegative = 0.0,
    check: CountOrNone = 0,
    out: Folder = "out/placement",
) -> SensorPlacement:
    """Choose where strain sensors let damage be found best.

    Finds for every zone a90, the damage that is detected in 90 % of cases at 5 % false alarms: with the setup's own
    sensors, or the four of the thesis, and with the chosen ones. All zones, the load's amplitude, the damping and an offset
    of each sensor are unknown. Writes a table, a picture, the chosen sensors as tables of a setup, and report.html, the page
    of the placement.

    Parameters
    ----------
    setup
        The setup of a membrane on a mesh, or reflector, tube, drum, which ship with Gossamer; by default the square membrane
        of the thesis.
    mesh
        Mesh file in place of the setup's own.
    count
        Sensors to choose; by default as many as reach the target, or tell nearly as much as 64.
    target
        Standard deviation of the worst zone's damage [1] to reach.
    noise
        Standard deviation of the noise of a sample of strain [1]; by default that of the thesis, uniform from 0 to 0.02, and
        1e-4 with a setup.
    set
        A parameter or input of the membrane; may be repeated.
    load
        CSV table of the loads and motions that act: columns of inputs of the membrane with their units, for instance an
        acceleration in m/s2, beside time, which begins at rest under the first row and is repeated after the last, or
        beside state, a name for the state of rest that each row is.
    known
        What is known exactly of amplitude, that of all loads, and damping; with commas between, or all.
    stop
        Length of a record from the moment that the load sets in [s]; by default six of the structure's longest periods, or
        two of its pressure or one of its table, if they are longer; 0.3 s of the square.
    step
        Time between samples [s]; by default a 150th of the longest period, 3e-4 s of the square.
    points
        Most points among the candidates, four directions at each.
    gauge_length
        Length of the candidates [m]; 0 at the point.
    check
        Fit this many simulated noisy records with each placement, as a check.
    out
        Folder to write.

    Returns
    -------
    SensorPlacement
        Smallest damage that is found by zone, and the sensors; displayed in a notebook.

    Examples
    --------
    >>> gossamer.place_sensors(count=4, check=40).data["a90"]

    On the command line::

        gossamer place-sensors --count 4 --check 40

        gossamer place-sensors --setup drum --count 8 --noise 1e-5

        gossamer place-sensors --setup sail --load states.csv
    """
    from gossamer_files import write_text
    from gossamer_models.membrane import MembraneParams, square_structure
    from gossamer_models.placement import GAUGE_NOISE, NOISE, STEP, STOP, save_picture, sensors_text, write_csv
    from gossamer_models.placement import place_sensors as place
    from gossamer_models.placement.placing import UNKNOWN
    from gossamer_models.twin import read_loads

    from .descriptions import load_structure

    folder = Path(out)
    table, picture, sensors = (folder / name for name in ("placement.csv", "placement.png", "sensors.toml"))
    check_outputs([table, picture, sensors])
    bar = progress_bar("place-sensors")
    acting = {}
    if setup is None:
        need_setup(mesh=mesh)
        structure, p = square_structure(), MembraneParams()
        step, stop = STEP if step is None else step, STOP if stop is None else stop
        acting = {name: getattr(p, name) for name in ("pressure_amplitude", "pressure_frequency", "pressure_phase")}
    else:
        structure = load_structure(setup, mesh)
    if noise is None:
        noise = NOISE if setup is None else GAUGE_NOISE

    def report(what: str, done: int, total: int) -> None:
        if total:
            bar.update(done, total, f"{done} of {total} {what},")
        else:
            bar.update(text=f"{what},")

    with bar:
        found = place(
            structure,
            acting | numbers_by_name(assigned(set), "for instance pressure_amplitude=100"),
            count,
            known=UNKNOWN if names_of(known) == ("all",) else names_of(known),
            loads=None if load is None else read_loads(Path(load), structure),
            target=target,
            noise=noise,
            points=points,
            step=step,
            stop=stop,
            gauge_length=gauge_length,
            records=check,
            report=report,
        )
    write_csv(found, table)
    save_picture(found, picture)
    write_text(sensors, sensors_text(found))
    files = [table, picture, sensors]
    pages = save_page(SensorPlacement(files=files, result=found).describe, folder)
    return SensorPlacement(files=[*files, *pages], result=found)
