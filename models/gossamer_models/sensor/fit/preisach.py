r"""Fit the modified Preisach model to records.

Symbols: ``y`` resistance over its range [1], ``mu``, ``eta`` densities, ``nu = eta*mu``; per kernel :math:`\tau, c` and the
amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; :math:`y_0` at rest; :math:`v` relaxation from before a record
began.

The resistance, ``Stretch.response``, is linear in the amplitudes of mu, in g, k, v and y_0; wave numbers, eta, :math:`\tau`
and c come from the constrained Gauss-Newton method of ``fitting/constrained.py``. The error is that of Eq. (4.18) of
the thesis.

The direct inverse from resistance to strain is a fit to records with both exchanged, with operators of either sign.
"""

from dataclasses import dataclass, field, replace
from typing import Unpack

import numpy as np

from ...arrays import Matrix, Rows, Vector
from ...fitting.constrained import GaussNewton, Solution
from ...fitting.errors import SensorFit
from ...fitting.records import Record, check_rest, forward_cuts, noise_of, strain_range
from ..artifact import MIN_SPRING_WEIGHT, DirectInverse, Scales, SensorArtifact
from .endurance import MOST_RANGE, settled_range
from .parameters import ParameterBlock
from .regression import Stretch, prepare
from .residual import choose_steps, corrections, features_of
from .residual import train as train_network
from .settings import Given, PreisachSettings
from .solve import Watch, choose_ridge, solve
from .weights import normalised_output, normalised_sensor, weight_function

SHORTEST, LONGEST = 0.15, 0.25  # of a sample and of the record: times of the kernels
LEAST_RELAXATIONS = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class Turned:
    """Records whose strain is the sensor's output and whose output is the strain.

    Attributes
    ----------
    records : tuple of Record
        The fitted records, output over its range in place of strain.
    train : tuple of ndarray of bool
        Samples to fit.
    lowest, highest : float
        Normalised output [1] at the ends of that range.
    """

    records: tuple[Record, ...]
    train: tuple[Rows, ...]
    lowest: float
    highest: float


def turn(stretches: tuple[Stretch, ...], y0: float, rise: float) -> Turned:
    """Exchange strain and resistance, which is ``y0 + rise * normalised output``."""
    fitted = [s for s in stretches if s.train.any()]
    outputs = [(s.y - y0) / rise for s in fitted]
    lowest = min(float(v[s.train].min()) for v, s in zip(outputs, fitted, strict=True))
    highest = max(float(v[s.train].max()) for v, s in zip(outputs, fitted, strict=True))
    records = tuple(
        replace(s.record, strain=np.clip((v - lowest) / (highest - lowest), 0.0, 1.0), resistance=s.strain)
        for v, s in zip(outputs, fitted, strict=True)
    )
    return Turned(records=records, train=tuple(s.train for s in fitted), lowest=lowest, highest=highest)


def inverse_settings(turned: Turned, forward: PreisachSettings) -> PreisachSettings:
    """Return how to fit turned records: with as many kernels as forward, and a gain where the sensor has one."""
    shortest = min(float(np.median(np.diff(r.time))) for r in turned.records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(turned.records, turned.train, strict=True))
    tau = np.geomspace(SHORTEST * shortest, LONGEST * longest, max(forward.relaxations, LEAST_RELAXATIONS))
    how = forward.inverse
    return PreisachSettings(
        density="hats",
        knots=how.knots,
        relaxations=tau.size,
        tau=tuple(tau.tolist()),
        exponents=(1.0,) * tau.size,
        extension=how.extension or ("reversing" if any(drive.gain for drive in forward.drives) else "falling"),
        signed=True,
        eta=(1.0, 1.0),
        ridge=how.ridge,
        earlier=forward.earlier if how.earlier is None else how.earlier,
        least_slope=MIN_SPRING_WEIGHT,
        least_weight=0.0,
        starts=1,
    )


