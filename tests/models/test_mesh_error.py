"""The error of a twin's mesh: stated, part of the deviations, and the end of valid answers where it hides damages."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.membrane import Region, Sensor, Setup, Support, Zone, make_structure, square_structure, surface_mesh
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import MembraneForward, MeshErrors, ResponseRecord, StaticRecord, Twin, discrepancy, mesh_error
from gossamer_models.twin.simulation import SensorBank
from oracles.meshes import meshed, rectangle

FILM = Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=1e-3, prestress=(5e4, 5e4, 0.0))
EDGES = {"rim": lambda x, y, z: (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > 1.0 - 1e-9)}
PLACES = [(0.2, 0.3), (0.4, 0.2), (0.7, 0.35), (0.8, 0.7), (0.3, 0.75), (0.55, 0.6), (0.2, 0.55), (0.6, 0.8)]
PRESSURE = np.array([0.0, 50.0, 100.0, 200.0, 300.0, 400.0])


def film(order):
    sensors = tuple(
        Sensor(point=(x, y, 0.0), direction=(1.0, float(k % 2), 0.0), gauge_length=0.05) for k, (x, y) in enumerate(PLACES)
    )
    setup = Setup(
        regions=(FILM,), supports=(Support(group="rim"),), zones=(Zone(grid=(2, 2)),), sensors=sensors, order=order
    )
    return make_structure(setup, surface_mesh(meshed([rectangle(1.0, 1.0)], 6 if order == 1 else 4, edges=EDGES), order))


def record(structure, damage, noise, seed=0):
    """Ten readings of each load state of a membrane."""
    states = np.repeat(np.arange(PRESSURE.size), 10)
    strain = MembraneForward(structure).states(damage[None], {}, {"pressure": PRESSURE})[0][:, states]
    values = strain + noise * np.random.default_rng(seed).standard_normal(strain.shape)
    return StaticRecord(
        step=1.0, values=values, noise=noise, inputs={"pressure": PRESSURE}, state=states, names=tuple("abcdef")
    )


@pytest.fixture(scope="module")
def coarse():
    return film(1)


@pytest.fixture(scope="module")
def truth():
    """The same film on elements of order 4, which no error was learned from."""
    return film(4)


@pytest.fixture(scope="module")
def errors(coarse):
    return MeshErrors(coarse)


def test_the_share_is_what_finer_meshes_change(coarse, errors):
    found = errors.of(record(coarse, np.zeros(4), 1e-5))
    still = coarse.finer().finer()
    one, two = (MembraneForward(each).states(np.zeros((1, 4)), {}, {"pressure": PRESSURE})[0] for each in (coarse, still))
    moving = [y - y.mean(axis=1, keepdims=True) for y in (one, two - one)]
    assert found.share == pytest.approx(np.sqrt(np.mean(moving[1] ** 2) / np.mean(moving[0] ** 2)), rel=1e-3)
    assert 0.15 < found.left < 0.6  # bilinear strain converges with the first to second power of the size


def test_one_load_state_has_an_error_of_its_mesh_too(coarse, errors):
    whole = record(coarse, np.zeros(4), 1e-5)
    last = whole.state == 5
    state, load = np.zeros(last.sum(), dtype=int), {"pressure": PRESSURE[5:]}
    one = replace(whole, values=whole.values[:, last], state=state, names=("f",), inputs=load)
    found = errors.of(one)
    assert 0.3 < found.share / errors.of(whole).share < 3.0
    assert found.buries


def test_stated_deviations_hold_on_a_mesh_that_they_were_not_learned_from(coarse, truth, errors):
    z = []
    for k in range(4):
        damage = np.where(np.arange(4) == k, 0.3, 0.0)
        made = record(truth, damage, 2e-5, seed=k)
        answer = Twin(coarse, mesh_error=errors, sparse=False).fit(made)
        z.append((answer.damage - damage)[answer.damage > 0.0] / answer.deviation[answer.damage > 0.0])
        assert errors.of(made).blur > 10.0  # by noise alone deviations would be a tenth
    assert np.sqrt(np.mean(np.concatenate(z) ** 2)) < 1.5


def test_a_finer_mesh_at_the_fit_takes_most_of_the_error_away_unless_that_errs_too(coarse, truth, errors, monkeypatch):
    """The truth has elements of order 4, which neither the error nor the finer mesh knows."""
    damage = np.array([0.0, 0.3, 0.0, 0.0])
    made = record(truth, damage, 3e-4)
    assert errors.of(made).buries
    with monkeypatch.context() as patch:  # before it is kept
        patch.setattr(mesh_error.MeshError, "of_finer", None)
        far = Twin(coarse, mesh_error=errors).fit(made)
    near = Twin(coarse, mesh_error=errors).fit(made)
    assert (near.valid, far.valid) == (True, False)
    assert abs(near.damage[1] - 0.3) < min(2.0 * near.deviation[1], 0.5 * abs(far.damage[1] - 0.3))
    assert near.deviation.max() < 0.5 * far.deviation.max()
    precise = Twin(coarse, mesh_error=errors).fit(record(truth, damage, 2e-5))
    assert not precise.valid
    assert "times as uncertain as the noise alone, so no answer is valid" in precise.doubts[-1]
    assert "Write refine = 1 in the setup" in precise.doubts[-1]
    noisy = Twin(coarse, mesh_error=errors).fit(record(truth, damage, 5e-3))
    assert noisy.valid
    assert noisy.damage[1] == pytest.approx(0.3, abs=3.0 * noisy.deviation[1])


def test_a_healthy_record_leaves_of_the_error_what_damage_changes(coarse, truth, errors, monkeypatch):
    """The truth has elements of order 4: less its healthy record, deviations are smaller, and hold; no finer mesh helps."""
    monkeypatch.setattr(mesh_error.MeshError, "of_finer", None)
    healthy, z, before, after = record(truth, np.zeros(4), 2e-4, seed=9), [], [], []
    for k in range(4):
        damage = np.where(np.arange(4) == k, 0.3, 0.0)
        made = record(truth, damage, 2e-4, seed=k)
        known = {"mesh_error": errors, "sparse": False, "known": ["amplitude"]}
        alone, less = (Twin(coarse, healthy=each, **known).fit(made) for each in (None, healthy))
        z.append((less.damage - damage) / less.deviation)
        before.append(alone.deviation.max())
        after.append(less.deviation.max())
        assert not (less.valid and np.any(np.abs(less.damage - damage) > np.maximum(0.05, 3.0 * less.deviation)))
    assert max(after) < min(before)
    assert np.sqrt(np.mean(np.square(z))) < 1.5


def test_a_healthy_record_needs_the_error_of_the_mesh_and_the_same_test(coarse, errors):
    healthy = record(coarse, np.zeros(4), 1e-4)
    with pytest.raises(ParameterError, match=r"only where the error of the mesh is known.* mesh_error="):
        Twin(coarse, healthy=healthy)
    for other, message in (
        (replace(healthy, names=tuple("ghijkl")), "other load states"),
        (replace(healthy, inputs={"pressure": 1.1 * PRESSURE}), "another load 'pressure'"),
        (healthy.without([0]).ordered([0, 1, 2]), "other sensors"),
    ):
        with pytest.raises(DataError, match=message):
            Twin(coarse, mesh_error=errors, healthy=other).fit(record(coarse, np.zeros(4), 1e-4))


def test_a_mesh_that_has_converged_raises_no_doubt(truth):
    errors = MeshErrors(truth)
    assert errors.doubts(errors.of(record(truth, np.zeros(4), 1e-5))) == []


def test_what_was_simulated_is_kept(coarse, errors, monkeypatch):
    made = record(coarse, np.zeros(4), 1e-5)
    first = errors.of(made).components
    monkeypatch.setattr(mesh_error, "MembraneForward", None)
    assert np.array_equal(MeshErrors(coarse).of(made).components, first)


def test_the_error_behind_sensors_is_one_of_what_they_read(coarse):
    made = record(coarse, np.zeros(4), 1e-5)
    behind = MeshErrors(coarse).of(made, lambda strain: (1.0 + 50.0 * strain) ** 2)
    one, two = (
        MembraneForward(each).states(np.zeros((1, 4)), {}, {"pressure": PRESSURE})[0] for each in (coarse, coarse.finer())
    )
    np.testing.assert_allclose(behind.finer[0], (1.0 + 50.0 * two) ** 2 - (1.0 + 50.0 * one) ** 2, rtol=1e-3, atol=1e-7)


def kept_in(folder):
    """Keep what is made in a folder of the test: the user's cache may have it from an earlier run."""

    def kept(depends_on, suffix, make, _):
        file = folder / f"{hash(tuple(depends_on))}{suffix}"
        if not file.exists():
            file.write_bytes(make())
        return file

    return kept


