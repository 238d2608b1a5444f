"""Statistics of the assessment: probability of detection, shares, thresholds."""

import math

import numpy as np
import pytest
from gossamer_models import DataError
from gossamer_models.assessment import fit_pod, share, size_by_counts, threshold_for
from gossamer_models.assessment.pod import CRITICAL
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import detection

# Joint temperature [degrees F] and distress of an O-ring in 23 flights: S. R. Dalal, E. B. Fowlkes, B. Hoadley, Journal of
# the American Statistical Association 84(408), 945-957, 1989, doi:10.1080/01621459.1989.10478858.
TEMPERATURE = [66, 70, 69, 68, 67, 72, 73, 70, 57, 63, 70, 78, 67, 53, 67, 75, 70, 81, 76, 79, 75, 76, 58]
DISTRESS = [0, 1, 0, 0, 0, 0, 0, 0, 1, 1, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 1]


def draw(n, slope, random, a90=0.1):
    """Hits and misses at n sizes from 0.5 to 50 %, detected with probability 0.9 at a90."""
    x = math.log(0.005) + math.log(100.0) * (np.arange(n) + random.random()) / n
    p = 1.0 / (1.0 + np.exp(-(math.log(9.0) + slope * (x - math.log(a90)))))
    return np.exp(x), random.random(n) < p


def test_published_logistic_regression_is_reproduced():
    """A. Agresti, An Introduction to Categorical Data Analysis: logit 15.0429 - 0.2322 T, deviance 20.315."""
    cold = 100.0 - np.array(TEMPERATURE)
    pod = fit_pod(cold, DISTRESS, "linear")
    assert pod.slope == pytest.approx(0.2322, abs=5e-5)
    assert pod.intercept + 100.0 * pod.slope == pytest.approx(15.0429, abs=5e-5)
    assert -2.0 * pod.log_likelihood == pytest.approx(20.315, abs=5e-4)


@pytest.mark.parametrize("seed", range(4))
def test_curve_and_bounds_are_those_of_a_general_optimiser(seed):
    size, hit = draw(60, 3.0, np.random.default_rng(seed))
    pod = fit_pod(size, hit)
    b0, b1, best = detection.fit(np.log(size), hit)
    assert (pod.intercept, pod.slope, pod.log_likelihood) == pytest.approx((b0, b1, best), rel=1e-4)
    assert pod.a90 == pytest.approx(math.exp((math.log(9.0) - b0) / b1), rel=1e-4)
    *_, best = detection.fit(np.log(size), hit, detection.penalised)
    at_bound = detection.largest_at(np.log(size), hit, math.log(pod.a90_95), math.log(9.0))
    assert 2.0 * (best - at_bound) == pytest.approx(CRITICAL, rel=1e-6)
    for a, low in zip((0.03, 0.1), pod.lower_bound([0.03, 0.1]), strict=True):
        at_bound = detection.largest_at(np.log(size), hit, math.log(a), math.log(low / (1.0 - low)))
        assert 2.0 * (best - at_bound) == pytest.approx(CRITICAL, rel=1e-6)
        assert low < pod.probability(a)


def test_the_lower_bound_reaches_90_percent_at_a90_95():
    pod = fit_pod(*draw(80, 4.0, np.random.default_rng(5)))
    assert pod.lower_bound(pod.a90_95) == pytest.approx([0.9], abs=1e-6)
    assert pod.probability([pod.a50, pod.a90]) == pytest.approx([0.5, 0.9], abs=1e-9)


@pytest.mark.parametrize("slope", [3.0, 15.0])  # with 15, hits and misses overlap in 4 of 10 samples
def test_a90_95_covers_the_true_a90_in_95_percent_of_repeats(slope):
    random = np.random.default_rng(1)
    covered = sum(fit_pod(*draw(60, slope, random)).a90_95 >= 0.1 for _ in range(120))
    assert covered >= 120 * 0.95 - 2.0 * math.sqrt(120 * 0.95 * 0.05)  # less would be chance in one of 40


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.01, 100.0))
def test_the_unit_of_size_does_not_matter(seed, unit):
    size, hit = draw(40, 3.0, np.random.default_rng(seed))
    one, other = fit_pod(size, hit), fit_pod(unit * size, hit)
    assert other.a90_95 == pytest.approx(unit * one.a90_95, rel=1e-5)
    assert other.remark == one.remark


