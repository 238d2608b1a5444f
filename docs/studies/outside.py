"""Benchmarks of others for nonlinear systems: how far the sensors' model class and its rivals get where it does not belong.

``python -m studies.outside`` from the folder ``docs`` prints a table. *Cascaded tanks* is loaded by the package
``nonlinear-benchmarks`` (extra ``benchmark``), which needs the network at the first call; where it cannot be had, that is
said. The *Bouc-Wen* oscillator is published as an equation with a way to make the training data [1]_; it is integrated
here, trained on one period of a random-phase multisine and tested on another one.

References
----------
.. [1] J. P. Noel, M. Schoukens, Hysteretic benchmark with a dynamic nonlinearity, 4TU.ResearchData, doi:10.4121/12967592.
"""

from __future__ import annotations

import csv
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from gossamer_models.fitting.reading import Columns
from gossamer_models.identify import identify_files
from numpy.typing import NDArray

Array = NDArray[np.float64]
MASS, DAMPING, STIFFNESS = 2.0, 10.0, 5e4  # [kg], [N s/m], [N/m]
ALPHA, BETA, GAMMA, DELTA = 5e4, 1e3, 0.8, -1.1  # [N/m], [1/m], [1], [1]
RATE, FINER, PERIOD = 750.0, 20, 8192  # [1/s], integration steps a sample, samples
BAND, FORCE = (5.0, 150.0), 50.0  # [Hz], rms [N]
STRAIN, OHM = 0.3, 100.0  # what the range of input and output are called


def multisine(random: np.random.Generator) -> Array:
    """Return a period of a random-phase multisine [N] at ``FINER`` times the rate."""
    spectrum = np.zeros(FINER * PERIOD // 2 + 1, dtype=complex)
    lines = np.arange(int(BAND[0] * PERIOD / RATE), int(BAND[1] * PERIOD / RATE))
    spectrum[lines] = np.exp(2j * np.pi * random.uniform(size=lines.size))
    force = np.fft.irfft(spectrum)
    return np.asarray(FORCE * force / np.sqrt(np.mean(force**2)))


def bouc_wen(force: Array) -> Array:
    """Integrate displacement [m] under a force [N] of ``FINER`` steps a sample, by a Runge-Kutta method of order 4."""
    h, found, state = 1.0 / (RATE * FINER), np.empty(force.size), np.zeros(3)

    def slope(x: Array, u: float) -> Array:
        y, v, z = x
        change = ALPHA * v - BETA * (GAMMA * abs(v) * z + DELTA * v * abs(z))
        return np.array([v, (u - STIFFNESS * y - DAMPING * v - z) / MASS, change])

    for k, (u, after) in enumerate(zip(force, np.append(force[1:], force[0]), strict=True)):
        found[k] = state[0]
        a = slope(state, u)
        b = slope(state + 0.5 * h * a, 0.5 * (u + after))
        c = slope(state + 0.5 * h * b, 0.5 * (u + after))
        d = slope(state + h * c, after)
        state = state + h * (a + 2.0 * b + 2.0 * c + d) / 6.0
    return found


def oscillator() -> tuple[Array, Array, Array, float]:
    """Return time [s], force [N] and displacement [mm] of a training and a test period, and when the test begins [s]."""
    random = np.random.default_rng(1)
    one, other = multisine(random), multisine(random)
    y = bouc_wen(np.concatenate([one, one, other]))[one.size :: FINER]
    u = np.concatenate([one, other])[::FINER]
    return np.arange(u.size) / RATE, u, 1e3 * y, PERIOD / RATE


def tanks() -> tuple[Array, Array, Array, float]:
    """Return time [s], voltage of the pump and of the level [V], and when the test begins [s]."""
    import nonlinear_benchmarks

    train, test = nonlinear_benchmarks.Cascaded_Tanks(atleast_2d=False)
    u = np.concatenate([np.asarray(part.u, dtype=np.float64) for part in (train, test)])
    y = np.concatenate([np.asarray(part.y, dtype=np.float64) for part in (train, test)])
    step = float(train.sampling_time)
    return step * np.arange(u.size, dtype=np.float64), np.array(u), np.array(y), step * len(np.asarray(train.u))


def line(name: str, unit: str, data: tuple[Array, Array, Array, float]) -> str:
    """Return the errors of the output on the test, by model, as a row of a table."""
    time, u, y, begin = data
    strain = STRAIN * (u - u.min()) / np.ptp(u)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "record.csv"
        with path.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["time_s", "strain", "resistance_ohm"])
            rows.writerows(zip(time, strain, OHM * (1.0 + (y - y.min()) / np.ptp(y)), strict=True))
        columns = Columns(time="time_s", strain="strain", resistance="resistance_ohm")
        found = identify_files([path], settings="auto", columns=columns, train=f"0:{begin:g}")
    test = time >= begin
    unit_of = np.ptp(y[test]) / 100.0  # errors are in % of the range
    errors = {"mean of training": float(np.sqrt(np.mean((y[test] - y[~test].mean()) ** 2)))}
    errors |= {each.model: unit_of * each.forward[0] for each in found.standings if each.forward}
    return f"| {name}, rms [{unit}] | " + ", ".join(f"{model} {error:.3g}" for model, error in errors.items()) + " |"


def main() -> None:
    """Print the table."""
    print("| benchmark | error of the simulated output on the test |\n|---|---|", flush=True)
    print(line("Bouc-Wen oscillator", "mm", oscillator()), flush=True)
    try:
        data = tanks()
    except (ImportError, OSError) as error:
        print(f"| cascaded tanks | not loaded: {error} |")
    else:
        print(line("cascaded tanks", "V", data))


if __name__ == "__main__":
    main()