def test_what_a_square_lacks_behind_sensors_is_learned_of_what_they_read_and_kept(monkeypatch, tmp_path):
    """Of pairs that it was not learned from, the covariance explains most; another sensor needs no further simulations."""
    pytest.importorskip("ziglang", reason="simulations need the compiler for their speed")
    monkeypatch.setattr(discrepancy, "CHUNKS", 4)
    monkeypatch.setattr(discrepancy, "kept_library", kept_in(tmp_path))
    length, steps = 20 * discrepancy.SPACING, 222
    strain = discrepancy.Discrepancy(
        elements_per_side=4, order=1, length=length, components=np.zeros((1, 4, 23)), provenance={}
    )
    bank = SensorBank(default_artifact(), 4, 0.02)
    behind = strain.behind(bank)
    other = discrepancy.simulated_pairs(7, 4, 1, steps)
    delta = [bank.read(other["strain"] + more * other["difference"], discrepancy.STEP)[0] for more in (1.0, 0.0)]
    Q = np.linalg.qr(discrepancy.spline_matrix(steps, discrepancy.STEP, length))[0]
    c, known = ((y @ Q).reshape(len(y), -1) for y in (delta[0] - delta[1], behind.basis(steps, discrepancy.STEP)))
    assert 0.5 < np.mean(c**2) / np.mean(np.sum(known**2, axis=0)) < 2.0
    assert np.mean(np.sum(c.T * np.linalg.solve(known.T @ known, c.T), axis=0)) < 2.0 * c.shape[1]
    monkeypatch.setattr(discrepancy, "simulated_pairs", None)
    assert np.array_equal(strain.behind(bank).components, behind.components)
    another = strain.behind(SensorBank(default_artifact(), 4, 0.02, {"full_scale_resistance_change": 10.0}))
    assert another.components.shape == behind.components.shape
    assert not np.allclose(another.components, behind.components)


