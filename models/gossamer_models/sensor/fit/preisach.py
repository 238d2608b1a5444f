r"""Fit the modified Preisach model to records.

Symbols: ``y`` resistance over its range [1], ``mu``, ``eta`` densities, ``nu = eta*mu``; per kernel :math:`\tau, c` and the
amplitudes :math:`g, k` of :math:`A(\zeta) = g + k\zeta`; :math:`y_0` at rest; :math:`v` relaxation from before a record
began.

The resistance, ``Stretch.response``, is linear in the amplitudes of mu, in g, k, v and y_0; wave numbers, eta, :math:`\tau`
and c come from the constrained Gauss-Newton method of ``fitting/constrained.py``. The error is that of Eq. (4.18) of
the thesis.

The direct inverse from resistance to strain is fitted by itself, see ``direct.py``.
"""

from dataclasses import dataclass, field, replace
from typing import Unpack

from ...arrays import Matrix, Rows, Vector
from ...fitting.constrained import GaussNewton, Solution
from ...fitting.errors import SensorFit
from ...fitting.records import Record, check_rest, forward_cuts, noise_of, strain_range
from ..artifact import DirectInverse, Scales, SensorArtifact
from .direct import fit_direct
from .endurance import MOST_RANGE, settled_range
from .networks import choose_steps, corrections, features_of
from .networks import train as train_network
from .parameters import ParameterBlock
from .regression import prepare
from .settings import Given, PreisachSettings
from .solve import Watch, choose_ridge, solve
from .weights import normalised_output, normalised_sensor, weight_function


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
        weights = weight_function(settings, regression, rest_resistance)
        solver, solutions = solve(weights, regression, settings, watch)
        x, unit = solutions[0].x, regression.unit
        artifact, y0, rise = normalised_sensor(settings, weights, x, regression)
        settles = not forgetting or rise * settled_range(artifact, regression) <= MOST_RANGE
        if settles:
            break
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
    if settings.residual:
        fit = _with_network(fit, int(settings.residual))
    if inverse and (settings.direct_inverse or not settings.invertible or settings.residual):
        fit = with_direct(fit, fit_direct(records, train, full_scale, delay=settings.delay, seed=settings.seed))
    return fit


def with_direct(fit: PreisachFit, inverse: DirectInverse) -> PreisachFit:
    """Return a fit with a direct inverse whose range is in the units of the records [ohm]."""
    low, high = ((end - fit.rest_resistance) / fit.resistance_change for end in (inverse.lowest, inverse.highest))
    return replace(fit, artifact=replace(fit.artifact, inverse=replace(inverse, lowest=low, highest=high)))


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
