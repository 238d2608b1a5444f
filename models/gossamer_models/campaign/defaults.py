r"""What a campaign is of a setup alone: windows and steps from the structure's own time scales, damage that is random.

Symbols: ``f`` frequency of the built-in pressure or of a table of loads [Hz], ``T1`` first period [s], ``c`` mass damping
[1/s].
"""

from __future__ import annotations

import math

import numpy as np
from gossamer_files.options import option

from ..errors import ParameterError, require
from ..membrane import Structure, first_period
from .description import CampaignPlan, Damage, Distribution, MeasurementNoise
from .mesh import Mesh

CASES = 4000
NOISE = 1e-4  # of a sample of strain [1], as of a good gauge
CYCLES, FIRST_PERIODS = 3, 2  # that a window has at least, of the load and of the structure
SAMPLES, MOST_SAMPLES = 600, 1600  # of a window
PER_PERIOD = 20  # samples of the first period, at least
WINDOWS, MOST_WINDOWS = 3, 8  # of a run, until what its begin has excited is below ``LEFT``
LEFT = 0.02
WHOLE = 1e-6  # of a period: what is no more than round-off


def campaign_of_setup(
    membrane: Mesh, *, cases: int = CASES, noise: float = NOISE, window: float | None = None, seed: int = 1
) -> CampaignPlan:
    r"""Plan what a detector of a structure can be trained on.

    Parameters
    ----------
    membrane : Mesh
        Setup with zones and sensors, constant parameters that differ from its own, and the loads over time.
    cases : int
        How many.
    noise : float
        Standard deviation of a sample of strain [1].
    window : float, optional
        Length of a window of the detector [s]; by default whole periods of the load, as many as also hold two of the first
        mode. A table of loads is one period.
    seed : int
        Of everything that is drawn.

    Returns
    -------
    CampaignPlan
        One to four damaged zones of 5 to 50 %; of a third of the cases damage begins within the run, which is as long as the
        motion that the load excites when it sets in takes to die out: :math:`e^{-ct/2}` of it is left.

    Raises
    ------
    ParameterError
        The setup has no zones or no sensors, nothing moves it, or two loads of other periods do.
    """
    structure = membrane.structure
    _check_monitored(structure)
    values = {name: row.start or 0.0 for name, row in membrane.settable.items()} | dict(membrane.parameters)
    f, amplitude, c = (values[name] for name in ("pressure_frequency", "pressure_amplitude", "mass_damping"))
    pressed = any(load.kind == "pressure" for load in structure.setup.loads)
    T1, table = first_period(structure, membrane.parameters), membrane.load
    pulsing = amplitude > 0.0 and f > 0.0 and pressed
    if table is not None:
        periods = table.length * f if pulsing else 1.0
        if abs(periods - round(periods)) > WHOLE or periods < WHOLE:
            msg = (
                f"the built-in pressure of {f:g} Hz acts, too, and the table of loads, which is repeated after "
                f"{table.length:g} s, holds {periods:.4g} of its periods. Set pressure_amplitude to 0, or write whole ones."
            )
            raise ParameterError(msg)
        f = 1.0 / table.length
    elif not pulsing:
        lacks = (
            "has no load of the kind pressure"
            if not pressed
            else f"has pressure_amplitude {amplitude:g} Pa and pressure_frequency {f:g} Hz"
        )
        msg = (
            f"nothing moves this structure, so its strain tells no damage: its setup {lacks}. Write there the built-in "
            f"pressure that it will be under, or name a table of loads with {option('load')}; its first frequency is "
            f"{1.0 / T1:.3g} Hz. A structure that does not move is for the twin, from static records."
        )
        raise ParameterError(msg)
    cycles = CYCLES if table is None else 1
    length = window or math.ceil(max(cycles, FIRST_PERIODS * T1 * f) * (1.0 - WHOLE)) / f
    least = PER_PERIOD * length / T1 if table is None else max(PER_PERIOD * length / T1, len(table.time) * length * f)
    samples = 4 * math.ceil(np.clip(least, SAMPLES, MOST_SAMPLES) / 4)
    step = length / samples
    settled = 2.0 * math.log(1.0 / LEFT) / c if c > 0.0 else math.inf
    windows = int(np.clip(math.ceil(min(settled / length, MOST_WINDOWS)), WINDOWS, MOST_WINDOWS))
    last = (windows - 1) * samples * step
    return CampaignPlan(
        title=f"Training of a detector: {structure.setup.title or structure.mesh.name}",
        cases=cases,
        seed=seed,
        step=step,
        stop=windows * samples * step,
        window=samples * step,
        chunk=64,
        membrane=membrane,
        damage=Damage(zones=(1, min(4, structure.n_zones)), healthy=0.1, onset=(-2.0 * last, last)),
        noise=MeasurementNoise(strain=Distribution(normal=noise)),
    )


def _check_monitored(structure: Structure) -> None:
    """Refuse a structure without zones or sensors."""
    for count, what, advice in (
        (structure.n_zones, "zones", "so there is no damage to find. Write [[zones]] with groups of faces"),
        (structure.n_sensors, "sensors", "so nothing is measured. Write [[sensors]], or let place-sensors choose them"),
    ):
        require(count, f"the setup has no {what}, {advice}.")
