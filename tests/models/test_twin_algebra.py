"""What the twin computes with: bounded minima, sets of zones, weights and learned covariances, against closed forms."""

import numpy as np
import pytest
from gossamer_models import ArtifactError, DataError
from gossamer_models.twin.discrepancy import SPACING, Discrepancy, default_discrepancy, learn, spline_matrix
from gossamer_models.twin.least_squares import MOST_DAMAGE, LeastSquares, Quadratic, bounded_minimum, descend
from gossamer_models.twin.search import Fit, with_rivals
from gossamer_models.twin.weights import RecordWeights
from gossamer_models.twin.zone_sets import ODDS, Box, alternatives
from hypothesis import given, settings
from hypothesis import strategies as st
from make_discrepancy import write
from scipy.optimize import lsq_linear

matrices = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).standard_normal((12, 7)))


@settings(max_examples=50, deadline=None)
@given(J=matrices, r=st.integers(0, 10_000).map(lambda seed: 3.0 * np.random.default_rng(seed).standard_normal(12)))
def test_the_bounded_minimum_is_that_of_scipy(J, r):
    low, high = np.full(7, -0.3), np.full(7, 0.4)
    expected = lsq_linear(J, r, (low, high), method="bvls", tol=1e-12).x
    np.testing.assert_allclose(bounded_minimum(J.T @ J, J.T @ r, low, high), expected, atol=1e-6)


def test_a_damage_that_may_as_well_be_in_another_zone_is_that_uncertain():
    """Two zones whose effects are (1, t) and (1, -t) read (m, 0): sets of one zone, of the other, or both in closed form."""
    t, m, noise = 0.1, 0.2, 0.02
    J, y = np.array([[1.0, 1.0], [t, -t]]) / noise, np.array([m, 0.0]) / noise
    alone = m / (1.0 + t**2)
    at = np.array([alone, 0.0])
    model = Quadratic(A=J.T @ J, g=J.T @ (y - J @ at), at=at)
    limits = Box(zones=np.array([True, True]), low=-at, high=0.95 - at)
    odds, prior = ODDS, MOST_DAMAGE / np.sqrt(2.0 * np.pi)  # evidence: odds, what is left of the prior, and the fit
    A = J.T @ J
    one = odds / np.sqrt(1.0 + prior**2 * A[0, 0])
    two = odds**2 / np.sqrt(np.linalg.det(np.eye(2) + prior**2 * A))
    both = two / one * np.exp((m * t / noise) ** 2 / (1.0 + t**2) / 2.0)
    none = 1.0 / one * np.exp(-((m / noise) ** 2) / (1.0 + t**2) / 2.0)
    total = 2.0 + both + none
    found = alternatives(model, limits, np.array([True, False]))
    assert found.probability == pytest.approx([(1.0 + both) / total] * 2, abs=1e-12)
    moves = np.array([[0.0, 0.0], [-alone, alone], [m / 2.0 - alone, m / 2.0], [-alone, 0.0]])
    weights = np.array([1.0, 1.0, both, none]) / total
    np.testing.assert_allclose(found.spread, np.einsum("k,ki,kj->ij", weights, moves, moves), atol=1e-12)


@pytest.mark.parametrize(("at", "deviation"), [(0.09, 0.03), (0.014, 0.004), (0.3, 0.1)])
def test_a_damage_is_as_likely_as_the_integral_over_all_there_may_be(at, deviation):
    """Any damage up to the largest is as likely as any other beforehand, with odds of 1 to 10."""
    size = np.linspace(0.0, MOST_DAMAGE, 200_001)
    odds = ODDS * np.exp((at / deviation) ** 2 / 2.0) * np.mean(np.exp(-(((size - at) / deviation) ** 2) / 2.0))
    model = Quadratic(A=np.array([[deviation**-2]]), g=np.array([at / deviation**2]), at=np.zeros(1))
    found = alternatives(model, Box(np.array([True]), np.zeros(1), np.full(1, MOST_DAMAGE)), np.array([False]))
    assert found.probability[0] == pytest.approx(odds / (1.0 + odds), rel=0.03)


