"""Long records are thinned and hysteresis does not see it; measures of error, and of how well data determine parameters."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from gossamer_models.fitting import Record, covariance, e1, nrmse
from gossamer_models.fitting.records import thin
from gossamer_models.identify import identify_files, settings_for
from gossamer_models.sensor.fit.regression import switched
from hypothesis import given
from hypothesis import strategies as st


def sweep(turns, samples):
    """A record that goes straight from one strain to the next in so many samples each."""
    knots = np.arange(len(turns)) * samples
    strain = np.interp(np.arange(knots[-1] + 1), knots, turns)
    time = 0.01 * np.arange(strain.size)
    return Record(name="r", time=time, strain=strain, resistance=strain, lines=np.arange(strain.size) + 2)


turns = st.lists(st.floats(0.0, 1.0, allow_subnormal=False), min_size=3, max_size=8)


@given(turns=turns, samples=st.integers(25, 60))
def test_plays_of_every_width_end_where_they_end_with_all_samples(turns, samples):
    """Turning points at least k samples apart: every play is the same at every sample that is kept."""
    record = sweep(turns, samples)
    (thinned,) = thin([record], most=record.time.size // 10)
    assert thinned.time.size <= record.time.size // 10 + 2
    kept = thinned.lines - 2
    whole, few = (up - down for up, down in (switched(record.strain, 8), switched(thinned.strain, 8)))
    assert few == pytest.approx(whole[kept], abs=1e-12)


def test_records_with_few_samples_stay_and_first_and_last_sample_are_kept():
    records = (sweep([0.0, 1.0, 0.5], 50), sweep([0.2, 0.8], 30))
    assert thin(records) == records
    for before, after in zip(records, thin(records, most=20), strict=True):
        assert (after.time[0], after.time[-1]) == (before.time[0], before.time[-1])
        assert np.ptp(after.strain) == np.ptp(before.strain)
        assert "of every 14 successive ones those with the smallest and the largest strain" in after.repairs[-1]


def test_identification_says_the_rule_before_it_starts_and_in_the_artifact(tmp_path, caplog, monkeypatch):
    monkeypatch.setattr("gossamer_models.identify.thin", lambda records: thin(records, 500))
    time = np.linspace(0.0, 60.0, 3000)
    strain = 0.04 * (1.0 - np.cos(0.5 * time))
    rows = zip(time, strain, 100.0 + 400.0 * strain + 0.01 * time, strict=True)
    path = tmp_path / "long.csv"
    path.write_text("time_s,strain [1],R_ohm\n" + "".join(f"{t},{s},{r}\n" for t, s, r in rows))
    said = []
    with caplog.at_level(logging.WARNING, "gossamer_models.identify"):
        result = identify_files(
            [path],
            settings=settings_for("preisach", modes=1, relaxations=0, starts=1),
            progress=lambda _: said.append(caplog.text),
        )
    rule = "of 3000 samples are fitted, because the records have 3000 together, more than 500"
    assert len(said) > 1
    assert all(rule in text for text in said[1:])  # the first one says that it reads
    assert rule in result.fit.artifact.provenance["repairs of long.csv"]
    assert sum(each.samples for each in result.errors) <= 502


def test_e1_is_relative_to_the_change_from_rest():
    measured, predicted = np.array([100.0, 110.0, 120.0]), np.array([100.0, 111.0, 118.0])
    assert e1(measured, predicted, rest=100.0) == pytest.approx(100.0 * 3.0 / 30.0)
    assert e1(measured - 100.0, predicted - 100.0, rest=0.0) == e1(measured, predicted, rest=100.0)


def test_nrmse_is_relative_to_the_range():
    measured, predicted = np.array([1.0, 3.0, 5.0]), np.array([1.0, 3.0, 5.3])
    assert nrmse(measured, predicted) == pytest.approx(100.0 * 0.3 / np.sqrt(3.0) / 4.0)
    assert nrmse(measured, predicted, 8.0) == pytest.approx(nrmse(measured, predicted) / 2.0)


def test_a_stretch_that_is_empty_or_never_leaves_rest_has_no_error():
    empty, still = np.empty(0), np.full(3, 7.0)
    assert np.isnan([e1(empty, empty, rest=0.0), nrmse(empty, empty), e1(still, still, rest=7.0)]).all()


def test_two_columns_alike_share_what_the_data_say_of_them():
    """Resolution by squares of the singular values would be of the order of 1e8."""
    rng = np.random.default_rng(0)
    data = rng.normal(size=(30, 3))[:, [0, 1, 1, 2]]
    _, resolution = covariance(data, np.empty((0, 4)), 1.0)
    assert np.diag(resolution) == pytest.approx([1.0, 0.5, 0.5, 1.0], abs=1e-3)


def test_resolution_is_the_share_of_the_information_that_the_data_give():
    rng = np.random.default_rng(1)
    data, preferred = rng.normal(size=(20, 3)), np.diag([0.1, 1.0, 10.0])
    C, resolution = covariance(data, preferred, 2.0)
    information = data.T @ data
    assert np.linalg.inv(information + preferred**2) * 2.0 == pytest.approx(C)
    assert C @ information / 2.0 == pytest.approx(resolution)
