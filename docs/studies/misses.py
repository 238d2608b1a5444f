"""Targets that were not reached: listed from the metrics, explained by hand."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .metrics import Metric, number

LIMITS = (  # pattern of a metric, and why it misses its target; the first that matches counts
    (
        r"Dataset-2.*sub-model",
        "The sub-models of model-2 are linear in strain and the specimen is not. That Dataset-2 strains it twice as far in "
        "the same time is an assumption of this project; under it, a causal linear model that is perfect on Dataset-1 "
        "misses by what stands below Tables 3.1 and 3.2, and phases change that only as far as the records differ in "
        "length.",
    ),
    (
        r"sub-model",
        "The sub-models of model-2 are linear in strain and the specimen is not: most of what they miss, they miss where "
        "they are fitted, from any start and with coefficients of any sign. The square of strain as one more term takes "
        "nearly all of that away, see below Tables 3.1 and 3.2.",
    ),
    (
        r"Dataset-2",
        "Dataset-2 strains the specimen twice as far, and twice as fast, as the stretch that is fitted: of its "
        "Preisach plane three quarters, and every nonlinearity beyond 7.5 %, are extrapolation, and more modes do not "
        "know more about it. Fitted to both data sets at once, modal densities come to 2.4 / 1.8 % and model-1 to what "
        "its floor above says.",
    ),
    (
        r"Dataset-1",
        "From 200 s to 400 s the specimen rests: relaxation slower than the fitted 200 s is extrapolation. The floor "
        "of the noise stands below Tables 3.1 and 3.2.",
    ),
    (
        r"faster than",
        "Half of the fit's time are its iterations, which are more than 30 times faster than the peer's; the rest "
        "builds model and derivatives and makes sums of exponentials for the artifact, which the peer is spared. Faster "
        "expressions, built for this, made the peer faster too. From starts that differ by rounding the peer's time "
        "differs by five; the median counts.",
    ),
    (
        r"random_sawtooth",
        "Noise of the meter is 1.2 to 1.7 % of the range. What remains is biased for many seconds after peaks, and more in "
        "the predicted part; more kernels or knots, a gain, drives with powers of the strain rate from 0.25 to 2, and "
        "amplitudes of either sign were tried: they fit better and predict worse, or change nothing.",
    ),
    (
        r"eta wrong",
        "With η 2 % wrong and no strain ever known, resistance alone does not tell the truth from another strain "
        "within range. Telling the strain now and then removes it.",
    ),
)
UNKNOWN = "What limits these is not established."


def section(metrics: Iterable[Metric]) -> list[str]:
    """Return the list of misses, grouped by what limits them."""
    groups: dict[str, list[Metric]] = {}
    for metric in metrics:
        if metric.met is False:
            groups.setdefault(limit_of(metric), []).append(metric)
    lines = ["", "## Asked but not reached, and what limits it", ""]
    if not groups:
        return [*lines, "Nothing."]
    for text, missed in sorted(groups.items(), key=lambda group: group[0] == UNKNOWN):
        values = "; ".join(f"{m.what}: {number(m.value)} for {m.target:g} {m.unit}" for m in missed)
        lines.append(f"- **{text}** {values}.")
    return lines


def limit_of(metric: Metric) -> str:
    """Return what limits a metric."""
    for pattern, text in LIMITS:
        if re.search(pattern, metric.what):
            return text
    return UNKNOWN