def test_separated_data_have_no_curve_but_a_bound_above_their_misses():
    size = np.geomspace(0.01, 0.5, 40)
    for misses in (6, 10, 30):
        hit = np.arange(40) >= misses
        pod = fit_pod(size, hit)
        assert pod.remark == "all hits are larger than all misses"
        assert math.isnan(pod.a90)
        assert math.isnan(pod.slope)
        assert size[misses] < pod.a90_95 < size[min(misses + 10, 39)]
        assert pod.by_counts == (size[misses] if misses < 12 else math.inf)  # 29 of 29
        assert (np.diff(pod.lower_bound(np.geomspace(0.011, 0.5, 9))) >= 0.0).all()
        best = detection.fit(np.log(size), hit, detection.penalised)[-1]
        at_bound = detection.largest_at(np.log(size), hit, math.log(pod.a90_95), math.log(9.0))
        assert 2.0 * (best - at_bound) == pytest.approx(CRITICAL, rel=1e-6)


def test_what_is_never_or_always_hit_is_said():
    size = np.geomspace(0.01, 0.5, 40)
    never, always = fit_pod(size, np.zeros(40, dtype=bool)), fit_pod(size, np.ones(40, dtype=bool))
    assert (never.remark, always.remark) == ("nothing was hit", "every size was hit")
    assert math.isinf(never.a90_95)
    assert size[0] <= always.a90_95 < size[14]
    assert never.lower_bound([0.1]) == [0.0]
    assert math.isinf(fit_pod([0.1], [True]).a90_95)


def test_detection_that_does_not_rise_with_size_has_no_bound():
    size = np.geomspace(0.01, 0.5, 60)
    assert math.isinf(fit_pod(size, np.arange(60) % 2 == 0).a90_95)
    falling = fit_pod(size, (size < 0.1) ^ (np.arange(60) % 7 == 0))
    assert falling.remark == "detection does not rise with size"
    assert math.isinf(falling.a90_95)


@pytest.mark.parametrize(
    ("hits", "of", "shown"), [(28, 28, False), (29, 29, True), (44, 45, False), (45, 46, True), (59, 61, True)]
)
def test_29_of_29_show_90_percent_and_28_of_28_do_not(hits, of, shown):
    """0.9^29 = 0.047 and 0.9^28 = 0.052; with one miss 46, with two 61: binomial tables."""
    hit = np.arange(of) >= of - hits  # misses are small
    assert math.isfinite(size_by_counts(np.full(of, 0.1), hit)) == shown


@pytest.mark.parametrize("sizes", [[], [0.1, math.nan], [0.0, 0.1]])
def test_sizes_that_make_no_sense_are_refused(sizes):
    with pytest.raises(DataError):
        fit_pod(sizes, np.zeros(len(sizes), dtype=bool))


def test_shares_have_the_intervals_of_clopper_and_pearson():
    """Closed forms at the ends: the upper bound of 0 of n is 1 - 0.025^(1/n)."""
    none, all_ = share(np.zeros(20, dtype=bool)), share(np.ones(20, dtype=bool))
    assert (none.low, none.high) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 20)))
    assert (all_.low, all_.high) == pytest.approx((0.025 ** (1 / 20), 1.0))
    assert math.isnan(share([]).value)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=300), st.sampled_from([0.0, 0.01, 0.1]))
def test_a_threshold_lets_no_more_be_called_and_no_smaller_one_does(largest, allowed):
    threshold = threshold_for(largest, allowed)
    assert sum(a > threshold for a in largest) <= allowed * len(largest)
    smaller = [a for a in largest if a < threshold]
    if smaller:
        assert sum(a > max(smaller) for a in largest) > allowed * len(largest)
