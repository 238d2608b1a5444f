"""A year in which sensors age by a fifth, each month calibrated by a twin's strain of a record of 0.3 s.

``python -m studies.ageing [FOLDER]`` from the folder ``docs`` prints a line for each month and sensor, and writes the page.
The first sensor loses a fifth of its gain and drifts by 2 ohm, the second a tenth and 1 ohm, the third a tenth and more by
tables that change their shape, the last one nothing. Meanwhile one zone loses 30 % of its stiffness and another one 15 %.
Loads are off by 3 % (deviation), noise is 0.1 % of the range, and truth and twin have the same mesh. Each month's strain is
recovered by the sensor as it was built and by the one that was last identified before: never by what its own record has
calibrated.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gossamer_files.charts import Chart, curve, points, section
from gossamer_files.tables import TableText
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import SensorArtifact, default_artifact
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin, recalibrate
from gossamer_models.twin.simulation import SensorBank
from gossamer_orchestrator.pages import PAGE, Page, write_page
from gossamer_orchestrator.words import uncertain
from numpy.typing import NDArray

from .recalibration import SCALES, recovered
from .sensor_error import perturbed
from .twin import BILINEAR, STEP

Array = NDArray[np.float64]
MONTHS = 12
LOST = np.array([0.2, 0.1, 0.1, 0.0])  # of the gain, in a year
DRIFT = np.array([2.0, -1.0, 0.0, 0.0])  # of the resistance at rest [ohm]
BENT = np.array([0.0, 0.0, 0.05, 0.0])  # of the tables, see ``perturbed``
DAMAGE = 0.3 * np.eye(16)[5] + 0.15 * np.eye(16)[10]
NOISE = 1e-3  # of the mean range
OFF = 0.03  # of the load


@dataclass(frozen=True, kw_only=True)
class Month:
    """One calibration.

    Attributes
    ----------
    month : int
        When.
    as_built, again : ndarray, shape (4,)
        Error of the strain of this month's flight over its range [1], by the sensor as it was built and by the one that
        was identified last, which the first month lacks.
    gain, offset : ndarray, shape (4, 2)
        Over the sensor as it was built [1] and [ohm], with standard deviations.
    true : ndarray, shape (4, 2)
        True gain and offset; of a sensor that bends, its mean.
    wrong : float
        Largest error of the damage of a zone [1].
    refused : str
        Why the twin's strain was no reference; then gain, offset and sensor stay those of the month before.
    """

    month: int
    as_built: Array
    again: Array
    gain: Array
    offset: Array
    true: Array
    wrong: float
    refused: str


def year(months: Sequence[int] = range(MONTHS + 1), samples: int = 1000) -> list[Month]:
    """Return the calibrations of a year, or of some months of it."""
    structure, random = square_structure(*BILINEAR), np.random.default_rng(5)
    forward = MembraneForward(structure)
    built = Twin(structure, sensor=default_artifact()).bank.parameters
    now = {name: values.copy() for name, values in built.items()}
    last: list[tuple[SensorArtifact, dict[str, float]]] = []
    found = []
    for month in months:
        age = month / MONTHS
        load = np.array([(1.0 + OFF * random.standard_normal()) * forward.parameters["pressure_amplitude"]])
        strain = forward.strain(age * DAMAGE[None], {"pressure_amplitude": load}, {}, samples, STEP)[0]
        read = np.stack([_aged(k, age, strain[k], built) for k in range(4)])
        noise = NOISE * float(np.ptp(read, axis=1).mean())
        values = read + noise * random.standard_normal(read.shape)
        twin = Twin(structure, sensor=default_artifact(), sensor_parameters=now)
        answer = twin.fit(ResponseRecord(step=STEP, values=values, kind="resistance", noise=noise))
        rest = [{"rest_strain": float(built["rest_strain"][k])} for k in range(4)]
        first = [(default_artifact(), rest[k] | {name: float(built[name][k]) for name in SCALES}) for k in range(4)]
        as_built, again = (
            np.array([_off(*sensor, read[k], strain[k]) for k, sensor in enumerate(sensors)])
            if sensors
            else np.full(4, np.nan)
            for sensors in (first, last)
        )
        gain = offset = np.full((4, 2), np.nan)
        if answer.valid:
            calibrated = recalibrate(answer, twin.bank, f"month {month}")
            gain, offset = (np.array([getattr(each, name) for each in calibrated.values()]) for name in ("gain", "offset"))
            gain *= (now["full_scale_resistance_change"] / built["full_scale_resistance_change"])[:, None]
            offset[:, 0] += now["rest_resistance"] - built["rest_resistance"]
            now["full_scale_resistance_change"] = gain[:, 0] * built["full_scale_resistance_change"]
            now["rest_resistance"] = built["rest_resistance"] + offset[:, 0]
            last = [(each.artifact, rest[k - 1]) for k, each in calibrated.items()]
        true = np.array([_line(strain[k], k, age, built) for k in range(4)])
        found.append(
            Month(
                month=month,
                as_built=as_built,
                again=again,
                gain=gain,
                offset=offset,
                true=true,
                wrong=float(np.abs(answer.damage - age * DAMAGE).max()),
                refused="" if answer.valid else ". ".join(answer.doubts),
            )
        )
    return found


def _aged(k: int, age: float, strain: Array, built: dict[str, Array]) -> Array:
    """Return what an aged sensor reads [ohm]."""
    own = {name: value[k] for name, value in built.items()}
    bank = SensorBank(perturbed(default_artifact(), age * BENT[k], k + 3), 1, 0.0, own)
    change = bank.read(strain[None, None], STEP)[0][0, 0] - own["rest_resistance"]
    return np.asarray(own["rest_resistance"] + age * DRIFT[k] + (1.0 - age * LOST[k]) * change)


def _line(strain: Array, k: int, age: float, built: dict[str, Array]) -> Array:
    """Return gain and offset of what an aged sensor reads over what it read when it was built."""
    new = _aged(k, 0.0, strain, built) - built["rest_resistance"][k]
    slope, level = np.polyfit(new, _aged(k, age, strain, built) - built["rest_resistance"][k], 1)
    return np.array([slope, level])


def _off(artifact: SensorArtifact, given: dict[str, float], read: Array, strain: Array) -> float:
    return float(np.sqrt(np.mean((recovered(artifact, given, read) - strain) ** 2)) / np.ptp(strain))


def describe(found: Sequence[Month]) -> Page:
    """Return the page of a year."""
    months = np.array([each.month for each in found])
    charts = []
    for k in range(4):
        as_built, again = (100.0 * np.array([getattr(each, name)[k] for each in found]) for name in ("as_built", "again"))
        errors = [points("as built", months, as_built, "@1"), points("identified last", months, again, "@0")]
        drawn = [Chart("Error of the recovered strain", "month", "error [% of range]", errors)]
        for column, (name, unit) in enumerate((("gain", "1"), ("offset", "ohm"))):
            value, deviation = np.array([getattr(each, name)[k] for each in found]).T
            true = curve("true", months, [each.true[k, column] for each in found], "@grey")
            traces = [true, points("found", months, value, "@0", deviation)]
            drawn.append(Chart(name.capitalize(), "month", f"{name} [{unit}]", traces))
        charts += section(f"Sensor {k + 1}", drawn)
    rows = [
        (
            str(each.month),
            str(k + 1),
            f"{100.0 * each.as_built[k]:.2f}",
            f"{100.0 * each.again[k]:.2f}" if np.isfinite(each.again[k]) else "",
            *(uncertain(*pair) if not each.refused else "refused" for pair in (each.gain[k], each.offset[k])),
        )
        for each in found
        for k in range(4)
    ]
    head = ("month", "sensor", "as built [% of range]", "identified last", "gain [1]", "offset [ohm]")
    worst = max(float(np.nanmax(each.as_built)) for each in found), max(float(np.nanmax(each.again)) for each in found[1:])
    wrong = max(each.wrong for each in found if not each.refused)
    return Page(
        title="A year of ageing sensors",
        sentence=f"As they were built, sensors recover strain to within {100.0 * worst[0]:.1f} % of its range; as they were "
        f"identified before each flight, to within {100.0 * worst[1]:.1f} %.",
        more=[
            f"Damage of the zones is found to within {100.0 * wrong:.1f} points where the twin is valid.",
            *(f"Month {each.month} calibrates nothing: {each.refused}." for each in found if each.refused),
        ],
        charts=charts,
        facts=[TableText(head, rows, "Every month")],
        how=" ".join((__doc__ or "").split("the page.")[-1].split()),
    )


def main() -> None:
    """Print the lines and write the page."""
    found = year()
    page = describe(found)
    for row in page.facts[0].rows:  # type: ignore[union-attr]
        print("  ".join(row))
    print(page.sentence, *page.more)
    print(write_page(page, Path(sys.argv[1] if len(sys.argv) > 1 else "out/ageing") / PAGE))


if __name__ == "__main__":
    main()
