"""The fractional models on the synthetic specimen, and what limits them."""

import pytest
from gossamer_models.fractional import FractionalSettings
from studies.fractional import THESIS, change_error, fit_change, fitted, limits
from studies.specimen import specimen_record


def test_models_that_are_linear_in_strain_cannot_follow_the_synthetic_specimen():
    """The limits that the page states: above the thesis' figures, which came from another material."""
    limit = limits(starts=2)
    fit = fit_change(specimen_record(1), fitted(1), FractionalSettings(model="sub-model-1", starts=2))
    assert THESIS["sub-model-1", 5][0] < limit.fitted["sub-model-2"] < limit.fitted["sub-model-1"] <= fit.errors[0].e1
    assert limit.with_square < 0.2 * limit.fitted["sub-model-1"]
    assert limit.noise[0] < limit.informed["model-1"] < limit.informed["sub-model-2"] < limit.informed["sub-model-1"]
    assert change_error(fit, specimen_record(2)) == pytest.approx(limit.doubling, abs=1.5)
    assert max(limit.model_1_informed) < 2.0


def test_model_1_follows_the_synthetic_dataset_1_closer_than_the_thesis_followed_its_own():
    fit = fit_change(specimen_record(1), fitted(1), FractionalSettings(model="model-1", terms=3, starts=4))
    assert fit.errors[0].e1 < THESIS["model-1", 3][0]
