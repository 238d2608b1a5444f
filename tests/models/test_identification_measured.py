"""The figures of ``assess.py``: on the synthetic specimen everywhere, on measured records where they are."""

from pathlib import Path

import numpy as np
import pytest
from gossamer_models.identification import assess, fit_preisach, settings_for
from gossamer_models.identification.judge import predict_output, recover_strain
from gossamer_models.identification.records import read_record
from gossamer_models.measures import e1, nrmse

DATA = Path(__file__).parents[2].parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"measured data are not here: {DATA}")


def leading(record, part):
    return (np.arange(record.time.size) < round(part * record.time.size),)


def percent(measured, found, rows):
    return nrmse(measured[rows], found[rows], np.ptp(measured))


@pytest.mark.parametrize(("modes", "thesis"), [(3, 2.47), (5, 1.97)])
def test_the_specimen_is_fitted_better_than_the_thesis_fits_its_own(modes, thesis):
    record = assess.specimen_record(1)
    settings = settings_for("preisach", modes=modes, relaxations=modes, starts=1)
    fit = fit_preisach((record,), (record.time < 200.0,), settings, full_scale=0.15, rest_output=0.0)
    assert e1(record.output, predict_output(fit, record), rest=0.0) < min(thesis, 1.4)


@needs_data
def test_silver_thread_is_predicted_and_its_strain_recovered():
    record = read_record(DATA / "nylon_silver" / "strain_sin_30.csv", assess.NYLON)
    settings = settings_for("preisach-hats", extension="falling", starts=1, direct_inverse=True)
    fit = fit_preisach((record,), leading(record, 0.5), settings, full_scale=1.0)
    train = fit.train[0]
    back = recover_strain(fit, record)
    reached = [
        percent(a, b, rows)
        for a, b in ((record.output, fit.predicted[0]), (record.strain, back))
        for rows in (train, ~train)
    ]
    assert (np.array(reached) < [0.75, 0.90, 0.60, 0.85]).all(), reached


@needs_data
def test_carbon_black_reverses_and_its_strain_is_recovered():
    record = read_record(DATA / "cb_silicone" / "velocity_profile_10wt.csv", assess.CARBON)
    fit = fit_preisach(
        (record,), leading(record, 0.6), settings_for("preisach-hats", extension="reversing", relaxations=9)
    )
    train = fit.train[0]
    back = recover_strain(fit, record)
    reached = [
        percent(a, b, rows)
        for a, b in ((record.output, fit.predicted[0]), (record.strain, back))
        for rows in (train, ~train)
    ]
    assert (np.array(reached) < [0.9, 1.4, 3.2, 7.0]).all(), reached
