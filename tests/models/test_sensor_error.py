"""Errors of sensors: features that hold what a sensor off its model adds, and scales that the record tells."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models.errors import ParameterError
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin
from gossamer_models.twin.discrepancy import SPACING, Discrepancy
from gossamer_models.twin.sensor_error import GROUPS, MISSED, SensorError, mean_square_scales
from gossamer_models.twin.simulation import SensedForward, SensorBank

STEP, STEPS = 1e-3, 400
REST = 0.02
DAMAGE = np.where(np.arange(16) == 5, 0.3, 0.0) + np.where(np.arange(16) == 10, 0.15, 0.0)


@pytest.fixture(scope="module")
def sensed():
    """Strain of two sensors, their bank, and what they read."""
    t = STEP * np.arange(1, STEPS + 1)
    strain = REST + np.array([0.1, 0.2])[:, None] * (1.0 - np.cos(20.0 * t)) * (1.0 + 0.4 * np.sin(90.0 * t)) / 2.0
    bank = SensorBank(default_artifact(), 2, REST)
    return strain, bank, bank.read(strain[None], STEP)[0][0]


def weighed_alone(record, noise):
    seen = np.isfinite(record)
    return {k: lambda y, k=k: y[:, k, seen[k]] / noise[k] for k in range(len(record))}


def test_other_tables_add_what_their_features_say(sensed):
    """The resistance is linear in the tables, so that the features of a field on them hold all of its change."""
    strain, bank, read = sensed
    place = np.arange(len(bank.artifact.mu)) / len(bank.artifact.mu)
    factor = 1.05 + 0.1 * np.abs(place[:, None] - 0.5)  # of lines; a field of the features up to a bin's half
    tables = [tuple(map(tuple, factor * table)) for table in bank.artifact.tables()]
    other = SensorBank(replace(bank.artifact, mu=tables[0], nu=tables[1], scales=None), 2, REST, bank.parameters)
    change = other.read(strain[None], STEP)[0][0] - read
    error = SensorError.along(bank, strain, read, STEP)
    features = error.features[error.group == list(GROUPS).index("tables")]
    for k in range(2):
        left = change[k] - features[:, k].T @ np.linalg.lstsq(features[:, k].T, change[k], rcond=None)[0]
        assert np.abs(left).max() < 2e-3 * np.abs(change[k]).max()
        assert np.abs(change[k]).max() > 0.02 * np.ptp(read[k])


def test_scales_are_those_that_errors_were_drawn_with():
    random = np.random.default_rng(3)
    group = np.repeat(np.arange(len(GROUPS)), 60)
    F = random.standard_normal((len(group), 900))
    true = np.full(len(GROUPS), 1e-4)
    true[[1, 3]] = [0.2, 0.05]
    r = (true[group] * random.standard_normal(len(group))) @ F + random.standard_normal(900)
    prior = MISSED * np.array(list(GROUPS.values()))
    found = mean_square_scales(F, r, group, prior, prior)
    np.testing.assert_allclose(found[[1, 3]], true[[1, 3]], rtol=0.3)
    assert np.delete(found, [1, 3]).max() < 0.02


def test_a_sensor_that_keeps_to_its_model_has_small_scales_and_one_that_does_not_large_ones(sensed):
    strain, bank, read = sensed
    noise = 1e-3 * np.ptp(read, axis=1)
    record = read + noise[:, None] * np.random.default_rng(0).standard_normal(read.shape)
    record[1] += 0.03 * np.ptp(read[1]) * np.tanh(3.0 * (read[1] - read[1].mean()) / np.ptp(read[1]))
    record[1, 100:120] = np.nan
    told = SensorError.along(bank, strain, read, STEP).told(record, weighed_alone(record, noise))
    moves = told.components[told.group != list(GROUPS).index("offset")]  # one number does not tell the scale of offsets
    spread = np.sqrt((moves**2).sum(axis=0).mean(axis=1)) / np.ptp(read, axis=1)
    assert spread[0] < 2e-3
    assert 0.01 < spread[1] < 0.3


def test_what_sensors_of_one_kind_share_is_no_more_than_what_each_is_off(sensed):
    strain, bank, read = sensed
    error = SensorError.along(bank, strain, read, STEP)
    whole, shared, own = (each[:, :, ::40] for each in (error.components, error.shared, error.own))
    for k in range(2):
        both = shared[:, k].T @ shared[:, k] + own[:, k].T @ own[:, k]
        np.testing.assert_allclose(both, whole[:, k].T @ whole[:, k], rtol=1e-9, atol=1e-12 * np.abs(both).max())
    tables = whole[error.group == list(GROUPS).index("tables")]
    drift = whole[error.group == list(GROUPS).index("drift")]
    rest = whole[error.group == list(GROUPS).index("rest")]
    alone = [(each[:, 0] * each[:, 1]).sum() for each in (drift, rest)]
    assert np.abs(alone).min() > 0.0  # they would be alike, if anything shared them
    assert len(shared) == len(whole) - len(drift) - len(rest) - 1  # the offset
    np.testing.assert_allclose(shared[-len(tables) :], np.sqrt(0.5) * tables)


@pytest.fixture(scope="module")
def square():
    """The square on a small mesh, what its strain is with two damaged zones, and what its sensors read."""
    pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")
    sensed = SensedForward(MembraneForward(square_structure(4, 1)), default_artifact())
    strain = sensed.forward.strain(DAMAGE[None], {}, {}, 600, 3e-4)
    return sensed, strain, sensed.resistance(strain, 3e-4)[0]


def test_damage_is_found_with_sensors_off_their_model_and_how_far_is_answered(square):
    """The tables of two sensors are up to a third off; the twin knows neither which nor how far."""
    sensed, strain, exact = square
    place = np.arange(len(sensed.bank.artifact.mu)) / len(sensed.bank.artifact.mu)
    factor = 1.0 + 0.3 * np.cos(3.0 * place[:, None]) * np.cos(4.0 * place)
    up, down = (tuple(map(tuple, (factor * table).tolist())) for table in sensed.bank.artifact.tables())
    other = replace(sensed.bank.artifact, mu=up, nu=down, scales=None)
    values = SensorBank(other, 4, 0.0, sensed.bank.parameters).read(strain, 3e-4)[0][0]
    values[2:] = exact[2:]
    off = (values - exact).std(axis=1) / np.ptp(exact, axis=1)
    assert off[:2].min() > 0.01
    noise = 1e-3 * np.ptp(exact, axis=1)
    values = values + noise[:, None] * np.random.default_rng(2).standard_normal(exact.shape)
    twin = Twin(square_structure(4, 1), sensor=default_artifact())
    answer = twin.fit(ResponseRecord(step=3e-4, values=values, kind="resistance", noise=noise))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, DAMAGE, atol=5e-3)
    assert answer.deviation.max() < 0.02
    np.testing.assert_allclose(answer.sensor_errors[:2], off[:2], rtol=0.2)
    assert max(answer.sensor_errors[2:]) < 2e-3


def test_a_full_scale_that_all_sensors_have_otherwise_is_no_damage(square):
    """All sensors read 5 % less strain than their model says: much as a membrane does that is stiffer everywhere."""
    sensed, strain, exact = square
    stretched = sensed.bank.parameters | {"full_scale_strain": 1.05 * sensed.bank.parameters["full_scale_strain"]}
    values = SensorBank(default_artifact(), 4, 0.0, stretched).read(strain, 3e-4)[0][0]
    noise = 1e-3 * np.ptp(exact, axis=1)
    values = values + noise[:, None] * np.random.default_rng(4).standard_normal(exact.shape)
    twin = Twin(square_structure(4, 1), sensor=default_artifact())
    answer = twin.fit(ResponseRecord(step=3e-4, values=values, kind="resistance", noise=noise))
    np.testing.assert_allclose(answer.damage, DAMAGE, atol=5e-3)
    assert min(answer.sensor_errors) > 0.01


def test_a_sensor_whose_model_is_known_has_an_offset_and_a_gain_alone(square):
    sensed, _, exact = square
    twin = Twin(square_structure(4, 1), sensor=default_artifact(), known=["sensor"])
    noise = 1e-3 * np.ptp(exact, axis=1)
    values = exact + 0.1 * sensed.bank.parameters["full_scale_resistance_change"][:, None] * np.eye(4)[:, :1]
    answer = twin.fit(ResponseRecord(step=3e-4, values=values, kind="resistance", noise=noise))
    assert not answer.sensor_errors
    assert answer.nuisances["offset[1]"][0] == pytest.approx(0.1, abs=2e-3)
    np.testing.assert_allclose(answer.damage, DAMAGE, atol=5e-3)


def test_no_answer_is_valid_where_a_sensor_is_far_off_its_model(square):
    _, _, exact = square
    noise = 1e-3 * np.ptp(exact, axis=1)
    values = exact + noise[:, None] * np.random.default_rng(2).standard_normal(exact.shape)
    values[0] += exact[0] - exact[0, 0]
    twin = Twin(square_structure(4, 1), sensor=default_artifact())
    answer = twin.fit(ResponseRecord(step=3e-4, values=values[:, :400], kind="resistance", noise=noise))
    assert not answer.valid
    assert answer.sensor_errors[0] > 0.2
    assert any("sensor 1 is" in doubt for doubt in answer.doubts)


def test_where_the_error_of_the_mesh_was_learned_behind_sensors_they_have_to_keep_to_their_model(square, monkeypatch):
    """A mesh without an error; all sensors are some percent of their range off, so that none contradicts the others."""
    _, _, exact = square
    monkeypatch.setattr(Discrepancy, "behind", lambda self, *_: replace(self, kind="resistance"))
    length, n = 20 * SPACING, 222
    learned = Discrepancy(elements_per_side=4, order=1, length=length, components=np.zeros((1, 4, 23)), provenance={})
    values = exact[:, :n] + 1e-3 * np.ptp(exact) * np.random.default_rng(2).standard_normal((4, n))
    span = np.ptp(values, axis=1, keepdims=True)
    values += 0.1 * span * np.tanh(6.0 * (values - values.mean(axis=1, keepdims=True)) / span)
    twin = Twin(square_structure(4, 1), sensor=default_artifact(), discrepancy=learned)
    answer = twin.fit(ResponseRecord(step=3e-4, values=values, kind="resistance", noise=1e-3 * np.ptp(exact)))
    assert max(answer.sensor_errors) > 0.01
    assert not answer.valid
    assert any("the mesh's error is known behind sensors that are 0.5 % off at most" in doubt for doubt in answer.doubts)


def test_sensors_of_strain_have_no_error_of_their_own(square):
    _, strain, _ = square
    answer = Twin(square_structure(4, 1)).fit(ResponseRecord(step=3e-4, values=strain[0], noise=1e-3))
    assert not answer.sensor_errors
    assert "gain[1]" in answer.nuisances
    with pytest.raises(ParameterError, match="'sensor' is fitted to records of resistance"):
        Twin(square_structure(4, 1), nuisances=["sensor"]).fit(ResponseRecord(step=3e-4, values=strain[0]))
