r"""Healthy response to a load that repeats, and what damages and nuisances change of it; a watch on board has both.

Symbols: ``s`` sensors, ``z`` zones, ``q`` nuisances that last, in units of their priors' deviations; ``N`` samples of a
period, ``h`` step [s].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix
from ..errors import ConvergenceError, require
from ..membrane import Structure
from .forward import Forward, finer_of, forward_of
from .nuisances import GAIN, Loads, Nuisances, possible
from .simulation import Place, SensedForward
from .watch import HALF, MOVED, NEIGHBOUR

KINDS = ("amplitude", "damping", "modulus", "density", "prestrain")  # nuisances of the membrane and its load
REPEATS = 1e-6  # change of a response that has settled, of its range
FEWEST, MOST = 200, 20_000  # periods that are simulated until then
LONGER = 2.0  # times as long as damping takes to reach it from the range
LEAST = 20  # samples of a window
PER_PERIOD = 2.0  # windows in a first period of the membrane, nearly
BENT = 0.5  # deviations of the load for its second derivative


@dataclass(frozen=True, kw_only=True)
class StoredResponses:
    """Healthy response to a load that repeats, and what changes it.

    Attributes
    ----------
    zones : tuple of str
        Names of the z zones.
    step : float
        Time between samples [s]; a period of the load is a whole number of them.
    windows : int
        Windows of a period.
    healthy : ndarray, shape (s, N)
        Strain [1] after 1, 2, ... steps of a period.
    lasting : ndarray, shape (q, s, N)
        What a deviation of each nuisance adds: of the membrane and its load, the square of the load's, a gain of each
        sensor, finer elements.
    slopes : ndarray, shape (z, s, N)
        What damage of each zone adds, over the damage [1].
    """

    zones: tuple[str, ...]
    step: float
    windows: int
    healthy: Matrix
    lasting: Matrix
    slopes: Matrix


def stored_responses(
    structure: Structure | Forward | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    step: float = 3e-4,
    exact_mesh: bool = False,
    report: Callable[[float], None] = lambda _: None,
) -> StoredResponses:
    """Simulate what a watch on board compares readings with, from the same model and priors as ``Watch``.

    Parameters
    ----------
    structure : Structure, Forward or None
        Membrane whose built-in pressure repeats; None for the square of the thesis.
    parameters : mapping of str to float
        Parameters that differ from their start values.
    step : float
        Time between samples [s]; it is changed until a period of the load is a whole number of windows and samples.
    exact_mesh : bool
        Whether readings come from the mesh of the structure, so that half of what finer elements add is no part of them.
    report : callable
        Is called after each period with the share of the simulation that is done [1].

    Raises
    ------
    ParameterError
        There is no built-in pressure, its period has less than 20 samples, or nothing is damped.
    ConvergenceError
        A simulation fails, or the response does not repeat within 200 periods, or in twice the time in which damping alone
        lets the start fade.
    """
    forward = forward_of(structure, parameters)
    numbers = {**forward.parameters, **forward.inputs}
    acts = numbers.get("pressure_amplitude", 0.0) > 0.0 and numbers["pressure_frequency"] > 0.0
    require(
        acts, "a watch on board needs a load that repeats. Give the setup a pressure_amplitude and a pressure_frequency."
    )
    damping = numbers.get("mass_damping", 0.0)
    require(damping > 0.0, "without damping no response settles. Give the setup a mass_damping [1/s].")
    period = 1.0 / numbers["pressure_frequency"]
    fades = 2.0 * math.log(1.0 / REPEATS) / damping / period  # slow modes that are damped above critically take longer
    require(fades < MOST, f"mass_damping {damping:g} 1/s lets the start fade in {fades:.3g} periods of the load. Raise it.")
    most = max(FEWEST, math.ceil(LONGER * fades))
    windows = min(max(1, round(PER_PERIOD * period / forward.period)), int(period / step / LEAST))
    require(windows, f"a period of the load has less than {LEAST} samples. Shorten the step of {step:g} s.")
    samples = round(period / windows / step)
    kinds = tuple(kind for kind in KINDS if kind in possible(numbers, Loads()))
    nuisances = Nuisances(kinds, forward.parameters, forward.inputs, forward.sensors)
    around = np.vstack([np.zeros(len(kinds)), MOVED * np.eye(len(kinds))])
    bent = BENT * np.outer([1.0, -1.0], np.eye(len(kinds))[kinds.index("amplitude")])
    rows = np.vstack([around, bent])
    given = [{name: float(value[0]) for name, value in nuisances.moved(z[None]).items()} for z in rows]
    zones, N, h = len(forward.zones), windows * samples, period / windows / samples
    damages = np.vstack([np.zeros((len(given), zones)), NEIGHBOUR * np.eye(zones)])
    finer = None if exact_mesh else finer_of(forward)
    parts = 1.0 if finer is None else 2.0
    found = _settled(forward, damages, given + [{}] * zones, (N, most), h, lambda done: report(done / parts))
    added = np.zeros((0, *found.shape[1:]))
    if finer is not None:
        fine = _settled(finer, damages[:1], [{}], (N, most), h, lambda done: report((1.0 + done) / parts))
        added = HALF * (fine - found[:1])
    gains = GAIN * found[0][None] * np.eye(forward.sensors)[:, :, None]
    moved = (found[1 : len(around)] - found[0]) / MOVED
    curved = (found[len(given) - 2 : len(given)].sum(axis=0, keepdims=True) - 2.0 * found[:1]) / (2.0 * BENT**2)
    return StoredResponses(
        zones=forward.zones,
        step=h,
        windows=windows,
        healthy=found[0] + added.sum(axis=0),
        lasting=np.concatenate([moved, curved, gains, added]),
        slopes=(found[len(given) :] - found[0]) / NEIGHBOUR,
    )


def _settled(
    forward: Forward,
    damages: Matrix,
    given: list[dict[str, float]],
    length: tuple[int, int],
    h: float,
    report: Callable[[float], None],
) -> Matrix:
    """Return a period of the strain of some cases, shape (m, s, N), when it repeats; ``length`` is N, and most periods."""
    N, most = length
    sensed = SensedForward(forward)
    place = Place.joined([sensed.begin(damage, each, h) for damage, each in zip(damages, given, strict=True)])
    through = np.repeat(damages[:, None], N, axis=1)
    before = np.full((len(damages), forward.sensors, N), np.inf)
    for _ in range(most):
        found, _, place = sensed.advance(place, through, {}, h)
        if not np.isfinite(found).all():
            msg = "the simulation of the healthy response, of one near it, or of a damage fails. Lower the load."
            raise ConvergenceError(msg)
        change = np.abs(found - before).max() / np.ptp(found[0], axis=1).min()
        if change <= REPEATS:
            return found
        report(min(max(math.log(change) / math.log(REPEATS), 0.0), 1.0) if change < 1.0 else 0.0)
        before = found
    msg = f"the response does not repeat within {most} periods of the load. Lower the load, or choose another damping."
    raise ConvergenceError(msg)
