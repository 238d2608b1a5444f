"""What a compensator recovers from its own perfect model, the identified sensor; and what that gives over many cycles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .fitting.errors import nrmse
from .fitting.records import Record, noise_of
from .replay import predict_resistance, recover_by_fit
from .sensor.fit import PreisachFit
from .sensor.fit.endurance import CYCLES, MOST_RANGE, cycles

EXACT = 3.0  # error without noise [% of range] above which a compensator fails on its own model
STATED = 1.5  # stated deviations above which it does with noise


@dataclass(frozen=True, kw_only=True)
class SelfTest:
    """What is recovered of one record that the sensor's model has made, from rest.

    Attributes
    ----------
    record : str
        Its name.
    clean, noisy : float
        Error without noise, and with the noise of the record [% of range], root mean square.
    stated : float or None
        Error with noise over the deviation that is stated, root mean squares [1]; None where none is.
    model : float or None
        What the sensor's model misses of the record's resistance [% of its range], where the compensator was fitted to the
        record and not to the model; else None.
    """

    record: str
    clean: float
    noisy: float
    stated: float | None
    model: float | None = None

    @property
    def reason(self) -> str:
        """Why the compensator fails on its sensor's own model; empty if it does not."""
        if not self.clean <= EXACT + (self.model or 0.0):
            beyond = "" if self.model is None else f" beyond the {self.model:.2g} % that the model misses"
            return f"More than {EXACT:g} %{beyond} is no error of the sensor, but of the compensator: take another one."
        if self.model is None and self.stated is not None and not self.stated <= STATED:
            return f"More than {STATED:g} stated deviations: it is surer than it may be."
        return ""

    @property
    def sentence(self) -> str:
        """The figures, in words."""
        over = "" if self.stated is None else f", {self.stated:.2g} stated deviations"
        return (
            f"{self.record}: of its own model's resistance the compensator recovers strain to {self.clean:.2g} % of range, "
            f"with the record's noise to {self.noisy:.2g} %{over}."
        )


def self_test(fit: PreisachFit, record: Record, seed: int = 0) -> SelfTest:
    """Drive a sensor by the strain of a record, and recover it with the sensor's compensator.

    Parameters
    ----------
    fit : PreisachFit
        The sensor, with its compensator.
    record : Record
        Its strain is the truth, and its noise is added.
    seed : int
        Of the noise.

    Returns
    -------
    SelfTest
        What ``clean`` exceeds is no error of the sensor's model, but of the compensator alone.
    """
    made = replace(record, resistance=predict_resistance(fit, record))
    noise = noise_of(record.resistance) * np.random.default_rng(seed).standard_normal(record.strain.size)
    noisy = replace(made, resistance=made.resistance + noise)
    clean, with_noise = (recover_by_fit(fit, each) for each in (made, noisy))
    size = float(np.ptp(record.strain))
    stated = None
    if with_noise.deviation is not None:
        error, deviation = with_noise.strain - record.strain, with_noise.deviation
        there = np.isfinite(error) & np.isfinite(deviation)
        stated = float(np.sqrt(np.mean(error[there] ** 2) / np.mean(deviation[there] ** 2)))
    errors = (nrmse(record.strain, found.strain, size) for found in (clean, with_noise))
    direct = fit.artifact.inverse is not None and fit.artifact.compensator in (None, "inverse")
    missed = nrmse(record.resistance, made.resistance, float(np.ptp(record.resistance))) if direct else None
    return SelfTest(record=record.name, **dict(zip(("clean", "noisy"), errors, strict=True)), stated=stated, model=missed)


def cycled_range(fit: PreisachFit, record: Record) -> float:
    """Return the range of a sensor's output over many cycles within the strain of a record, over the record's [1].

    It is 0 for a record at rest.
    """
    size = float(np.ptp(record.resistance))
    if not size * np.ptp(record.strain) > 0.0:
        return 0.0
    time, strain = cycles([record.time], [record.strain])
    repeated = replace(
        record, time=time, strain=strain, resistance=0.0 * strain, lines=np.arange(strain.size), temperature=None
    )
    return float(np.ptp(predict_resistance(fit, repeated))) / size


def cycled_doubt(name: str, size: float) -> str:
    """Say that over many cycles an output leaves what a record shows; empty where its range is at most ``MOST_RANGE``."""
    if size <= MOST_RANGE:
        return ""
    return (
        f"{name}: over {CYCLES} cycles within its strain the sensor's output covers {size:.2g} times the record's range: "
        "what it remembers adds up beyond what training shows. Train on more cycles, without rests between them."
    )
