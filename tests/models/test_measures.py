"""The measures of error, and of how well the data determine parameters."""

import numpy as np
import pytest
from gossamer_models.fitting import covariance, e1, nrmse


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
