r"""Fit the modified Preisach model to records.

Symbols: ``y`` output over its range [1], ``mu``, ``eta`` densities, ``nu = eta*mu``; per kernel :math:`\tau, c` and the
amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; :math:`y_0` offset; :math:`v` what still relaxed when it began.

.. math:: y = U\mu - D\nu + Z w + e^{-\lambda t} v + y_0

with the matrices of ``regressors.py``. The output is linear in the amplitudes of mu, in g, k, v and y_0; wave numbers, eta,
:math:`\tau` and c are found by the constrained Gauss-Newton method of ``least_squares.py``. The error is that of Eq. (4.18).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..sensor.artifact import DirectInverse, Scales, SensorArtifact
from .inverse import inverse_settings, turn
from .least_squares import GaussNewton, Solution
from .model import preisach_model
from .normalise import normalised_output, normalised_sensor
from .parameters import Block
from .records import Record
from .ridge import choose_ridge
from .settings import FitSettings
from .solve import Watch, solve
from .stretches import Stretch, check_rest, earlier_output, prepare, strain_range

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Result of a fit.

    Attributes
    ----------
    artifact : SensorArtifact
        Normalised sensor, ready to build from.
    settings : FitSettings
        How it was fitted.
    full_scale : float
        Strain [1] of the end of the range.
    offset, scale : float
        Output of a record = offset + scale * normalised output, in the record's unit.
    names : tuple of str, length n
        Names of the parameters.
    x : ndarray, shape (n,)
        Their values.
    predicted : tuple of ndarray
        Output that the artifact gives for every record, in its unit, with what was relaxing before it began.
    train : tuple of ndarray of bool
        Samples of every record that were fitted.
    solutions : tuple of Solution
        One per start; the first is the best.
    solver : GaussNewton
        For derivatives at the solution.
    blocks : tuple of Block
        Parameters by group.
    """

    artifact: SensorArtifact
    settings: FitSettings
    full_scale: float
    offset: float
    scale: float
    names: tuple[str, ...]
    x: Vector
    predicted: tuple[Vector, ...]
    train: tuple[NDArray[np.bool_], ...]
    solutions: tuple[Solution, ...]
    solver: GaussNewton
    blocks: tuple[Block, ...] = field(repr=False)


def fit_preisach(
    records: tuple[Record, ...],
    train: tuple[NDArray[np.bool_], ...],
    settings: FitSettings | None = None,
    *,
    full_scale: float | None = None,
    rest_output: float | None = None,
    watch: Watch | None = None,
) -> Fit:
    """Fit one sensor to one or several records.

    Parameters
    ----------
    records : tuple of Record
        All start at rest but for what ``settings.earlier`` allows.
    train : tuple of ndarray of bool
        Samples of each record to fit.
    settings : FitSettings or None
        None for the thesis' model.
    full_scale : float or None
        Strain [1] at the end of the range; None for the largest in the records.
    rest_output : float or None
        Output of the unstrained sensor at rest, where it is known; None to fit it.
    watch : callable, optional
        Called with the name of the start, the iteration and the root mean square error [% of range].

    Returns
    -------
    Fit
        Sensor, parameters and predictions.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    settings = settings or FitSettings()
    check_rest(rest_output)
    scale = strain_range(records, full_scale)
    if settings.auto_ridge:
        settings = choose_ridge(records, train, settings, full_scale=scale, rest_output=rest_output, watch=watch)
    unit, spectrum, stretches = prepare(records, train, settings, scale)
    model = preisach_model(settings, spectrum, stretches, None if rest_output is None else rest_output / unit)
    solver, solutions = solve(model, stretches, settings, watch)
    x = solutions[0].x
    longest = 2.0 * max(float(r.time[-1]) for r in records)
    artifact, y0, rise = normalised_sensor(settings, model, x, float(spectrum.times[1]), longest)
    if settings.direct_inverse or not settings.invertible:
        artifact = replace(artifact, inverse=_direct_inverse(stretches, y0, rise, settings))
    if y0 > 0.0:  # a resistance, not a signal
        scales = Scales(rest_resistance=y0 * unit, full_scale_resistance_change=rise * unit, full_scale_strain=scale)
        artifact = replace(artifact, scales=scales)
    own = tuple(y0 + rise * normalised_output(artifact, s) for s in stretches)
    if settings.earlier:
        own = tuple(
            y + earlier_output(settings, spectrum, s, model.weights(x)) for y, s in zip(own, stretches, strict=True)
        )
    return Fit(
        artifact=artifact,
        settings=settings,
        full_scale=scale,
        offset=y0 * unit,
        scale=rise * unit,
        names=tuple(f"{b.name}[{i + 1}]" for b in model.blocks for i in range(b.size)),
        x=x,
        predicted=tuple(unit * y for y in own),
        train=tuple(s.train for s in stretches),
        solutions=solutions,
        solver=solver,
        blocks=model.blocks,
    )


def with_provenance(fit: Fit, provenance: dict[str, str]) -> Fit:
    """Return the fit with a provenance in its artifact."""
    return replace(fit, artifact=replace(fit.artifact, provenance=provenance))


def _direct_inverse(stretches: tuple[Stretch, ...], y0: float, rise: float, forward: FitSettings) -> DirectInverse:
    """Fit the operators from output to strain, on the training stretches."""
    turned = turn(stretches, y0, rise)
    found = fit_preisach(turned.records, turned.train, inverse_settings(turned, forward), full_scale=1.0)
    law = replace(found.artifact, scales=None)
    return DirectInverse(law=law, lowest=turned.lowest, highest=turned.highest, offset=found.offset, scale=found.scale)
