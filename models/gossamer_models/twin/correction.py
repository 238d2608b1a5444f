"""The last stage of a search: the fit on the twin's mesh, with what a finer mesh adds to the prediction there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import ConvergenceError
from .forward import Forward
from .least_squares import Point, descend
from .oddities import chi2_bound
from .problem import RecordProblem
from .record import StaticRecord
from .search import FEW_STEPS, Fit, again, misfit, with_rivals

HOPELESS = 3.0  # chi2 per sample that no finer mesh explains
ROUNDS = 5
CLEAR = 3.0  # errors of the mesh over noise with which chi2 tells which mesh made the record
PLACES = 15  # unknowns that the finer mesh is differentiated by, unless more are kept: two runs of eight lanes
UNSEEN = 1e-12  # curvature: such a zone moves no sensor
SETTLED = 0.5  # deviations of a damage: a round that moves none by more is the last
SAME_NOISE = 0.9  # share of the noise below which what a fit leaves is another noise
# deviations of chi2 from the expected one below which what is fast in a membrane was taken for noise, and chi2 per sample
# below which there is no noise at all
OVERRATED, CLEAN = -2.0, 0.1


def corrected(fit: Fit, finer: Forward, components: Matrix, noise: Vector, *, sparse: bool, simulated: bool) -> Fit:
    """Return the fit to what a finer mesh predicts; one on the twin's mesh if it made the record, or is likelier.

    Parameters
    ----------
    fit : Fit
        On the twin's mesh, or one that was corrected under another noise.
    finer : Forward
        The same membrane on a finer mesh.
    components : ndarray, shape (k, s, n or more)
        Of the error of the finer mesh, in the record's unit, at the samples or in the states.
    noise : ndarray, shape (s,)
        Standard deviation of the noise, in the unit of the record.
    sparse : bool
        As of ``search``.
    simulated : bool
        Whether the mesh of the twin may have made the record: it has where noise alone explains what is left, and the error
        of the mesh is so much above the noise (``CLEAR``) that this says something.

    Notes
    -----
    Defect correction [1]_: the finer mesh is simulated at the fit and beside it, once a round, and what it adds there is
    added everywhere, to first order in load, material, the damages that are kept and the likeliest others (``PLACES``).
    With the load and material of the twin's mesh the rounds creep: what is fast has another phase on the finer one, so
    that a round makes a tenth of the move that is needed, and seems to be the last. Where damages still move after the
    last round, its move is part of their deviations.

    References
    ----------
    .. [1] K. Bohmer, P. W. Hemker, H. J. Stetter, Computing Supplementum 5, 1-32, 1984, doi:10.1007/978-3-7091-7023-6_1.
    """
    own = problem = fit.problem.under(noise)
    hopeless = fit.per_sample >= HOPELESS
    found, settled, move = fit, False, np.zeros(fit.problem.zones)
    if hopeless or (own.added is None and simulated and own.mesh_over_noise > CLEAR and _made_by(own, fit)):
        return again(fit, own, sparse=sparse, hopeless=hopeless)
    for k in range(ROUNDS):
        try:
            problem = problem.corrected(finer, found.point, *differentiated(found), components)
        except ConvergenceError:
            break
        before, found = found, again(found, problem, sparse=sparse, rounds=1, rivals=False)  # scales: once a round
        if found is before:  # the fit failed
            break
        settled = moved(before, found) < SETTLED
        if sparse and found.passes and (settled or k == ROUNDS - 1):
            found = with_rivals(found)
            settled = settled and np.array_equal(found.kept, before.kept)
        problem = found.problem
        move = np.abs(found.point.x - before.point.x)[: problem.zones]
        if settled:
            break
    if settled and found.passes:
        return replace(found, vague=0.0)
    if own.added is not None and found is not fit:
        return replace(found, vague=move)
    plain = again(fit, own, sparse=sparse)
    return replace(found, vague=move) if found is not fit and found.unlikely < plain.unlikely else plain


def noise_left(problem: RecordProblem, point: Point) -> Vector:
    """Return the noise that a point leaves of a record, shape (s,), or that which it was weighed by where that is known."""
    if problem.record.noise is not None or isinstance(problem.record, StaticRecord):
        return problem.noise
    noise = np.fmin(problem.noise, problem.record.noise_deviation(problem.reading(point)))
    per_sample = point.chi2 / problem.values
    overrated = misfit(problem, point) < OVERRATED and per_sample > CLEAN and len(problem.components)
    return np.fmin(noise, problem.noise * math.sqrt(per_sample)) if overrated and problem.sensor_error is None else noise


def differentiated(fit: Fit) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return unknowns by which a finer mesh is differentiated, and those of them that are needed.

    Needed are the simulated ones that are kept, and all faults; the others are the dropped damages by which chi2 falls most.
    Faults are few, and one that the coarse mesh tells wrongly would never be looked at.
    """
    gain = np.maximum(fit.model.g, 0.0) ** 2 / np.maximum(np.diag(fit.model.A), UNSEEN)  # dropped damages may only rise
    unknowns = np.arange(fit.kept.size)
    always = fit.kept | ((unknowns >= fit.problem.whole) & (unknowns < fit.problem.zones))
    gain = np.where(always, np.inf, gain)[: fit.problem.simulated]
    needed = np.flatnonzero(always[: gain.size])
    return np.sort(np.argsort(-gain, kind="stable")[: max(PLACES, needed.size)]), needed


def _made_by(own: RecordProblem, fit: Fit) -> bool:
    """Tell whether the mesh of the twin has made a record, so that noise alone explains what is left."""
    alone = own.without_mesh_error()
    try:
        return descend(alone, fit.point.x, fit.kept, FEW_STEPS).point.chi2 <= chi2_bound(alone) * alone.values
    except ConvergenceError:
        return False


def moved(before: Fit, after: Fit) -> float:
    """Return by how many of its deviations a damage moved between two fits, at most; infinite where others are kept."""
    zones = after.problem.zones
    if not np.array_equal(before.kept[:zones], after.kept[:zones]):
        return math.inf
    kept = after.kept
    variance = np.diag(np.linalg.pinv(after.model.A[np.ix_(kept, kept)], hermitian=True))[: int(kept[:zones].sum())]
    moves = (after.point.x - before.point.x)[:zones][kept[:zones]]
    return float(np.abs(moves / np.sqrt(variance)).max(initial=0.0))
