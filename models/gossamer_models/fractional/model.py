r"""Fractional models: forward on a whole record, and sub-model-1 as a ``StepModel``.

Symbols: ``s`` strain over full scale [1], ``z[q]`` modes [s], ``w[q]`` their weights [1/s], ``mass`` of their kernels [1]
(``modes.py``), ``h`` step [s], ``p`` parameters by name; ``R`` resistance, ``R0`` at rest, ``dR`` change that an
output of one stands for [ohm]. Sub-model-1, Eq. (3.21) of [1]_, is

.. math:: R = R_0 + \Delta R\,(C_0 s + \sum_k C_k J^{a_k} s)
            = R_0 + \Delta R\,\bigl((C_0 + \mathrm{mass})\,s + \sum_q w_q z_q\bigr),
          \qquad \dot z_q = -\lambda_q z_q + s.

All orders share the modes, so a step costs the same for any number of terms and at any time of a record.

References
----------
.. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
   Sensors, dissertation, Virginia Tech, 2010, Chapter 3.
"""

from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
from gossamer_files.options import option

from ..arrays import Matrix, Vector
from ..errors import DataError, ParameterError
from ..modes import PowerLawKernels, phi_1, phi_2, responses
from ..sensor.model import RESISTANCE, SCALE_VARIABLES, STRAIN, TEMPERATURE, resistance, saturated
from ..step_model import StepModel
from ..variables import Variable
from .artifact import FractionalArtifact

_x = ca.SX.sym("x")
_PHI_SLOPES = ca.Function("slopes", [_x], [ca.jacobian(phi(_x), _x) for phi in (phi_1, phi_2)])


def quadrature(u: Vector) -> Vector:
    r"""Return the record with each Fourier component turned back by a quarter: cos -> sin, sin -> -cos; shape (m,).

    Notes
    -----
    The Hilbert transform: :math:`\epsilon_{Ph}` of Eq. (3.18) of [1]_ for b = -1. It needs the whole record and takes it as
    one period: not causal, offline only.
    """
    from scipy.signal import hilbert  # slow to import

    return np.asarray(np.imag(hilbert(u)))


def integral_modes(u: Vector, h: float, rates: Vector) -> Matrix:
    r"""Return the modes :math:`\int_0^t e^{-\lambda_q (t-\tau)} u\,d\tau` [unit of u times s] of a record, shape (m, n)."""
    return responses(h, u, rates, [(h, 1)])


def memory(v: Vector, h: float, rates: Vector, *, of_slope: bool) -> Matrix:
    r"""Return the modes of a record and, last, what the mass of their kernel multiplies, shape (m, n + 1).

    Nothing is remembered at t = 0. Modes of the slope are those of a record that jumps from zero to its first sample,
    :math:`z_q(t) = v_0 e^{-\lambda_q t} + \int_0^t e^{-\lambda_q (t - \tau)} \dot v\,d\tau` [unit of v]; at t = 0 the
    derivative of that jump is infinite, Eq. (3.11), and left out.
    """
    if of_slope:
        jump = v[0] * np.exp(-h * np.outer(np.arange(v.size), rates))
        found = np.column_stack([responses(h, v, rates, [(np.diff(v), 0)]) + jump, np.diff(v, prepend=v[:1]) / h])
    else:
        found = np.column_stack([integral_modes(v, h, rates), v])
    found[0] = 0.0
    return found


def fading_integral(s: Vector, h: float, rate: float, exponent: float) -> tuple[Vector, Vector, Vector]:
    r"""Return :math:`\int_0^t e^{-p(t-\tau)} s^q\,d\tau` [s] and its derivatives by rate p and exponent q, shape (m,).

    The power is linear between samples. The thesis uses the trapezoidal rule for the whole integrand, Eq. (3.20), which
    fails if :math:`p h` is not small; with :math:`s^q` as in Eq. (3.15). Negative strain counts as zero.
    """
    x, logs = ca.DM(rate * h), np.log(np.maximum(s, 1e-300))
    power = np.where(s > 0.0, np.exp(exponent * logs), 0.0)
    value, by_exponent = (integral_modes(u, h, np.array([rate]))[:, 0] for u in (power, logs * power))
    slope_1, slope_2 = (float(each) for each in _PHI_SLOPES(x))
    left = np.exp(-rate * h)
    from scipy.signal import lfilter  # slow to import

    gained = h**2 * ((slope_1 - slope_2) * power[:-1] + slope_2 * power[1:]) - h * left * value[:-1]
    return value, np.concatenate([[0.0], lfilter([1.0], [1.0, -left], gained)]), by_exponent


def check_covered(u: Vector, h: float, kernels: PowerLawKernels) -> None:
    """Raise ``DataError`` for a record that is not finite, or that the kernels do not cover."""
    if u.ndim != 1 or u.size < 2 or not (np.isfinite(u).all() and 0.0 < h < np.inf):
        msg = f"need a record of two or more finite samples and a positive step [s], not shape {u.shape} every {h!r} s"
        raise DataError(msg)
    lasts = h * (u.size - 1)
    if h < 0.999 * kernels.shortest or lasts > 1.001 * kernels.longest:
        msg = (
            f"a record of {lasts:g} s in steps of {h:g} s is outside the memory of {kernels.shortest:g} s to "
            f"{kernels.longest:g} s. Widen the range of the memory."
        )
        raise DataError(msg)


