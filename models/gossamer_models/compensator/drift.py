r"""A Kalman filter of the drift: the error of an estimated strain and of the sensor's eta.

Symbols: ``e`` error of the strain [1]; ``theta`` relative correction of ``nu``, and so of eta [1]; ``ee``, ``et``, ``tt``
their covariances [1].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca


@dataclass(frozen=True, slots=True)
class Drift:
    """Gaussian estimate of the errors of strain and of eta.

    Attributes
    ----------
    theta : casadi.MX, scalar
        Relative correction of ``nu`` in use [1].
    ee, et, tt : casadi.MX, scalar
        Covariances of the errors of strain and of ``theta`` [1].
    rounding : casadi.MX, scalar
        Error of strain [1] if every turning point that did not look sharp was sharp; it grows with their number.
    """

    theta: ca.MX
    ee: ca.MX
    et: ca.MX
    tt: ca.MX
    rounding: ca.MX

    def fall(self, drop: ca.MX) -> Drift:
        """Let ``drop`` [1] of output switch down: an error of eta becomes an error of strain."""
        ee = self.ee + 2.0 * drop * self.et + drop**2 * self.tt
        return replace(self, ee=ee, et=self.et + drop * self.tt)

    def add(self, variance: ca.MX, rounding: ca.MX) -> Drift:
        """Add an independent error of strain by its variance [1], and one that rounding may have left [1]."""
        return replace(self, ee=self.ee + variance, rounding=self.rounding + rounding)

    def learn(self, error: ca.MX, variance: ca.MX, weight: ca.MX, least: ca.MX) -> Drift:
        """Update with a measured error of strain.

        Parameters
        ----------
        error, variance : casadi.MX, scalar
            Error of strain [1] and the variance of its measurement [1]; the strain itself is corrected elsewhere.
        weight : casadi.MX, scalar
            From 0, no measurement, to 1.
        least : casadi.MX, scalar
            Variance of ``theta`` [1] that always remains.
        """
        gain = weight / (self.ee + variance)
        left = 1.0 - gain * self.ee
        return Drift(
            theta=self.theta + self.et * error * (weight > 0.0) / (self.ee + variance),
            ee=left * self.ee,
            et=left * self.et,
            tt=ca.fmax(self.tt - gain * self.et**2, least),
            rounding=(1.0 - weight) * self.rounding,
        )

    @property
    def variance(self) -> ca.MX:
        """Variance of the error of strain [1]."""
        return self.ee + self.rounding**2