@dataclass(frozen=True, kw_only=True)
class PreisachFit(SensorFit):
    """Result of a fit; ``predicted`` has the relaxation from before each record began.

    Attributes
    ----------
    artifact : SensorArtifact
        Normalised sensor, ready to build from.
    settings : PreisachSettings
        Settings of the fit.
    full_scale : float
        Strain [1] of the end of the range.
    resistance_change : float
        Resistance of a record [ohm] = rest_resistance + resistance_change * normalised output.
    x : ndarray, shape (n,)
        Parameters.
    alone : tuple of ndarray
        Resistance [ohm] without that relaxation: what an FMU gives, which cannot know it.
    solutions : tuple of Solution
        One per start; the first is the best.
    solver : GaussNewton
        For derivatives at the solution.
    blocks : tuple of ParameterBlock
        Parameters by group.
    settles : bool
        Whether the output of a sensor with a gain stays within ``MOST_RANGE`` over many cycles within the fitted strain.
    """

    artifact: SensorArtifact
    settings: PreisachSettings
    full_scale: float
    resistance_change: float
    x: Vector
    alone: tuple[Vector, ...]
    solutions: tuple[Solution, ...]
    solver: GaussNewton
    blocks: tuple[ParameterBlock, ...] = field(repr=False)
    settles: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, length n."""
        return tuple(f"{b.name}[{i + 1}]" for b in self.blocks for i in range(b.size))


def fit_preisach(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    settings: PreisachSettings | None = None,
    *,
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    positive_rest: bool = True,
    watch: Watch | None = None,
    inverse: bool = True,
) -> PreisachFit:
    """Fit one sensor to one or several records.

    Parameters
    ----------
    records : tuple of Record
        All start at rest, unless ``settings.earlier`` is set.
    train : tuple of ndarray of bool
        Samples of each record to fit.
    settings : PreisachSettings or None
        None for the thesis' model.
    full_scale : float or None
        Strain [1] at the end of the range; None for the largest in the records.
    rest_resistance : float or None
        Resistance [ohm] of the unstrained sensor at rest, where it is known; None to fit it.
    positive_rest : bool
        Keep the fitted resistance at rest positive where the output is nowhere negative, as that of a resistance.
    watch : callable, optional
        Called with the name of the start, the iteration and the root mean square error [% of range].
    inverse : bool
        False leaves the direct inverse out, for trials of the sensor alone.

    Returns
    -------
    PreisachFit
        Sensor, parameters and predictions.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    settings = settings or PreisachSettings()
    check_rest(rest_resistance)
    full_scale = strain_range(records, full_scale)
    given = Given(full_scale=full_scale, rest_resistance=rest_resistance)
    if settings.ridge == "auto":
        settings = choose_ridge(records, train, settings, watch=watch, **given)
    if settings.residual == "auto":
        settings = replace(settings, residual=residual_steps(records, train, settings, **given))
    for forgetting in settings.forgettings:
        settings = replace(settings, forgetting=forgetting)
        regression = prepare(records, train, settings, full_scale)
        weights = weight_function(settings, regression, rest_resistance, positive_rest=positive_rest)
        solver, solutions = solve(weights, regression, settings, watch)
        x, unit = solutions[0].x, regression.unit
        artifact, y0, rise = normalised_sensor(settings, weights, x, regression)
        settles = not forgetting or rise * settled_range(artifact, regression) <= MOST_RANGE
        if settles:
            break
    if inverse and (settings.direct_inverse or not settings.invertible or settings.residual):
        artifact = replace(artifact, inverse=_direct_inverse(regression.stretches, y0, rise, settings))
    if y0 > 0.0:  # a resistance, not a signal
        scales = Scales(rest_resistance=y0 * unit, full_scale_resistance_change=rise * unit, full_scale_strain=full_scale)
        artifact = replace(artifact, scales=scales)
    noise = noise_of(*(r.resistance[rows] for r, rows in zip(records, train, strict=True))) / (rise * unit)
    artifact = replace(artifact, noise=noise)
    earlier = weights(x).v
    outputs = (normalised_output(artifact, s.record.time, s.strain, s.U, s.D) for s in regression.stretches)
    alone = tuple(unit * (y0 + rise * output) for output in outputs)
    fit = PreisachFit(
        artifact=artifact,
        settings=settings,
        full_scale=full_scale,
        rest_resistance=y0 * unit,
        resistance_change=rise * unit,
        x=x,
        records=records,
        predicted=tuple(p + unit * (s.V @ earlier) for p, s in zip(alone, regression.stretches, strict=True)),
        alone=alone,
        train=train,
        solutions=solutions,
        solver=solver,
        blocks=weights.blocks,
        settles=settles,
    )
    return _with_network(fit, int(settings.residual)) if settings.residual else fit


def residual_steps(
    records: tuple[Record, ...], train: tuple[Rows, ...], settings: PreisachSettings, **given: Unpack[Given]
) -> int:
    """Return for how many steps a residual network is best trained, 0 for none; only training samples are used."""
    plain = replace(settings, residual=0)
    cuts = []
    for fitted, held in forward_cuts(train):
        fit = fit_preisach(records, fitted, plain, inverse=False, **given)
        cuts.append((*_left_over(fit), fitted, held))
    return choose_steps(cuts, seed=settings.seed)


def _left_over(fit: PreisachFit) -> tuple[list[Matrix], list[Vector]]:
    """Return the features of a sensor over every record, and the output [1] that it does not explain."""
    features = [features_of(fit.artifact, record, fit.full_scale) for record in fit.records]
    left = [(r.resistance - p) / fit.resistance_change for r, p in zip(fit.records, fit.predicted, strict=True)]
    return features, left


def _with_network(fit: PreisachFit, steps: int) -> PreisachFit:
    """Return a fit whose sensor is corrected by a network that was trained on what it leaves over."""
    features, left = _left_over(fit)
    network = train_network(features, left, fit.train, steps, seed=fit.settings.seed)
    changes = [fit.resistance_change * corrections(network, each) for each in features]
    return replace(
        fit,
        artifact=replace(fit.artifact, residual=network),
        predicted=tuple(p + change for p, change in zip(fit.predicted, changes, strict=True)),
        alone=tuple(p + change for p, change in zip(fit.alone, changes, strict=True)),
    )


def _direct_inverse(stretches: tuple[Stretch, ...], y0: float, rise: float, forward: PreisachSettings) -> DirectInverse:
    """Fit the operators from resistance to strain, on the training stretches."""
    turned = turn(stretches, y0, rise)
    settings = inverse_settings(turned, forward)
    fit = fit_preisach(turned.records, turned.train, settings, full_scale=1.0, positive_rest=False)
    return DirectInverse(
        law=replace(fit.artifact, scales=None, noise=None),
        lowest=turned.lowest,
        highest=turned.highest,
        offset=fit.rest_resistance,
        scale=fit.resistance_change,
    )
