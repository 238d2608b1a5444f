"""The detector: packets, networks, windows and the damage it estimates."""

import json

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ArtifactError, DataError, Stepper, simulate
from gossamer_models.assessment import DetectorJudge
from gossamer_models.assessment.figures import errors, thesis_errors
from gossamer_models.batch import Batch
from gossamer_models.detector import DetectorArtifact, defuzzify, detector_model, packet_energies, triangular_memberships
from gossamer_models.detector.thesis_training import (
    LEVELS,
    PEAKS,
    SAMPLES,
    TRAININGS,
    simulate_cases,
    train_networks,
    training_cases,
    window_energies,
)
from gossamer_models.membrane import membrane_model
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

STEP = 3e-4
STRAINS = [f"strain[{i}]" for i in range(1, 5)]

# One case per zone: drawn once, uniformly from 2 to 40 %, and moved off the training levels.
UNSEEN = (0.33, 0.043, 0.22, 0.13, 0.07, 0.38, 0.27, 0.18, 0.02, 0.335, 0.09, 0.242, 0.37, 0.122, 0.29, 0.165)

OUTPUTS = (*(f"index[{k}]" for k in range(1, 17)), "valid", "similarity")


@pytest.fixture(scope="module")
def model():
    return detector_model()


def run(model, strains, h=STEP, **parameters):
    """Feed strains sampled every ``h`` [s]; return the ``OUTPUTS`` after each step, one row per step."""
    detector = Stepper(model, **parameters)
    detector.initialize()
    results = simulate(detector, np.full(len(strains[0]), h), dict(zip(STRAINS, strains, strict=True)), OUTPUTS)
    return np.column_stack(list(results.values()))


@settings(max_examples=10, deadline=None)
@given(arrays(float, (4, 40), elements=st.floats(-0.5, 0.5)))
def test_streaming_indices_equal_pywavelets(model, strains):
    """Over a window of 40 samples, to 1e-12 of the total energy of a sensor."""
    rows = run(model, strains, window_length=40 * STEP)
    baseline = DetectorArtifact.default().baseline[0]
    expected = packet_energies(strains)
    found = (rows[-1, :16] * baseline).reshape(4, 4)
    assert np.abs(found - expected).max() <= 1e-12 * max(1.0, expected.sum(axis=1).max())


def test_energies_keep_the_energy_of_the_record():
    strains = np.random.default_rng(1).uniform(0.0, 0.3, (4, 844))
    assert packet_energies(strains).sum(axis=1) == pytest.approx(np.sum(strains**2, axis=1), rel=1e-13)


def test_windows_repeat_and_a_single_record_does_not(model):
    strains = np.random.default_rng(2).uniform(0.0, 0.3, (4, 2 * SAMPLES))
    baseline = DetectorArtifact.default().baseline
    first, second = (packet_energies(part).ravel() for part in np.split(strains, 2, axis=1))
    repeated, single = run(model, strains, repeat=1.0), run(model, strains)
    assert (repeated[SAMPLES - 2, :16] == 1.0).all()
    assert repeated[-1, :16] == pytest.approx(second / baseline[1], rel=1e-12)
    assert single[-1, :16] == pytest.approx(first / baseline[0], rel=1e-12)


@pytest.mark.parametrize("parts", [2, 3, 7])
def test_shorter_communication_steps_sample_the_same_record(model, parts):
    """Between communication points strain is linear, so a piecewise linear record gives the same samples."""
    strains = np.random.default_rng(3).uniform(0.0, 0.3, (4, 40))
    fine = np.array([np.interp(np.arange(1, 40 * parts + 1) / parts, np.arange(41), np.r_[0.0, row]) for row in strains])
    coarse = run(model, strains, window_length=40 * STEP)[-1]
    assert run(model, fine, h=STEP / parts, window_length=40 * STEP)[-1] == pytest.approx(coarse, rel=1e-9)


def test_a_window_may_start_later(model):
    strains = np.random.default_rng(4).uniform(0.0, 0.3, (4, 60))
    late = run(model, strains, start_time=20 * STEP, window_length=40 * STEP)[-1, :16]
    assert late == pytest.approx(run(model, strains[:, 20:], window_length=40 * STEP)[-1, :16], rel=1e-9)


def test_a_window_without_its_baseline_is_not_valid(model):
    strains = simulate_cases(np.zeros((1, 16)), SAMPLES)[0]
    assert run(model, strains)[-1, 16] == 1.0
    assert run(model, strains, window_length=400 * STEP)[-1, 16] == 0.0
    assert run(model, strains, start_time=STEP)[-1, 16] == 0.0


@pytest.mark.parametrize("strain", [0.0, 1e-9, 1e6])
def test_absurd_strains_do_not_fail_and_resemble_nothing(model, strain):
    *_, valid, similarity = run(model, np.full((4, SAMPLES), strain))[-1]
    assert similarity == pytest.approx(0.0, abs=1e-6)
    assert valid == 0.0


@given(st.floats(0.0, 1.0))
def test_memberships_add_up_to_one_and_centroids_give_the_damage_back(damage):
    O = triangular_memberships(damage, PEAKS)
    assert O.sum() == pytest.approx(1.0)
    assert float(defuzzify(ca.DM(O), ca.DM(PEAKS))) == pytest.approx(min(damage, 0.4), abs=1e-15)