def test_a_set_that_was_fitted_by_itself_counts_as_it_was_found():
    """Far from the answer the quadratic model expects 20 more of chi2 for the other zone; the fit found 4 less."""
    limits = Box(zones=np.array([True, True]), low=np.array([-0.3, 0.0]), high=np.array([0.6, 0.9]))
    model = Quadratic(A=np.array([[1e4, 9.8e3], [9.8e3, 1e4]]), g=np.zeros(2), at=np.array([0.3, 0.0]))
    answer, other = np.array([True, False]), np.array([False, True])
    model = Quadratic(A=model.A * 20.0 / (0.09 * 1e4 * (1.0 - 0.98**2)), g=model.g, at=model.at)
    found = alternatives(model, limits, answer)
    (rival,) = found.rivals(answer, limits)
    assert (found.kept[rival] == other).all()
    assert found.worth[rival] - found.worth.min() == pytest.approx(20.0)
    again = alternatives(model, limits, answer, [(other, -4.0, np.array([-0.3, 0.2]))])
    best, move = again.best
    assert (best == other).all()
    assert move == pytest.approx([-0.3, 0.2])
    assert again.probability[1] > 0.8


class TwoValleys(LeastSquares):
    """Two zones that read much alike; what the second one adds bends back, the more so the worse its valley is seen."""

    def __init__(self, damage, bend):
        self.bend = bend
        self.low, self.high, self.prior, self.steps = np.zeros(2), np.full(2, 0.95), np.full(2, 1e-9), np.full(2, 1e-6)
        self.simulated = self.size = self.zones = 2
        self.odds = np.full(2, 0.1)
        self.y, self.values = np.zeros(3), 3
        self.y = self.weigh(self.predict(np.array([damage])), np.zeros((1, 2)))[0]

    def predict(self, x):
        first, second = x.T
        return np.stack([first + second, 0.3 * first, self.bend * second * (second - 0.3)], axis=1)[:, None]

    def weigh(self, predicted, _):
        return 100.0 * predicted[:, 0]


@pytest.mark.parametrize(("bend", "seen"), [(5.0 / 3.0, 0), (0.6, 1)])
def test_a_zone_that_reads_much_like_the_damaged_one_is_tried_with_all_of_its_damage(bend, seen):
    """Whether the quadratic model sees its valley too or not, no set is listed twice."""
    problem, first = TwoValleys([0.0, 0.3], bend), np.array([True, False])
    found = descend(problem, np.array([0.2, 0.0]), first)
    J = problem.derivatives(found.point, np.ones(2, dtype=bool))
    model = problem.about(found.point, np.ones(2, dtype=bool), J)
    fit = Fit(problem, found.point, model, first, np.inf, J)
    assert found.point.chi2 > 50.0
    assert len(fit.likely.rivals(first, Box(np.ones(2, dtype=bool), -found.point.x, 0.95 - found.point.x))) == seen
    best = with_rivals(fit)
    assert best.point.x == pytest.approx([0.0, 0.3], abs=1e-3)
    ((kept, chi2, _),) = best.rivals
    assert kept.tolist() == [True, False]
    assert chi2 == found.point.chi2


def test_splines_weigh_by_the_inverse_of_the_covariance():
    """Against the dense covariance of the projected residuals, with gaps."""
    random = np.random.default_rng(2)
    n, length = 100, 10 * SPACING
    h = length / n
    present = random.random((4, n)) < 0.9
    noise, error = np.array([1.0, 2.0, 0.5, 1.0]), random.standard_normal((3, 4, n))
    splines = spline_matrix(n, h, length)
    P = np.vstack([np.kron(np.eye(4)[k], splines[t]) / noise[k] for k, t in np.argwhere(present)])
    e = np.vstack([(row / noise[:, None])[present] for row in error])
    S = P.T @ (np.eye(present.sum()) + e.T @ e) @ P
    r = random.standard_normal((4, n))
    c = P.T @ (r / noise[:, None])[present]
    weights = RecordWeights(present, noise, error, splines)
    z = weights.weigh(r[None])[0]
    assert weights.values == 4 * 13
    assert z @ z == pytest.approx(c @ np.linalg.solve(S, c), rel=1e-9)
    plain = RecordWeights(present, noise, error[:0]).weigh(r[None])[0]
    assert plain @ plain == pytest.approx(np.sum((r / noise[:, None])[present] ** 2))


