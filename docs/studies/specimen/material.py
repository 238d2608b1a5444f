r"""SYNTHETIC sensor material: a tunnelling network in a rubber that flows, with junctions that break and mend.

It stands in for the thesis' specimen, whose measurements are not published, and belongs to none of the families that are
fitted to it: no Preisach operator, no fractional derivative, no sum of linear relaxation modes.

Symbols: :math:`\varepsilon` strain [1], ``v`` viscous strain of the bound rubber [1], ``q`` its elastic overstrain [1],
``g[j]`` rest width of the gaps of class j [m], ``s[j]`` present width [m], ``n[j]`` share of unbroken junctions [1],
``p[j]`` share of the class [1], ``R`` resistance [ohm].

.. math::
    q &= \varepsilon - v, \qquad \dot v = \frac{q_0}{\tau} \sinh\frac{q}{q_0}, \\
    s_j &= g_j \left(1 + X\,[(1 - \varphi)\,\varepsilon + \varphi\,v]\right), \\
    \dot n_j &= -k_b\,e^{(q + \chi \varepsilon)/f_0}\,n_j + k_m\,e^{-(s_j - \bar g)/\ell}\,(1 - n_j), \\
    R &= C\,(1 + \varepsilon)^2 \Big/ \sum_j p_j \left[n_j\,e^{-\beta s_j} + (1 - n_j)\,e^{-\beta (s_j + d)}\right].

The parameters have physical orders of magnitude (``SpecimenParams`` gives the reasons; those without a reference are
orders of magnitude only). A few were chosen by eye within those orders, so that gauge factor, loop and relaxation on
both levels of a hold resemble real sensors; the gauge factor, 8 at 7.5 %, is above the 4 of two measured bars of carbon
black in silicone. They were committed before any model was fitted to data of the specimen. They were not, and must not
be, tuned to make a model look good or bad. The specimen does not show the jump of resistance at the start of unloading
that some carbon-black sensors have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gossamer_models.arrays import Vector
from gossamer_models.errors import ConvergenceError, DataError, ParameterError
from numpy.typing import ArrayLike
from scipy.constants import electron_mass, electron_volt, hbar
from scipy.integrate import solve_ivp

RELATIVE_TOLERANCE = 1e-8  # of one step of the integrator
ABSOLUTE_TOLERANCE = 1e-10
GAP_CLASSES = 12  # nodes of a Gauss rule; they resolve the distribution to 1e-5 of the resistance
LARGEST_STRAIN = 0.5  # [1]; Section 1.2 requires no more of a sensor, and the rates of a junction would overflow beyond


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecimenParams:
    r"""Numbers of the synthetic material; the defaults are those of every dataset.

    Attributes
    ----------
    rest_resistance : float
        Resistance [ohm] of the recovered specimen without strain. Bars of carbon black in silicone read 1 to 3 kohm.
    barrier : float
        Height :math:`\phi` of the tunnelling barrier [eV]; :math:`\beta = 2\sqrt{2 m \phi}/\hbar` [1]_ [2]_ is 2.3 per nm,
        a tunnelling length :math:`2/\beta` of 0.9 nm, of the order of polymer nanocomposites [3]_.
    gap : float
        Median :math:`\bar g` [m] of the rest widths: tunnelling needs gaps of a few nanometres at most.
    gap_spread : float
        Standard deviation [1] of their logarithm.
    filler_fraction : float
        Volume fraction c [1] of carbon black; it amplifies the strain of the rubber between the aggregates by
        :math:`X = 1 + 2.5 c + 14.1 c^2` [4]_ [5]_.
    delayed_share : float
        :math:`\varphi` [1], the share of the opening of a gap that follows the flow of the bound rubber.
    relaxation_time : float
        :math:`\tau` [s] of the bound rubber at small overstrain: relaxation of filled rubber at 1 s to 100 s.
    overstrain_scale : float
        :math:`q_0` [1], the overstrain from which the flow is no longer linear, Eyring's law [6]_.
    breaking_rate : float
        :math:`k_b` [1/s] of a junction that carries no force, Bell's law [7]_.
    force_scale : float
        :math:`f_0` [1], the strain whose force speeds breaking up e times.
    static_share : float
        :math:`\chi` [1], force of a junction that remains at rest, as a share of that of a fast stretch.
    mending_rate : float
        :math:`k_m` [1/s] of the median gap: resistance of filled rubber recovers in minutes or longer.
    mending_length : float
        :math:`\ell` [m]: wider gaps mend e times slower for every :math:`\ell`, which spreads the times over decades.
    break_width : float
        d [m], growth of a gap when its junction breaks.

    References
    ----------
    .. [1] J. G. Simmons, Journal of Applied Physics 34(6), 1793-1803, 1963, doi:10.1063/1.1702682.
    .. [2] X.-W. Zhang, Y. Pan, Q. Zheng, X.-S. Yi, "Time dependence of piezoresistance for the conductor-filled polymer
       composites", Journal of Polymer Science B 38(21), 2739-2749, 2000.
    .. [3] G. Ambrosetti, C. Grimaldi, I. Balberg, T. Maeder, A. Danani, P. Ryser, Physical Review B 81, 155434, 2010,
       doi:10.1103/PhysRevB.81.155434.
    .. [4] E. Guth, Journal of Applied Physics 16(1), 20-25, 1945, doi:10.1063/1.1707495.
    .. [5] L. Mullins, N. R. Tobin, Journal of Applied Polymer Science 9(9), 2993-3009, 1965,
       doi:10.1002/app.1965.070090906.
    .. [6] H. Eyring, Journal of Chemical Physics 4(4), 283-291, 1936, doi:10.1063/1.1749836.
    .. [7] G. I. Bell, Science 200(4342), 618-627, 1978, doi:10.1126/science.347575.
    """

    rest_resistance: float = 1000.0
    barrier: float = 0.05
    gap: float = 1.2e-9
    gap_spread: float = 0.3
    filler_fraction: float = 0.1
    delayed_share: float = 0.1
    relaxation_time: float = 20.0
    overstrain_scale: float = 0.005
    breaking_rate: float = 3e-4
    force_scale: float = 0.006
    static_share: float = 0.03
    mending_rate: float = 5e-3
    mending_length: float = 0.3e-9
    break_width: float = 1.0e-9

    def __post_init__(self) -> None:
        for name in self.__slots__:
            if not (value := getattr(self, name)) > 0.0 or not np.isfinite(value):
                msg = f"{name} is {value:g}; every number of the specimen is positive and finite"
                raise ParameterError(msg)
        if self.delayed_share > 1.0:
            msg = f"delayed_share is {self.delayed_share:g}; it is a share of the opening, at most 1"
            raise ParameterError(msg)


class VirtualSpecimen:
    """Integrate the equations of the synthetic material over a strain history.

    Parameters
    ----------
    params : SpecimenParams, optional
        Numbers of the material.
    classes : int, optional
        Number of classes of gaps: nodes of the Gauss-Hermite rule over the logarithm of the width.
    """

    def __init__(self, params: SpecimenParams | None = None, *, classes: int = GAP_CLASSES) -> None:
        self.params = p = params or SpecimenParams()
        nodes, weights = np.polynomial.hermite_e.hermegauss(classes)
        self._g = p.gap * np.exp(p.gap_spread * nodes)
        self._p = weights / weights.sum()
        self._beta = 2.0 * np.sqrt(2.0 * electron_mass * p.barrier * electron_volt) / hbar
        self._X = 1.0 + 2.5 * p.filler_fraction + 14.1 * p.filler_fraction**2

    def resistance(self, time: ArrayLike, strain: ArrayLike) -> Vector:
        """Return the resistance [ohm] without noise; before the first sample the specimen has fully recovered.

        Parameters
        ----------
        time : array_like, shape (n,)
            Times [s], increasing.
        strain : array_like, shape (n,)
            Strain [1], linear between the samples; a first value that is not zero is a jump.

        Returns
        -------
        ndarray, shape (n,)
            Resistance [ohm].

        Raises
        ------
        DataError
            Times that do not increase, shapes that differ, a value that is not finite, strain beyond 0.5.
        ConvergenceError
            The integrator failed.

        Notes
        -----
        LSODA with relative tolerance 1e-8 and steps no longer than the time between samples, so that it misses no reversal:
        the datasets are accurate to 2e-8 of their values.
        """
        t, eps = np.asarray(time, dtype=float), np.asarray(strain, dtype=float)
        if t.ndim != 1 or t.size < 2 or t.shape != eps.shape:
            msg = f"time {t.shape} and strain {eps.shape} must be rows of one length, two samples or more"
            raise DataError(msg)
        if not (np.isfinite(t).all() and np.isfinite(eps).all() and (np.diff(t) > 0.0).all()):
            msg = "time must increase and all values must be finite. Sort the samples and drop the gaps."
            raise DataError(msg)
        if (largest := np.abs(eps).max()) > LARGEST_STRAIN:
            msg = f"strain reaches {largest:g}; the specimen is valid up to {LARGEST_STRAIN:g}. Divide percent by 100."
            raise DataError(msg)
        solution = solve_ivp(
            lambda at, state: self._rate(state, np.interp(at, t, eps)),
            (t[0], t[-1]),
            self._rest(),
            method="LSODA",
            t_eval=t,
            rtol=RELATIVE_TOLERANCE,
            atol=ABSOLUTE_TOLERANCE,
            max_step=np.diff(t).max(),
        )
        if not solution.success:
            msg = f"the specimen's equations were not solved: {solution.message} Take smaller or slower strain."
            raise ConvergenceError(msg)
        at_rest = self._conductance(self._rest()[:, None], np.zeros(1))
        stretch: Vector = (1.0 + eps) ** 2  # of a bar of constant volume: longer and thinner
        return self.params.rest_resistance * stretch * at_rest / self._conductance(solution.y, eps)

    def _rate(self, state: Vector, eps: float) -> Vector:
        p, v, n = self.params, state[0], state[1:]
        q = eps - v
        breaking = p.breaking_rate * np.exp((q + p.static_share * eps) / p.force_scale)
        mending = p.mending_rate * np.exp(-(self._widths(eps, v) - p.gap) / p.mending_length)
        flow = p.overstrain_scale / p.relaxation_time * np.sinh(q / p.overstrain_scale)
        return np.concatenate(([flow], mending * (1.0 - n) - breaking * n))

    def _rest(self) -> Vector:
        mending = self.params.mending_rate * np.exp(-(self._g - self.params.gap) / self.params.mending_length)
        return np.concatenate(([0.0], mending / (mending + self.params.breaking_rate)))

    def _widths(self, eps: float | Vector, v: float | Vector) -> Vector:
        share = self.params.delayed_share
        return np.multiply.outer(self._g, 1.0 + self._X * ((1.0 - share) * eps + share * v))

    def _conductance(self, state: Vector, eps: Vector) -> Vector:
        """Return the conductance, relative, at samples of the state, shape (1 + classes, samples)."""
        n = state[1:]
        broken = np.exp(-self._beta * self.params.break_width)
        result: Vector = self._p @ ((n + (1.0 - n) * broken) * np.exp(-self._beta * self._widths(eps, state[0])))
        return result