@pytest.mark.parametrize(
    ("memberships", "expected"),
    [
        ([0.2, 0.9, 0.9], {"centroid": 0.27, "som": 0.2, "mom": 0.3, "lom": 0.4}),
        ([0.1, 0.8, 0.1], {"centroid": 0.2, "som": 0.2, "mom": 0.2, "lom": 0.2}),
        ([-0.5, 0.0, 0.0], {"centroid": 0.0, "som": 0.0, "mom": 0.0, "lom": 0.0}),
    ],
)
def test_defuzzification_methods_differ_as_section_6_1_4_says(memberships, expected):
    found = {method: float(defuzzify(ca.DM(memberships), ca.DM(PEAKS), method)) for method in expected}
    assert found == pytest.approx(expected)


def test_single_damage_is_found_trained_on_or_not(model, capsys):
    """Target: below 1.0 % over all zones. The thesis, after a coarser training: 0.104 % and 0.214 % over damaged zones."""
    found = thesis_errors(DetectorArtifact.default(), noisy=False)
    verdicts = DetectorJudge(model)(simulate_cases(np.diag(UNSEEN), SAMPLES), STEP)
    unseen = errors(np.diag(UNSEEN), verdicts)
    ours, thesis = found["Tables 7.1 and 7.2, 13 single"]
    with capsys.disabled():
        print("\nmean absolute error [% damage]  all zones  damaged zones")
        for cases, row in {"Table 7.1, the thesis": thesis, "Table 7.1": ours, "16 unseen cases": unseen}.items():
            print(f"{cases:>30}  {row['all zones']:9.3f}  {row['damaged zones']:13.3f}")
    assert not np.isclose(np.array(UNSEEN)[:, None], LEVELS).any()
    assert (thesis["all zones"], thesis["damaged zones"]) == pytest.approx((0.104, 0.214), abs=1e-3)
    for zones in ("all zones", "damaged zones"):
        assert ours[zones] <= thesis[zones]
        assert unseen[zones] <= 1.0


def test_the_second_training_holds_the_cases_of_table_7_3():
    single, multiple = (training_cases(TRAININGS[name]) for name in ("single", "multiple"))
    assert single == pytest.approx(multiple[: len(single)])
    assert (np.abs(multiple - np.eye(16)[[0, 2, 4]].T @ [0.2, 0.4, 0.2]).max(axis=1) < 1e-12).any()
    assert (single > 0.0).sum(axis=1).max() == 1


def test_the_shipped_artifact_comes_from_this_membrane_and_this_training():
    """Two of its cases simulated again, the networks of its first window trained again: the same numbers."""
    artifact, damages = DetectorArtifact.default(), training_cases(TRAININGS["single"])
    for case, strains in zip((0, 10), simulate_cases(damages[[0, 10]], 3 * SAMPLES), strict=True):
        energies = window_energies(strains, SAMPLES)
        assert np.log(energies / artifact.baseline) == pytest.approx(
            artifact.references[:, case], abs=1e-5
        )  # strain is stored in single precision
    weights, bias, rules, _ = train_networks(artifact.references[0], damages, len(LEVELS))
    assert weights == pytest.approx(artifact.weights[0], rel=1e-9)
    assert bias == artifact.bias[0]
    similarity_sums = np.abs(artifact.rules[0]).max()
    assert rules == pytest.approx(artifact.rules[0], abs=1e-6 * similarity_sums)


def test_damage_that_begins_later_is_found_once_a_window_has_passed(model):
    """Undamaged for three windows, then 40 % in zone 6; estimated by the networks of the periodic response."""
    damage = np.repeat([0.0, 0.4], 3 * SAMPLES)
    membrane = Batch(membrane_model(), STRAINS, ["damage[6]"])
    strains = membrane.run(damage.size, STEP, inputs={"damage[6]": damage}).results
    judge = DetectorJudge(model)
    assert 100 * judge(strains[:, :, : 3 * SAMPLES], STEP).damage[0] == pytest.approx(np.zeros(16), abs=1.0)
    assert 100 * judge(strains, STEP).damage[0] == pytest.approx(40 * np.eye(16)[5], abs=1.5)


def test_training_needs_two_levels_per_zone():
    with pytest.raises(DataError, match="17 training cases"):
        train_networks(np.zeros((17, 16)), np.zeros((17, 16)), 1)


def test_an_artifact_survives_its_files(tmp_path):
    artifact = DetectorArtifact.default()
    artifact.write(tmp_path / "copy.json")
    assert detector_model(DetectorArtifact.read(tmp_path / "copy.json")).digest == detector_model(artifact).digest


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda path: path.write_text(path.read_text()[:50]), "cannot read the artifact"),
        (lambda path: path.with_suffix(".npz").write_bytes(b"PK"), "SHA-256 differs"),
        (lambda path: path.with_suffix(".npz").unlink(), "cannot read the arrays"),
        (lambda path: path.write_text(json.dumps(json.loads(path.read_text()) | {"version": 2})), "version 2; this"),
        (lambda path: path.write_text(json.dumps(json.loads(path.read_text()) | {"samples": 843})), "multiple of 4"),
    ],
)
def test_a_spoilt_artifact_is_refused(tmp_path, spoil, message):
    path = tmp_path / "copy.json"
    DetectorArtifact.default().write(path)
    spoil(path)
    with pytest.raises(ArtifactError, match=message):
        DetectorArtifact.read(path)
