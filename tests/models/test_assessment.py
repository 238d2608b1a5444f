"""The assessment: figures, conditions, judges, and all of it together on records that carry their truth."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SHARED
from gossamer_models import ArtifactError, ParameterError
from gossamer_models.assessment import (
    AlwaysZero,
    AssessmentResults,
    DetectorJudge,
    TwinJudge,
    Verdicts,
    assess,
    conditions,
    confusion,
    detections,
    figures,
    read_assessment,
    read_judge,
    readings,
    reliability,
    write_assessment,
)
from gossamer_models.assessment.conditions import (
    HELD_OUT,
    SHARES,
    SHORT,
    SIZES,
    TUNED,
    chosen,
    finer,
    plan_of_square,
    single_damages,
)
from gossamer_models.assessment.figures import NOMINAL
from gossamer_models.assessment.judges import ask
from gossamer_models.assessment.plots import save_pictures
from gossamer_models.assessment.records import Records, make_records
from gossamer_models.assessment.results import FILE
from gossamer_models.assessment.truths import as_setup, partial_damages, quartered, tilt, tilted, whole_zones
from gossamer_models.batch import Batch
from gossamer_models.campaign import Mesh, draw_cases
from gossamer_models.detector import detector_model
from gossamer_models.detector.thesis_tables import MULTIPLE_TRAINING, SINGLE_TRAINING, TABLE_7_3, TABLES, as_array
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.twin import MembraneForward, Twin
from scipy.stats import norm

COARSE = Mesh(elements_per_side=4, order=1)


class Seer:
    """Sees the damage, which its records carry in place of strain, with an error of ``sigma`` that it states."""

    reads, most, sizes, identity = "strain", None, None, "seer"

    def __init__(self, sigma=0.01, name="seer", blind=False):
        self.sigma, self.name, self.blind = sigma, name, blind

    def __call__(self, histories, step):
        damage = histories.reshape(len(histories), 16)
        error = self.sigma * np.random.default_rng(len(damage)).standard_normal(damage.shape)
        valid = np.full(len(damage), not self.blind)
        return Verdicts(
            damage=damage + error,
            deviation=np.full(damage.shape, self.sigma),
            probability=norm.cdf((damage + error) / self.sigma - 2.0),  # a half at two deviations
            valid=valid,
        )


def transparent(condition, folder, **options):
    """Make records whose strain is the damage."""
    damage = draw_cases(condition.campaign, range(condition.campaign.count)).damage
    damage = whole_zones(condition.campaign.membrane.structure, damage) if condition.parts else damage
    return Records(damage=damage, strain=damage.reshape(-1, 4, 4), resistance=None, step=3e-4, failed=0)


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gossamer_models.assessment.run.make_records", transparent)
        return assess([AlwaysZero(), Seer(), Seer(0.01, "blind", blind=True)], tmp_path_factory.mktemp("seen"), cases=100)


def test_the_figures_of_three_records_are_those_by_hand():
    damage, said = np.zeros((3, 16)), np.zeros((3, 16))
    damage[0, 0], damage[0, 1] = 0.4, 0.04
    said[0, 0], said[0, 2] = 0.25, 0.07  # too little in zone 1, none in zone 2, some in zone 3
    said[2, 5] = 0.06
    found = figures(damage, Verdicts(damage=said, valid=np.array([False, True, True])))
    assert found.error_all == pytest.approx(100.0 * (0.15 + 0.04 + 0.07 + 0.06) / 48)
    assert found.error_damaged == pytest.approx(100.0 * (0.15 + 0.04) / 2)
    assert (found.valid.number, found.valid.total) == (2, 3)
    assert (found.hits.number, found.hits.total) == (0, 1)  # what is not valid is no call; 4 % need not be found
    assert found.false_calls.number == 1
    assert (found.wrong.number, found.wrong_and_invalid.number) == (1, 1)
    assert math.isnan(found.z_rms)
    assert math.isnan(found.brier)


def test_right_deviations_are_reliable_and_halved_ones_are_not():
    random = np.random.default_rng(0)
    damage, deviation = random.random((500, 16)), 0.01 + 0.05 * random.random((500, 16))
    said = damage + deviation * random.standard_normal(damage.shape)
    right = Verdicts(damage=said, deviation=deviation, valid=np.ones(500, dtype=bool))
    assert reliability(damage, right) == pytest.approx(NOMINAL, abs=4.0 * 0.5 / math.sqrt(8000))
    assert figures(damage, right).z_rms == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * 8000))
    assert figures(damage, replace(right, deviation=deviation / 2.0)).within_95 < 0.7  # 1.96 / 2: 67 %


def test_a_deviation_of_zero_is_right_only_where_the_value_is():
    said = Verdicts(damage=np.full((1, 16), 0.1), deviation=np.zeros((1, 16)), valid=np.ones(1, dtype=bool))
    assert figures(np.full((1, 16), 0.1), said).within_95 == 1.0
    assert figures(np.zeros((1, 16)), said).within_95 == 0.0


def test_confusion_counts_the_zone_called_first():
    damage = np.zeros((4, 16))
    damage[0, 4] = damage[1, 4] = damage[2, 4] = 0.3
    damage[3, :2] = 0.3  # two zones: does not count
    said = np.zeros((4, 16))
    said[0, 4], said[0, 5], said[1, 5] = 0.2, 0.1, 0.3
    counts = confusion(damage, Verdicts(damage=said, valid=np.ones(4, dtype=bool)), 0.05)
    assert counts.sum() == 3
    assert (counts[4, 4], counts[4, 5], counts[4, 16]) == (1, 1, 1)


def test_single_damages_fill_every_zone_evenly_wherever_they_stop():
    damage = as_array(single_damages(60, 16))
    assert ((damage > 0.0).sum(axis=1) == 1).all()
    for stop in (8 * 16, 60 * 16):
        for zone in range(16):
            size = np.sort(damage[:stop, zone][damage[:stop, zone] > 0.0])
            u = np.interp(np.log(size), np.log(SIZES), SHARES)
            assert len(u) == stop // 16
            assert np.diff(u).max() < 2.5 / len(u)
    assert 0.005 <= damage[damage > 0.0].min() < damage.max() <= 0.5
    assert len(np.unique(damage[damage > 0.0])) == 960


def test_conditions_that_share_a_store_share_its_campaign():
    put = conditions(plan_of_square(), COARSE, 8)
    put += [condition for pair in detections(plan_of_square(), 8) for condition in (pair.healthy, pair.damaged)]
    assert len({condition.name for condition in put}) == len(put)
    for condition in put:
        assert all(other.campaign == condition.campaign for other in put if other.store == condition.store)


def test_the_square_has_every_condition_and_half_are_kept_out_of_tuning():
    names = {condition.name: condition for condition in conditions(plan_of_square(COARSE), finer(COARSE), 4)}
    assert set(names) == TUNED | HELD_OUT
    assert len(TUNED) == len(HELD_OUT)
    assert not TUNED & HELD_OUT
    assert [condition.name for condition in chosen([*names.values()], ["short"])] == list(SHORT)
    assert names["outliers"].held_out
    with pytest.raises(ParameterError, match="Choose from all, short, clean"):
        chosen([*names.values()], ["hail"])


def test_the_square_as_a_setup_moves_as_the_square_does():
    mesh = Mesh(elements_per_side=4, order=2, parameters={"density": 1200.0, "edge_displacement": 0.005})
    damage = 0.3 * np.eye(16)[2:3]
    own, general = (
        MembraneForward(each.structure, each.parameters).strain(damage, {}, {}, 200, 3e-4) for each in (mesh, as_setup(mesh))
    )
    assert np.ptp(own) > 0.01
    assert general == pytest.approx(own, abs=1e-12)


def test_damage_of_parts_is_the_mean_over_the_area_of_each_zone():
    """Square: a band holds half of four zones, a corner a quarter of four, a hole a quarter of one."""
    structure = quartered(Mesh()).structure
    assert structure.n_zones == 4 * 16
    for kind, zones, share in (("band", 4, 0.5), ("corner", 4, 0.25), ("hole", 1, 0.25)):
        listed = np.zeros((6, 64))
        for row, parts in zip(listed, partial_damages(kind, structure, 6, seed=1), strict=True):
            row[[part - 1 for part in parts]] = [*parts.values()]
        found = whole_zones(structure, listed)
        assert (found > 0.0).sum(axis=1).tolist() == [zones] * 6
        assert found.max(axis=1) == pytest.approx(share * listed.max(axis=1))


def test_a_tilted_pressure_is_that_of_the_middle_on_the_mean():
    plan = plan_of_square(tilted(Mesh()), 0.03)
    loads = tilt(replace(plan, cases=2))
    assert len(loads) == 8
    assert {values.shape for values in loads.values()} == {(2, 100)}
    assert sum(loads.values()) == pytest.approx(0.0, abs=1e-9)
    ends = loads["of_strip_7"] - loads["of_strip_0"]
    assert np.abs(ends).max() == pytest.approx(0.05 * 1e4 * 7 / 8 * math.sin(2 * math.pi * 7.9 * 0.03), rel=1e-2)


def test_sensors_off_their_place_late_records_and_noise_are_what_they_say():
    random = np.random.default_rng(1)
    strain, noise, numbers = random.random((8, 4, 900)), 0.01 * random.standard_normal((8, 4, 900)), np.arange(8)
    late = readings.late(5, strain, 0.0 * noise, numbers)
    assert (late[:, :, 5:] == strain[:, :, :-5]).all()
    gain = readings.one_gain(strain, 0.0 * noise, numbers) / strain
    assert [np.flatnonzero(row.min(axis=1) < 0.96).tolist() for row in gain] == [[k % 4] for k in range(8)]
    coloured = readings.coloured(0.0 * strain, noise, numbers)
    assert np.corrcoef(coloured[0, 0, 1:], coloured[0, 0, :-1])[0, 1] == pytest.approx(0.9, abs=0.05)
    far = readings.outliers(0.0 * strain, noise, numbers) - noise
    assert 0.002 < (far > 0.0).mean() < 0.008
    thrice = random.random((8, 12, 9))
    moved = readings.off_place(thrice, 0.0 * thrice, numbers)
    assert ((moved == thrice[:, :4]).all(axis=2).sum(axis=1) == 3).all()
    assert (moved[5, 1] == thrice[5, 9]).all()  # the second way of the second sensor


def test_few_cases_are_simulated_at_once_as_a_campaign_does(tmp_path):
    plan = plan_of_square(COARSE, 0.03)
    varied = {c.name: c for c in conditions(plan, None, 3)}["everything varied"]
    at_once = make_records(varied, tmp_path)
    assert not any(tmp_path.iterdir())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gossamer_models.assessment.records.FEW", 0)
        stored = make_records(varied, tmp_path, workers=1)
    assert (stored.damage == at_once.damage).all()
    assert stored.strain == pytest.approx(at_once.strain, abs=1e-6)


def test_wrong_and_valid_is_a_determined_zone_off_by_five_points_and_three_deviations():
    damage = np.zeros((5, 16))
    said, deviation = np.full((5, 16), 0.0), np.full((5, 16), 0.01)
    said[:, 3] = 0.08
    deviation[1, 3] = 0.03  # not determined
    deviation[2, 3] = 0.019
    said[2, 3] = 0.055  # within three deviations
    said[3, 3] = 0.04  # within five points
    valid = np.array([True, True, True, True, False])
    found = figures(damage, Verdicts(damage=said, deviation=deviation, valid=valid))
    assert (found.wrong_and_valid.number, found.wrong_and_valid.total) == (1, 5)
    assert found.worst_healthy == pytest.approx(8.0)
    untold = Verdicts(damage=said, deviation=deviation, determined=np.zeros((5, 16), dtype=bool), valid=valid)
    assert figures(damage, untold).wrong_and_valid.number == 0


def test_some_conditions_alone_are_put_to_every_judge(tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gossamer_models.assessment.run.make_records", transparent)
        slow = Seer()
        slow.most = 1
        found = assess([slow], tmp_path, cases=2, plan=plan_of_square(COARSE), only=["dead sensor", "outliers"])
    assert [(row.condition, row.held_out, row.figures.records) for row in found.rows] == [
        ("dead sensor", False, 1),
        ("outliers", True, 1),
    ]
    assert not found.detections
    assert not found.tables


def test_a_dead_sensor_repeats_its_first_reading_and_swapped_ones_change_places():
    histories = np.random.default_rng(1).random((12, 4, 9))
    noise = 0.0 * histories
    dead, swapped = (read(histories, noise, np.arange(12)) for read in (readings.dead, readings.swapped))
    for k in range(12):
        still = np.ptp(dead[k], axis=1) == 0.0
        assert np.flatnonzero(still).tolist() == [k % 4]
        assert (dead[k, ~still] == histories[k, ~still]).all()
        assert (swapped[k] != histories[k]).any(axis=1).sum() == 2
        assert (np.sort(swapped[k], axis=0) == np.sort(histories[k], axis=0)).all()


def test_records_through_the_chain_are_in_time_with_the_membrane(tmp_path):
    chain = next(c for c in conditions(plan_of_square(COARSE, 0.06), COARSE, 4) if c.name == "whole chain")
    clean = next(c for c in conditions(plan_of_square(COARSE, 0.06), COARSE, 4) if c.name == "clean")
    measured, true = (make_records(condition, tmp_path, workers=1) for condition in (chain, clean))
    assert measured.strain.shape == true.strain.shape == (4, 4, 200)
    assert measured.resistance.shape == (4, 4, 200)
    assert (measured.damage == true.damage).all()
    error = [np.abs(measured.strain[:, :, 8:192] - true.strain[:, :, 8 + s : 192 + s]).mean() for s in range(-8, 9, 2)]
    assert int(np.argmin(error)) == 4


def test_the_judge_of_a_twin_takes_a_record_that_cannot_be_fitted_for_not_valid(tmp_path):
    clean = next(c for c in conditions(plan_of_square(COARSE, 0.06), COARSE, 4) if c.name == "clean")
    records = make_records(clean, tmp_path, workers=1)
    histories = np.concatenate([records.strain[:1], np.ones((1, 4, 200))])
    found = TwinJudge(Twin(square_structure(4, 1)))(histories, records.step)
    assert found.valid.tolist() == [True, False]
    assert np.abs(found.damage[0] - records.damage[0]).max() < 0.02  # of 5 to 50 %
    assert not found.damage[1].any()


def test_the_judge_of_a_detector_says_what_the_detector_says():
    histories = 0.05 + 0.05 * np.random.default_rng(2).random((1, 4, 900))
    found = read_judge(Path("single_damage"))(histories, 3e-4)
    assert not found.valid[0]  # like nothing it was trained on
    assert (found.damage == DetectorJudge(detector_model())(histories, 3e-4).damage).all()


def test_of_a_network_the_last_window_with_a_valid_answer_counts():
    judge = read_judge(Path("nominal"))
    trained = judge.artifact
    model = membrane_model()
    batch = Batch(model, model.elements("strain"))
    first = round(trained.start_time / trained.sampling_step)
    end = first + 2 * trained.samples
    history = batch.run(end, trained.sampling_step, {"damage": 0.3 * np.eye(16)[5:6]}).results
    torn = history.copy()
    torn[:, :, end - trained.samples // 2 :] += 0.3
    early = judge(history[:, :, : first + trained.samples], trained.sampling_step)
    late, saved = (judge(h, trained.sampling_step) for h in (history, torn))
    assert early.valid.all()
    assert late.valid.all()
    assert (saved.damage == early.damage).all()
    assert not (late.damage == early.damage).all()


def test_a_seer_is_assessed_for_what_it_is(seen):
    random, zero = seen.row("seer", "noise").figures, seen.row("always 0", "noise").figures
    assert random.error_all == pytest.approx(100.0 * 0.01 * math.sqrt(2.0 / math.pi), rel=0.1)
    assert random.z_rms == pytest.approx(1.0, abs=0.1)
    assert 0.0 < random.brier < 0.1
    assert (zero.hits.number, zero.valid.value) == (0, 1.0)
    assert seen.row("blind", "healthy, noise").figures.false_calls.number == 0
    together = {row.judge: row for row in seen.detections if row.zone == 0 and "chain" not in row.condition}
    seer = together["seer"]
    # the largest of 16 normal errors is above 3.2 deviations in 1 % of records; the threshold is from 50 of them
    threshold = 0.01 * (2.0 + norm.ppf(seer.threshold))  # the estimate at which P has the threshold
    assert 0.018 < threshold < 0.045
    assert threshold < seer.a90 < threshold + 3.0 * 0.01
    assert {row.score for row in seen.detections if row.judge == "seer"} == {"P(damaged)"}
    assert {row.score for row in seen.detections if row.judge == "always 0"} == {"estimate"}
    assert seer.a90 < seer.a90_95 < 1.3 * seer.a90
    assert together["blind"].remark == together["always 0"].remark == "nothing was hit"
    assert {row.zone for row in seen.detections if row.judge == "seer"} == set(range(17))
    counts = np.array(next(row.counts for row in seen.confusions if row.judge == "seer"))
    assert np.diag(counts).sum() > 0.95 * counts[:, :16].sum()


def test_the_tables_of_the_thesis_are_judged_case_by_case(seen):
    rows = [row for row in seen.tables if (row.judge, row.condition) == ("always 0", "clean")]
    assert [(row.table, row.case) for row in rows] == [(t.name, case) for t in TABLES for case in t.cases]
    assert all(row.damage == [0.0] * 16 for row in rows)


def test_results_are_read_as_they_were_written(seen, tmp_path):
    paths = write_assessment(seen, tmp_path)
    again = read_assessment(tmp_path)
    assert again.rows[0].figures.hits == seen.rows[0].figures.hits
    assert write_assessment(again, tmp_path / "again")
    for path in paths:
        if path.suffix == ".csv":
            assert path.read_text() == (tmp_path / "again" / path.name).read_text().replace(",inf", ",")
    assert "NaN" not in (tmp_path / FILE).read_text()
    pictures = {path.stem for path in save_pictures(again, tmp_path)}
    assert pictures == {
        *(f"{kind}_seer_{what}" for kind in ("detection", "confusion") for what in ("noise_0_9_s", "whole_chain_0_3_s")),
        "reliability",
        "errors",
        "false_calls",
    }


def test_what_is_no_assessment_is_refused(tmp_path):
    with pytest.raises(ArtifactError):
        read_assessment(tmp_path)
    write_assessment(AssessmentResults(provenance={}), tmp_path)
    (tmp_path / FILE).write_text((tmp_path / FILE).read_text().replace('"version": 3', '"version": 1'))
    with pytest.raises(ArtifactError, match="version 1"):
        read_assessment(tmp_path)


def test_what_a_slow_judge_said_is_kept_until_the_judge_or_the_records_change(tmp_path):
    asked = []

    class Slow(Seer):
        most = 4

        def __call__(self, histories, step):
            asked.append(len(histories))
            return super().__call__(histories, step)

    judge, records = Slow(), np.random.default_rng(3).random((20, 4, 4))
    first = ask(judge, records, 3e-4, tmp_path)
    assert asked == [8, 8, 4]
    again = ask(judge, records, 3e-4, tmp_path)
    assert asked == [8, 8, 4]
    for part in ("damage", "deviation", "probability", "valid"):
        assert (getattr(again, part) == getattr(first, part)).all()
    ask(judge, records[:8] + 1.0, 3e-4, tmp_path)
    judge.identity = "another"
    ask(judge, records[:8], 3e-4, tmp_path)
    assert asked == [8, 8, 4, 8, 8]


def test_two_judges_of_one_name_are_refused(tmp_path):
    with pytest.raises(ParameterError, match="same name"):
        assess([AlwaysZero(), AlwaysZero()], tmp_path)
    with pytest.raises(ParameterError, match="too few"):
        assess([AlwaysZero()], tmp_path, cases=2)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the tables lie beside a development checkout")
def test_the_tables_are_those_of_the_thesis():
    """../shared/thesis/tables; case 16 of Table 7.1 as READING.md there reads it."""

    def read(name, kind):
        with (SHARED / "thesis" / "tables" / name).open() as file:
            rows = [row for row in csv.DictReader(file) if row["kind"] == kind]
        return {int(row["case"]): [float(row[f"zone{zone}"]) for zone in range(1, 17)] for row in rows}

    for table, clean, noisy in (
        (SINGLE_TRAINING, "table_7_1_single_training_clean.csv", "table_7_2_single_training_noisy.csv"),
        (MULTIPLE_TRAINING, "table_7_4_multi_training_clean.csv", "table_7_5_multi_training_noisy.csv"),
    ):
        assert 100.0 * table.damage == pytest.approx(np.array(list(read(noisy, "actual").values())))
        for ours, name in ((table.clean, clean), (table.noisy, noisy)):
            theirs = read(name, "thesis_predicted")
            assert np.isnan(ours).all(axis=1).tolist() == [case not in theirs for case in table.cases]
            assert (ours[~np.isnan(ours[:, 0])] == np.array(list(theirs.values()))).all()
    assert 100.0 * as_array(TABLE_7_3) == pytest.approx(
        np.array(list(read("table_7_3_reference_set.csv", "actual").values()))
    )


def test_the_figures_of_the_thesis_follow_from_its_tables():
    """READING.md: 0.104 over all and 0.214 over damaged zones of cases 2 to 14 without noise, 0.767 and 1.069 with."""
    truth = SINGLE_TRAINING.damage[1:14]
    for said, all_zones, damaged in ((SINGLE_TRAINING.clean, 0.104, 0.214), (SINGLE_TRAINING.noisy, 0.767, 1.069)):
        found = figures(truth, Verdicts(damage=said[1:14] / 100.0, valid=np.ones(13, dtype=bool)))
        assert (found.error_all, found.error_damaged) == pytest.approx((all_zones, damaged), abs=6e-4)
