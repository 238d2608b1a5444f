"""The measures of error."""

import numpy as np
import pytest
from gossamer_models.fitting import e1, nrmse


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