@pytest.mark.parametrize("splines", [None, spline_matrix(60, SPACING / 8.0, 60 * SPACING / 8.0)])
def test_coloured_noise_is_weighed_by_the_inverse_of_its_covariance(splines):
    """Gaps make a first-order process no other one."""
    random, follows, noise = np.random.default_rng(7), np.array([0.7, 0.0]), np.array([2.0, 0.5])
    present, r = random.random((2, 60)) < 0.8, random.standard_normal((2, 60))
    apart = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    weights = RecordWeights(present, noise, np.zeros((0, 2, 60)), splines, follows=follows)
    square, determinant = 0.0, 0.0
    for row, seen, phi, s in zip(r, present, follows, noise, strict=True):
        P = np.eye(60)[:, seen] if splines is None else np.linalg.qr(splines * seen[:, None])[0]
        C, c = P.T @ phi**apart @ P, P.T @ row / s
        square, determinant = square + c @ np.linalg.solve(C, c), determinant + np.linalg.slogdet(C)[1]
    z = weights.weigh(r[None])[0]
    assert (z @ z, weights.log_determinant) == pytest.approx((square, determinant), rel=1e-9)


def test_a_learned_covariance_is_that_of_its_pairs():
    random = np.random.default_rng(4)
    n, h = 200, 12 * SPACING / 200
    shapes = spline_matrix(n, h, n * h)[:, 3:8]
    delta = 1e-3 * random.standard_normal((400, 4, 5)) @ shapes.T
    components = learn(delta, h, share=1.0)
    found = Discrepancy(elements_per_side=4, order=4, length=n * h, components=components, provenance={}).basis(n, h)
    expected = np.einsum("pit,pju->itju", delta, delta) / len(delta)
    np.testing.assert_allclose(np.einsum("pit,pju->itju", found, found), expected, atol=1e-12)
    with pytest.raises(DataError, match="too few"):
        learn(delta[:10], h)


def test_a_shrunk_covariance_keeps_its_diagonal():
    """On splines that are orthonormal at the samples, as the covariance is shrunk there."""
    random = np.random.default_rng(5)
    n, h = 120, 8 * SPACING / 120
    Q = np.linalg.qr(spline_matrix(n, h, n * h))[0]
    c = random.standard_normal((80, 2, Q.shape[1])) + random.standard_normal((80, 1, 1))
    components = learn(c @ Q.T, h, share=1.0, shrunk=0.3)
    found = Discrepancy(elements_per_side=4, order=4, length=n * h, components=components, provenance={}).basis(n, h) @ Q
    flat, own = found.reshape(len(found), -1), c.reshape(len(c), -1)
    S = own.T @ own / len(c)
    np.testing.assert_allclose(flat.T @ flat, np.where(np.eye(len(S), dtype=bool), S, 0.7 * S), atol=1e-10)


def test_the_shipped_discrepancy_survives_writing_and_refuses_another_file(tmp_path):
    shipped = default_discrepancy()
    assert (shipped.elements_per_side, shipped.order, shipped.length) == (4, 4, 0.3)
    write(tmp_path / "d.json", shipped.components, shipped.provenance)
    np.testing.assert_allclose(Discrepancy.read(tmp_path / "d.json").components, shipped.components, atol=1e-7)
    assert not shipped.basis(20, 0.1)[:, :, 3:].any()
    (tmp_path / "d.npz").write_bytes(b"nothing")
    with pytest.raises(ArtifactError, match="SHA-256"):
        Discrepancy.read(tmp_path / "d.json")