def test_what_the_thesis_square_lacks_behind_sensors_is_not_used_for_another_membrane():
    twin = Twin(square_structure(8, 1), sensor=default_artifact(), discrepancy=discrepancy.default_discrepancy())
    with pytest.raises(ParameterError, match=r"thesis' square alone\. Give discrepancy=None"):
        twin.fit(ResponseRecord(step=3e-4, values=100.0 + np.random.default_rng(0).random((4, 1000)), kind="resistance"))


def test_few_samples_of_a_finer_mesh_do_not_lead_into_the_valley_where_modulus_and_gains_do_what_damage_does():
    """0.3 s of the thesis' square at steps of 1 ms, elements of twice the order, and noise that nobody states."""
    damage = np.zeros(16)
    damage[[5, 10]] = 0.2, 0.1
    strain = MembraneForward(square_structure(4, 8)).strain(damage[None], {}, {}, 300, 1e-3)[0]
    made = ResponseRecord(step=1e-3, values=strain + 1e-3 * np.random.default_rng(3).standard_normal(strain.shape))
    answer = Twin().fit(made)
    assert answer.valid
    assert answer.damage == pytest.approx(damage, abs=0.03)
    assert np.abs(answer.damage - damage)[[5, 10]] == pytest.approx(0.0, abs=2.5 * answer.deviation[[5, 10]].max())
