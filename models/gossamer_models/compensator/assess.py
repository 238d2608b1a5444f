"""Figures of the compensator under noise, with a wrong model and on the synthetic specimen.

Run ``python -m gossamer_models.compensator.assess``. An estimate for time t that is delivered at t + delay is compared
with the strain at t; the error of what is said about the present stands beside it. Percent are of full scale.
``run_*`` return what was run, for pictures; ``assess_*`` turn it into figures.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..identification.assess import Figure, specimen_record
from ..identification.preisach import Fit, fit_preisach
from ..identification.records import Record
from ..identification.run import settings_for
from ..sensor import SensorArtifact, default_artifact, sensor_model
from ..step_model import StepModel
from ..stepper import Stepper
from . import compensator_model

Vector = NDArray[np.float64]
Shape = Literal["ramps", "cosines", "holds"]

STEP = 0.1  # [s]
ETA = 0.85
SAMPLES = 20_000
SHAPES: tuple[Shape, ...] = ("ramps", "cosines", "holds")
SHORTER_LEGS = ((60, 140), (30, 70), (10, 30))  # [samples]
LEGS = (
    200,
    600,
)  # [samples]: the exact inverse is then at 25 % and 53 %, at least as hard as where it is at 13.5 % and 33 %
LONG = f"ramps, {LEGS[0]} to {LEGS[1]} samples a leg"  # the history that figures are asked for
ASKED = {0.001: 0.4, 0.005: 1.2}  # [% of full scale] of the estimator, by noise [1]
UNIT = {"rest_resistance": 0.0, "full_scale_resistance_change": 1.0, "full_scale_strain": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a compensator made of a record.

    Attributes
    ----------
    strain : ndarray, shape (m,)
        True strain [1] at the time that an estimate is given for.
    error, present_error : ndarray, shape (m,)
        Errors of the strain [1] at the time it is given for, and of the strain said to be present.
    deviation : ndarray, shape (m,)
        Standard deviation [1] that the estimator states; zero for the inverse.
    """

    strain: Vector
    error: Vector
    present_error: Vector
    deviation: Vector

    @property
    def rms(self) -> float:
        """Root mean square error [% of full scale]."""
        return 100.0 * float(np.sqrt(np.mean(self.error**2)))

    @property
    def present_rms(self) -> float:
        """The same of the present strain [% of full scale]."""
        return 100.0 * float(np.sqrt(np.mean(self.present_error**2)))

    @property
    def over_stated(self) -> float:
        """Root mean square of the error over the stated deviation [1]; 1 if the estimator is honest."""
        return float(np.sqrt(np.mean((self.error / self.deviation) ** 2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One way of compensation on one kind of history.

    Attributes
    ----------
    how : str
        The way.
    history : str
        What the strain does.
    noise : float
        Standard deviation of the output's noise [1].
    eta_error : float
        Relative error of the eta that the compensator believes in [1].
    runs : tuple of Run
        One per seed.
    """

    how: str
    history: str
    noise: float
    eta_error: float = 0.0
    runs: tuple[Run, ...]

    def over_runs(self, quantity: Literal["rms", "present_rms", "over_stated"]) -> float:
        """Return the root mean square of a quantity of the runs."""
        return float(np.sqrt(np.mean([getattr(run, quantity) ** 2 for run in self.runs])))


@dataclass(frozen=True, kw_only=True)
class Recovery:
    """The experiment of Section 5.5.

    Attributes
    ----------
    record : Record
        Four cycles, of which the first two are fitted.
    fit : Fit
        The sensor.
    time, strain : ndarray, shape (m,)
        Times [s] and true strain [1] of the samples that the compensators see.
    judged : ndarray of bool, shape (m,)
        Those of the two cycles that were not fitted.
    found : dict
        Name of the compensator to the strain [1] it gives for those samples, shape (m - lag,): without its last ``lag``
        ones, where the estimate is delivered after the record.
    deviation : ndarray
        What the estimator states [1], of the shape of its strain.
    """

    record: Record
    fit: Fit
    time: Vector
    strain: Vector
    judged: NDArray[np.bool_]
    found: dict[str, Vector]
    deviation: Vector

    def squares(self, name: str) -> float:
        """Return the measure of Section 5.5, sum of squared errors over sum of squares [%]."""
        estimate = self.found[name]
        keep = self.judged[: estimate.size]
        true = self.strain[: estimate.size][keep]
        return 100.0 * float(((estimate[keep] - true) ** 2).sum() / (true**2).sum())


def uniform_eta(eta: float = ETA, *, relaxing: bool = False) -> SensorArtifact:
    """Return the default sensor with another eta, with or without its relaxation."""
    base = default_artifact()
    nu = eta * np.array(base.mu)
    return replace(base, nu=tuple(map(tuple, nu.tolist())), relaxation=base.relaxation if relaxing else ())


def random_legs(samples: int, seed: int, legs: tuple[int, int] = LEGS, shape: Shape = "ramps") -> Vector:
    """Return strain [1] that runs between random turning points in 0..1, shape (samples,).

    Parameters
    ----------
    samples, seed : int
        Length and seed.
    legs : tuple of int
        Shortest and longest leg [samples].
    shape : {"ramps", "cosines", "holds"}
        Constant rate; half a cosine per leg; or constant rate and a rest as long as a leg at every turning point.
    """
    rng = np.random.default_rng(seed)
    parts: list[Vector] = []
    now, length = 0.0, 0
    while length < samples:
        n = int(rng.integers(legs[0], legs[1] + 1))
        x, turn = np.arange(1, n + 1) / n, rng.uniform()
        if shape == "cosines":
            x = 0.5 - 0.5 * np.cos(np.pi * x)
        if shape == "holds":
            x = np.concatenate([x, np.ones(n)])
        parts.append(now + (turn - now) * x)
        now, length = turn, length + x.size
    return np.concatenate(parts)[:samples]


def drive(
    model: StepModel, inputs: dict[str, Vector], names: tuple[str, ...], h: float, **start: float
) -> list[Vector]:
    """Run a model; return the variables of these names, each of shape (m,)."""
    stepper = Stepper(model, **start)
    stepper.initialize()
    places = [stepper.index(name) for name in inputs]
    results = [stepper.index(name) for name in names]
    table = []
    for row in np.column_stack(list(inputs.values())):
        stepper.set_values(places, row.tolist())
        stepper.step(h)
        table.append(stepper.get_values(results))
    return list(np.array(table).T)


def measure(strain: Vector, noise: float, seed: int, artifact: SensorArtifact) -> Vector:
    """Return the output [1] of a sensor with white noise of a standard deviation ``noise`` [1], shape of ``strain``."""
    output: Vector = drive(sensor_model(artifact), {"strain": strain}, ("resistance",), STEP, **UNIT)[0]
    return output + noise * np.random.default_rng(seed).standard_normal(strain.size)


def run_estimator(
    artifact: SensorArtifact, strain: Vector, output: Vector, noise: float, eta_deviation: float = 0.0, every: int = 0
) -> Run:
    """Run the estimator; every so many samples it is told the strain, never if 0."""
    known = (np.arange(1, strain.size + 1) % every == 0) * 1.0 if every else np.zeros(strain.size)
    names = ("strain", "present_strain", "strain_deviation", "delay")
    found, present, deviation, delay = drive(
        compensator_model(artifact, "estimator"),
        {"resistance": output, "known": known, "known_strain": strain},
        names,
        STEP,
        noise=noise,
        eta_deviation=eta_deviation,
        **UNIT,
    )
    lag = round(float(delay[-1]) / STEP)
    true = strain[: strain.size - lag]
    return Run(strain=true, error=found[lag:] - true, present_error=present - strain, deviation=deviation[lag:])


def run_inverse(artifact: SensorArtifact, strain: Vector, output: Vector, lag: int = 0, dead_band: float = 0.0) -> Run:
    """Run the exact inverse; ``lag`` [samples] is what was done to the output before."""
    found = drive(compensator_model(artifact), {"resistance": output}, ("strain",), STEP, dead_band=dead_band, **UNIT)[
        0
    ]
    true = strain[: strain.size - lag]
    return Run(strain=true, error=found[lag:] - true, present_error=found - strain, deviation=np.zeros_like(true))


def assess_compensator(seeds: tuple[int, ...] = (0, 1, 2)) -> list[Figure]:
    """Return all figures; root mean squares over the seeds, which the settings were not chosen on alone."""
    return [*assess_noise(seeds), *assess_wrong_eta(seeds), *assess_section_5_5()]


def assess_noise(seeds: tuple[int, ...] = (0, 1, 2), cases: Iterable[Case] | None = None) -> list[Figure]:
    """Return the errors under noise of the plain ways and of the estimator, run now or before."""
    cases = (*run_ways(seeds), *run_histories(seeds[0])) if cases is None else cases
    figures = []
    for case in cases:
        what = f"eta {ETA}, noise {case.noise:.1%}, {case.how}"
        if case.history != LONG:
            figures.append(_figure(f"{what}, {case.history}", case.over_runs("rms")))
            continue
        asked = ASKED.get(case.noise) if case.how == "estimator" else None
        figures.append(_figure(what, case.over_runs("rms"), asked))
        if case.how == "estimator":
            figures.append(_figure(f"{what}, present strain", case.over_runs("present_rms")))
            figures.append(_figure(f"{what}, error over stated deviation", case.over_runs("over_stated"), unit="1"))
    return figures


def run_ways(seeds: tuple[int, ...] = (0, 1, 2), noises: Sequence[float] = tuple(ASKED)) -> list[Case]:
    """Run the plain ways and the estimator on long random histories under noise."""
    cases = []
    artifact = uniform_eta()
    for noise in noises:
        runs: dict[str, list[Run]] = {}
        for seed in seeds:
            strain = random_legs(SAMPLES, seed)
            output = measure(strain, noise, 100 + seed, artifact)
            mean = np.convolve(np.concatenate([np.full(24, output[0]), output]), np.full(25, 1 / 25), "valid")
            runs.setdefault("exact inverse", []).append(run_inverse(artifact, strain, output))
            runs.setdefault("dead band of 3 deviations", []).append(
                run_inverse(artifact, strain, output, dead_band=3 * noise)
            )
            runs.setdefault("25-point mean", []).append(run_inverse(artifact, strain, mean, lag=12))
            runs.setdefault("estimator", []).append(run_estimator(artifact, strain, output, noise))
        cases += [Case(how=how, history=LONG, noise=noise, runs=tuple(found)) for how, found in runs.items()]
    return cases


def run_histories(seed: int = 0, noises: Sequence[float] = tuple(ASKED)) -> list[Case]:
    """Run the estimator on faster histories of several shapes."""
    cases = []
    artifact = uniform_eta()
    for noise in noises:
        for legs in SHORTER_LEGS:
            for shape in SHAPES:
                strain = random_legs(SAMPLES, seed, legs, shape)
                run = run_estimator(artifact, strain, measure(strain, noise, 200, artifact), noise)
                history = f"{shape}, {legs[0]} to {legs[1]} samples a leg"
                cases.append(Case(how="estimator", history=history, noise=noise, runs=(run,)))
    return cases


def assess_wrong_eta(seeds: tuple[int, ...] = (0, 1, 2), cases: Iterable[Case] | None = None) -> list[Figure]:
    """Return the errors with an eta that is wrong by 2 %, told the strain never or now and then; run now or before."""
    figures = []
    for case in run_wrong_eta(seeds) if cases is None else cases:
        what, told = f"eta wrong by {case.eta_error:+.0%}, {case.how}", case.how != "exact inverse"
        figures.append(_figure(what, case.over_runs("rms"), 2.0 if told else None))
        if told:
            figures.append(_figure(f"{what}, over stated", case.over_runs("over_stated"), unit="1"))
    return figures


def run_wrong_eta(
    seeds: tuple[int, ...] = (0, 1, 2), noise: float = 0.001, errors: Sequence[float] = (-0.02, 0.02)
) -> list[Case]:
    """Run the inverse and the estimator with a wrong eta, the estimator told the strain never or now and then."""
    cases = []
    for error in errors:
        wrong = uniform_eta((1.0 + error) * ETA)
        runs: dict[str, list[Run]] = {}
        for seed in seeds:
            strain = random_legs(SAMPLES, seed)
            output = measure(strain, noise, 100 + seed, uniform_eta())
            runs.setdefault("exact inverse", []).append(run_inverse(wrong, strain, output))
            for every in (0, 5000, 2000):
                how = f"estimator, strain known {SAMPLES // every if every else 0} times"
                runs.setdefault(how, []).append(run_estimator(wrong, strain, output, noise, abs(error), every))
        cases += [
            Case(how=how, history=LONG, noise=noise, eta_error=error, runs=tuple(found)) for how, found in runs.items()
        ]
    return cases


def assess_section_5_5(result: Recovery | None = None) -> list[Figure]:
    """Return the measure of Section 5.5 on the prediction half of the SYNTHETIC Dataset-3; the thesis gives 4 %."""
    result = run_section_5_5() if result is None else result
    figures = []
    for name in result.found:
        what, squares = f"{result.record.name}, Section 5.5, {name}", result.squares(name)
        figures.append(Figure(what=what, unit="% of squares", reached=squares, asked=1.0))
        figures.append(Figure(what=f"{what}, relative RMS", unit="%", reached=10.0 * float(np.sqrt(squares))))
    return figures


def run_section_5_5() -> Recovery:
    """Fit the first two cycles of the SYNTHETIC Dataset-3 and recover the strain of all four."""
    record = specimen_record(3)
    train = record.time < 200.0
    full_scale, noise = float(record.strain.max()), 1.5
    settings = settings_for("preisach", modes=7, relaxations=7)
    fit = fit_preisach((record,), (train,), settings, full_scale=full_scale, rest_output=0.0)
    shift = 10.0  # resistances must be positive
    output = (record.output[1:] - fit.offset) / fit.scale + shift
    h = float(record.time[1] - record.time[0])
    start = {"rest_resistance": shift, "full_scale_resistance_change": 1.0, "full_scale_strain": full_scale}
    exact = drive(compensator_model(fit.artifact), {"resistance": output}, ("strain",), h, **start)[0]
    names = ("strain", "strain_deviation", "delay")
    estimator = compensator_model(fit.artifact, "estimator")
    late, deviation, delay = drive(estimator, {"resistance": output}, names, h, noise=noise / fit.scale, **start)
    lag = round(float(delay[-1]) / h)
    return Recovery(
        record=record,
        fit=fit,
        time=record.time[1:],
        strain=record.strain[1:],
        judged=~train[1:],
        found={"exact inverse": exact, "estimator": late[lag:]},
        deviation=deviation[lag:],
    )


def _figure(what: str, value: float, asked: float | None = None, unit: str = "% of full scale") -> Figure:
    return Figure(what=what, unit=unit, reached=value, asked=asked)


if __name__ == "__main__":
    for part in (assess_noise, assess_wrong_eta, assess_section_5_5):
        for figure in part():
            wanted = "" if figure.asked is None else f"  (asked {figure.asked:g})"
            print(f"{figure.what}: {figure.reached:.3g} {figure.unit}{wanted}", flush=True)
