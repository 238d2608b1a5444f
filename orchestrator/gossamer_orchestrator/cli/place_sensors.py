"""``gossamer place-sensors``: points and directions from which damage is best found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from gossamer_files import replacing

from ..errors import OrchestratorError
from .command import Result, show, stderr
from .common import keep_inputs, model_errors, note_page, save_page

if TYPE_CHECKING:
    from gossamer_models.placement import Placement, Placing


def place_sensors(
    setup: Annotated[
        Path | None,
        typer.Argument(help="The setup of a membrane on a mesh; the square membrane of the thesis by default."),
    ] = None,
    mesh: Annotated[Path | None, typer.Option(help="Mesh file in place of the setup's own.", metavar="FILE")] = None,
    count: Annotated[int, typer.Option(help="Sensors to choose.", min=1)] = 4,
    noise: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the noise of a sample of strain [1]; by default that of the thesis, uniform from 0 "
            "to 0.02."
        ),
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", help="A parameter or input of the membrane; may be repeated.", metavar="NAME=VALUE"),
    ] = None,
    stop: Annotated[float, typer.Option(help="Length of a record from the moment that the load sets in [s].")] = 0.3,
    step: Annotated[float, typer.Option(help="Time between samples [s].")] = 3e-4,
    points: Annotated[int, typer.Option(help="Most points among the candidates, four directions at each.", min=1)] = 64,
    gauge_length: Annotated[float, typer.Option(help="Length of the candidates [m]; 0 at the point.", min=0.0)] = 0.0,
    check: Annotated[
        int, typer.Option(help="Fit this many simulated noisy records with each placement, as a check.", min=0)
    ] = 0,
    out: Annotated[Path, typer.Option(help="Folder to write.", metavar="FOLDER")] = Path("out/placement"),
) -> Result:
    """Choose where strain sensors let damage be found best.

    Prints for every zone a90, the damage that is detected in 90 % of cases at 5 % false alarms: with the setup's own
    sensors, or the four of the thesis, and with the chosen ones. All zones, the load's amplitude, the damping and an offset
    of each sensor are unknown. Writes a table, a picture, the chosen sensors as tables of a setup, and report.html, the page
    of the placement.

    For example:

        gossamer place-sensors --count 4 --check 40

        gossamer place-sensors sail.toml --set pressure_amplitude=2 --set pressure_frequency=0.5 --stop 20 --step 0.02
    """
    from gossamer.pages.place_sensors import zone_table

    from ..pages import PAGE
    from .tables import printed

    found, paths = place_given(
        setup,
        mesh=mesh,
        count=count,
        noise=noise,
        values=values,
        stop=stop,
        step=step,
        points=points,
        gauge_length=gauge_length,
        check=check,
        out=out,
    )
    stderr().print(printed(zone_table(found)))
    stderr().print(summary(found, samples=round(stop / step)), highlight=False)
    for path in paths:
        show(path)
    if out / PAGE in paths:
        note_page(out / PAGE)
    placements = {name: _as_content(p) for name, p in (("own", found.own), ("chosen", found.chosen)) if p is not None}
    zones = [zone.group for zone in found.structure.setup.zones]
    return Result({"files": paths, "zones": zones, **placements, "noise": found.noise, "candidates": found.candidates})


def place_given(
    setup: Path | None,
    *,
    mesh: Path | None,
    count: int,
    noise: float | None,
    values: list[str] | None,
    stop: float,
    step: float,
    points: int,
    gauge_length: float,
    check: int,
    out: Path,
) -> tuple[Placing, list[Path]]:
    """Choose sensors with the options of the command; return what was found; table, picture, sensors and page."""
    from gossamer.pages.place_sensors import placement_page
    from gossamer_models.membrane import square_structure
    from gossamer_models.placement import NOISE, save_picture, sensors_text, write_csv
    from gossamer_models.placement import place_sensors as place

    from ..pages import PAGE
    from ..run.progress import ProgressBar
    from .setup_file import load_structure

    paths = [out / name for name in ("placement.csv", "placement.png", "sensors.toml")]
    keep_inputs([setup, mesh], paths)
    bar = ProgressBar("place-sensors", stderr())
    with model_errors():
        if setup is None and mesh is not None:
            msg = "--mesh needs a setup. Write: gossamer place-sensors sail.toml --mesh sail.msh"
            raise OrchestratorError(msg)
        structure = square_structure() if setup is None else load_structure(setup, mesh)
        load = {**({} if setup is not None else _thesis_load()), **_numbers(values or [])}
        with bar:
            bar.update(text="compiling,")
            found = place(
                structure,
                load,
                count,
                noise=NOISE if noise is None else noise,
                points=points,
                step=step,
                stop=stop,
                gauge_length=gauge_length,
                records=check,
                report=lambda what, done, total: bar.update(done, total, f"{done} of {total} {what},"),
            )
        out.mkdir(parents=True, exist_ok=True)
        write_csv(found, paths[0])
        save_picture(found, paths[1])
        with replacing(paths[2]) as unfinished:
            unfinished.write_text(sensors_text(found), encoding="utf-8")
    return found, paths + save_page(lambda: placement_page(found, round(stop / step)), out / PAGE)


def _as_content(placement: Placement) -> dict[str, Any]:
    check = placement.check
    return {
        "sensors": [
            {"point_m": each.point, "direction": each.direction, "gauge_length_m": each.gauge_length}
            for each in placement.sensors
        ],
        "deviation": placement.deviation,
        "a90": placement.a90,
        "check": None if check is None else {**asdict(check), "agrees": check.agrees},
    }


def _thesis_load() -> dict[str, float]:
    from gossamer_models.membrane import MembraneParams

    p = MembraneParams()
    return {
        "pressure_amplitude": p.pressure_amplitude,
        "pressure_frequency": p.pressure_frequency,
        "pressure_phase": p.pressure_phase,
    }


def _numbers(texts: Sequence[str]) -> dict[str, float]:
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            msg = f"--set {text}: write a name and a number, for instance pressure_amplitude=100."
            raise OrchestratorError(msg) from None
    return found


def summary(found: Placing, samples: int) -> str:
    """Say what was chosen from what, whether the check agrees, and where the sensors are."""
    from gossamer.pages.place_sensors import check_sentence

    lines = [
        f"{len(found.chosen.sensors)} of {found.candidates} candidates; {samples} samples with white noise of deviation "
        f"{found.noise:.3g}; a90 of 95 % stands for 95 % or more."
    ]
    for name, placement in (("own", found.own), ("chosen", found.chosen)):
        if placement is not None and placement.check is not None:
            lines.append(check_sentence(name, placement.check))
    for k, sensor in enumerate(found.chosen.sensors):
        point, direction = (", ".join(f"{x:.4g}" for x in v) for v in (sensor.point, sensor.direction))
        lines.append(f"sensor {k + 1}: point ({point}) m, direction ({direction})")
    return "\n".join(lines)
