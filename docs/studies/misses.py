"""Missed targets: listed from the metrics, explained by hand."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .metrics import Metric, number

LIMITS = (  # pattern of a metric, and why it misses its target; the first match counts
    (
        r"velocity_profile.*defaults",
        "The training stretch holds two and a half cycles, the test two faster ones. Which ridge extrapolates to faster "
        "strain cannot be seen within training; a smaller ridge predicts the output better than the one that is chosen.",
    ),
    (
        r"random_sawtooth.*defaults",
        "The noise of the meter is 1.2 to 1.7 % of the range, and no forward model predicts the relaxation after peaks "
        "better than this; no residual network does either.",
    ),
    (r"defaults", "The sensor drifts on in the test stretch, farther than training shows."),
    (
        r"Dataset-2.*sub-model",
        "The sub-models of model-2 are linear in strain, and the specimen is not. We assume that the strain in "
        "Dataset-2 is twice as large in the same time. Under this assumption, even a causal linear model that is "
        "perfect on Dataset-1 has the error stated below Tables 3.1 and 3.2. Phases change that error only as far as "
        "the records differ in length.",
    ),
    (
        r"sub-model",
        "The sub-models of model-2 are linear in strain, and the specimen is not. Most of their error is already there "
        "in the fitted stretch, from any start and with coefficients of any sign. The square of strain as one more "
        "term removes nearly all of it, see below Tables 3.1 and 3.2.",
    ),
    (
        r"Dataset-2",
        "In Dataset-2 the strain is twice as large and twice as fast as in the fitted stretch. Three quarters of its "
        "Preisach plane, and every nonlinearity beyond 7.5 %, are extrapolation, and more modes do not help. Fitted to "
        "both data sets at once, modal densities reach 2.4 / 1.8 %, and model-1 the error stated below Tables 3.1 and "
        "3.2.",
    ),
    (
        r"Dataset-1",
        "From 200 s to 400 s the specimen rests: relaxation slower than the fitted 200 s is extrapolation. The error "
        "that the noise alone leaves is stated below Tables 3.1 and 3.2.",
    ),
    (
        r"faster than",
        "The iterations take a third to a half of the time of the fit, and they are more than 30 times faster than those of "
        "least_squares. In the rest, the fit builds the model and its derivatives and computes sums of "
        "exponentials for the artifact; the time of least_squares includes none of this. Faster expressions, built for "
        "this comparison, made least_squares faster too. From starts that differ by rounding, its time differs by a "
        "factor of five; the median counts.",
    ),
    (
        r"random_sawtooth",
        "The noise of the meter is 1.2 to 1.7 % of the range. The residual is biased for many seconds after peaks, and "
        "more in the predicted part. More kernels or knots, a gain, drives with powers of the strain rate from 0.25 to "
        "2, and amplitudes of either sign fit better and predict worse, or change nothing.",
    ),
    (
        r"eta wrong",
        "If η is 2 % wrong and no strain is ever known, the resistance alone does not distinguish the true strain from "
        "another one within the range. A known strain now and then removes the error.",
    ),
)
UNKNOWN = "The cause is not known."


def section(metrics: Iterable[Metric]) -> list[str]:
    """Return the list of misses, grouped by what limits them."""
    groups: dict[str, list[Metric]] = {}
    for metric in metrics:
        if metric.met is False:
            groups.setdefault(limit_of(metric), []).append(metric)
    lines = ["", "## Missed targets, and what limits them", ""]
    if not groups:
        return [*lines, "Nothing."]
    for text, missed in sorted(groups.items(), key=lambda group: group[0] == UNKNOWN):
        values = "; ".join(f"{m.what}: {number(m.value)}, target {m.target:g} {m.unit}" for m in missed)
        lines.append(f"- **{text}** {values}.")
    return lines


def limit_of(metric: Metric) -> str:
    """Return what limits a metric."""
    for pattern, text in LIMITS:
        if re.search(pattern, metric.what):
            return text
    return UNKNOWN