def predict(artifact: FractionalArtifact, strain: Vector, h: float) -> Vector:
    """Return the resistance [ohm], shape (m,), of a whole record: Eq. (3.15), (3.21) or (3.25) of [1]_.

    Parameters
    ----------
    artifact : FractionalArtifact
        Any of the three models.
    strain : ndarray, shape (m,)
        Strain [1] from the first loading on; linear between samples. Models with phases take it as one period.
    h : float
        Sampling step [s].

    Raises
    ------
    DataError
        The record is not finite, or outside the range of times of the artifact.
    """
    check_covered(strain, h, artifact.kernels)
    s = strain / artifact.full_scale_strain
    output = artifact.direct * s
    if artifact.terms:
        output = output + _remembered(artifact, s, h, "cosine")
    if any(term.phase for term in artifact.terms):
        output = output + _remembered(artifact, quadrature(s), h, "sine")
    for fading in artifact.fading:
        output = output + fading.coefficient * fading_integral(s, h, fading.rate, fading.exponent)[0]
    return np.asarray(artifact.rest_resistance + artifact.resistance_change * output)


def _remembered(artifact: FractionalArtifact, v: Vector, h: float, part: str) -> Vector:
    """Return the sum of all fractional terms on the record or on its quadrature [1], shape (m,)."""
    return np.asarray(
        memory(v, h, artifact.kernels.rates, of_slope=artifact.model == "model-1") @ summed_weights(artifact, part)
    )


def summed_weights(artifact: FractionalArtifact, part: str = "cosine") -> Vector:
    r"""Return weights of the modes and, last, mass of all fractional terms, on the record or on its quadrature.

    The kernels of :math:`D^a` and :math:`J^{1-a}` are the same. A term weighs the record with :math:`\cos(\pi b/2)`
    and its quadrature with :math:`-\sin(\pi b/2)`, which is the turn of Eqs. (3.16) and (3.18) of [1]_; Eq. (3.17) prints
    sine and cosine exchanged.
    """
    g = np.zeros(artifact.kernels.rates.size + 1)
    for term in artifact.terms:
        angle = 0.5 * np.pi * term.phase
        C = term.coefficient * (np.cos(angle) if part == "cosine" else -np.sin(angle))
        g += C * artifact.kernels.at_order(1.0 - term.order if artifact.model == "model-1" else term.order)
    return g


def fractional_sensor_model(artifact: FractionalArtifact) -> StepModel:
    """Build sub-model-1 as a sensor.

    Parameters
    ----------
    artifact : FractionalArtifact
        Identified sub-model-1.

    Returns
    -------
    StepModel
        The interface of ``sensor_model``: input ``strain`` [1]; outputs ``resistance`` [ohm] and ``saturated`` [1].

    Raises
    ------
    ParameterError
        Another model: phases need the whole record, so they cannot step.

    Notes
    -----
    The step is exact for strain that is linear over it, so a ramp may be cut into any steps. Its memory is that of
    the batch evaluation, so both give the same numbers. A fractional integral of a constant grows without end, so
    here it acts on the change of strain since the run began: a sensor at rest stays at rest. With ``rest_strain`` =
    0, as in the thesis, this is Eq. (3.21). Beyond full scale, the model continues outside its identified range, and
    ``saturated`` is 1.
    """
    if not artifact.can_step:
        msg = (
            f"the fractional {artifact.model} cannot step: its phases need the whole record, so it works offline only. "
            f"Identify the same records with {option('model', 'fractional-sub-model-1')}, or preisach."
        )
        raise ParameterError(msg)
    *weights, mass = summed_weights(artifact).tolist()
    rates, w = ca.DM(artifact.kernels.rates), ca.DM(weights)
    n = rates.numel()

    def init(u: SimpleNamespace, p: SimpleNamespace) -> tuple[ca.MX, dict[str, ca.MX]]:
        rest = p.rest_strain / p.full_scale_strain
        return ca.DM.zeros(n + 1), {"resistance": resistance(artifact.direct * rest, u, p), "saturated": rest > 1.0}

    def step(x: ca.MX, u: SimpleNamespace, p: SimpleNamespace, h: ca.MX) -> tuple[ca.MX, dict[str, ca.MX]]:
        z, before = x[:n], x[n]  # before, s: changes of strain since the run began [1]
        s = (u.strain - p.rest_strain) / p.full_scale_strain
        late = phi_2(rates * h)
        z = ca.exp(-rates * h) * z + h * ((phi_1(rates * h) - late) * before + late * s)
        output = artifact.direct * u.strain / p.full_scale_strain + mass * s + ca.dot(w, z)
        outside = ca.logic_or(u.strain > p.full_scale_strain, u.strain < 0.0)
        return ca.vertcat(z, s), {"resistance": resistance(output, u, p), "saturated": outside}

    return StepModel.written(
        name="sensor",  # scenarios and reports recognise it by this name
        description="Conductive polymer strain sensor with fractional memory",
        variables=(
            *_scale_variables(artifact),
            STRAIN,
            TEMPERATURE,
            RESISTANCE,
            saturated(description="1 if the strain is outside 0 to full scale, where the model is not identified, else 0"),
        ),
        init=init,
        step=step,
        advice="Inputs and steps must be of a sensible size.",
        provenance=dict(artifact.provenance),
    )


def _scale_variables(artifact: FractionalArtifact) -> tuple[Variable, ...]:
    """Return the sensor's parameters, same names and order, with the artifact's values and what they mean here."""
    rest, change, full_scale, rest_strain, *others = SCALE_VARIABLES
    return (
        # a signal that is no resistance may rest below zero
        replace(rest, start=artifact.rest_resistance, minimum=min(0.0, artifact.rest_resistance)),
        replace(
            change,
            start=artifact.resistance_change,
            description="Change of resistance that a model output of one stands for",
        ),
        replace(
            full_scale,
            start=artifact.full_scale_strain,
            description="Strain at the end of the identified range, which the model's strain is measured in",
        ),
        replace(rest_strain, description="Strain at which the run starts; its memory acts on the change from there"),
        *others,
    )
