r"""A free rigid body with momentum wheels: its motion over one step.

Symbols: ``q`` attitude, a unit quaternion (scalar first) that turns body axes to inertial ones, ``R`` its matrix; ``X``
position of the centre of mass [m], ``P`` momentum [kg m/s], ``L`` angular momentum about the centre of mass, wheels
included [kg m2/s], in inertial axes; in body axes ``l`` angular momentum of the wheels relative to the body [kg m2/s],
``w`` angular velocity [rad/s], ``c`` centre of mass [m], ``J`` inertia about it [kg m2], wheels included, ``tau``
torque on the wheels [N m]; ``M`` mass [kg]; ``F`` force [N] and ``T`` torque about the body's origin [N m] in body
axes, ``j`` impulse [N s] and ``k`` angular impulse about the origin [N m s] in inertial axes; ``h`` step [s].
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a rigid body.

    Attributes
    ----------
    X, P, L : casadi.MX, shape (3,)
        Position [m], momentum [kg m/s] and angular momentum [kg m2/s] of the centre of mass, in inertial axes.
    q : casadi.MX, shape (4,)
        Attitude [1].
    l : casadi.MX, shape (3,)
        Angular momentum of the wheels [kg m2/s], in body axes.
    """

    X: ca.MX
    P: ca.MX
    L: ca.MX
    q: ca.MX
    l: ca.MX


@dataclass(frozen=True, slots=True)
class Body:
    """Mass properties in body axes.

    Attributes
    ----------
    M : casadi.MX, scalar
        Mass [kg].
    c : casadi.MX, shape (3,)
        Centre of mass from the body's origin [m].
    J : casadi.MX, shape (3, 3)
        Inertia about the centre of mass [kg m2].
    """

    M: ca.MX
    c: ca.MX
    J: ca.MX

    def motion(self, O: ca.MX, V: ca.MX, q: ca.MX, w: ca.MX, l: ca.MX) -> Motion:
        """Return the motion with a place [m] and velocity [m/s] of the body's origin, attitude, rate and wheels."""
        R = rotation(q)
        P = self.M * (V + ca.mtimes(R, ca.cross(w, self.c)))
        return Motion(O + ca.mtimes(R, self.c), P, ca.mtimes(R, ca.mtimes(self.J, w) + l), q, l)

    def angular_velocity(self, motion: Motion) -> ca.MX:
        """Return the angular velocity [rad/s] in body axes."""
        return ca.mtimes(inverse(self.J), ca.mtimes(rotation(motion.q).T, motion.L) - motion.l)

    def origin(self, motion: Motion) -> tuple[ca.MX, ca.MX]:
        """Return position [m] and velocity [m/s] of the body's origin, in inertial axes."""
        R = rotation(motion.q)
        turning = ca.cross(self.angular_velocity(motion), self.c)
        return motion.X - ca.mtimes(R, self.c), motion.P / self.M - ca.mtimes(R, turning)


def rotation(q: ca.MX) -> ca.MX:
    """Return the matrix, shape (3, 3), that turns body axes to inertial ones."""
    Q = ca.skew(q[1:])
    return ca.MX.eye(3) + 2.0 * q[0] * Q + 2.0 * ca.mtimes(Q, Q)


def inverse(J: ca.MX) -> ca.MX:
    """Return the inverse of a matrix, shape (3, 3), from its cofactors."""
    x, y, z = ca.horzsplit(J)
    rows = ca.horzcat(ca.cross(y, z), ca.cross(z, x), ca.cross(x, y)).T
    return rows / ca.dot(x, ca.cross(y, z))


def turned(q: ca.MX, angle: ca.MX) -> ca.MX:
    """Return an attitude turned by a small angle about body axes [rad], shape (3,), right to second order."""
    q_next = q + ca.vertcat(-ca.dot(q[1:], angle), q[0] * angle + ca.cross(q[1:], angle)) / 2.0
    return q_next / ca.norm_2(q_next)


def between(q: ca.MX, q_next: ca.MX) -> ca.MX:
    """Return the attitude half way between two that are near each other, and that of one if they are equal."""
    return (q + q_next) / ca.norm_2(q + q_next)


def impulse(q: ca.MX, W: ca.MX, h: ca.MX) -> ca.MX:
    """Return force [N] and torque [N m] in body axes, shape (6,), times a step, in the inertial axes of one attitude."""
    R = rotation(q)
    return h * ca.mtimes(ca.diagcat(R, R), W)


def advance(motion: Motion, body: Body, W: ca.MX, tau: ca.MX, J: ca.MX, h: ca.MX) -> Motion:
    r"""Advance by a step.

    Parameters
    ----------
    motion : Motion
        At the beginning.
    body : Body
        Its mass.
    W : casadi.MX, shape (6,)
        Force [N] and torque about the body's origin [N m], constant in body axes.
    tau : casadi.MX, shape (3,)
        Torque on the wheels [N m], constant.
    J : casadi.MX, shape (6,)
        Impulse j [N s], and angular impulse k about the body's origin [N m s], that the body takes up over the step
        beside that, at a constant rate in inertial axes.
    h : casadi.MX, scalar
        Step [s].

    Notes
    -----
    The classical Runge-Kutta method of fourth order for

    .. math:: \dot X = P/M, \quad \dot P = R F + j/h, \quad \dot l = \tau, \quad
        \dot L = R\,(T - c \times F) + (k - R c \times j)/h

    and :math:`\dot q = \tfrac12\,q \circ w` with :math:`w = J^{-1} (R^T L - l)`. Momentum and angular momentum are
    states in inertial axes, so they take up an impulse to round-off, and torques of the wheels leave them alone. The
    quaternion is normalised after the step.
    """

    def rate(y: ca.MX) -> ca.MX:
        now = _motion(y)
        q, R, w = now.q, rotation(now.q), body.angular_velocity(now)
        turning = ca.vertcat(-ca.dot(q[1:], w), q[0] * w + ca.cross(q[1:], w)) / 2.0
        push = ca.mtimes(R, W[:3]) + J[:3] / h
        torque = ca.mtimes(R, W[3:]) + J[3:] / h - ca.cross(ca.mtimes(R, body.c), push)
        return ca.vertcat(now.P / body.M, push, torque, turning, tau)

    y = ca.vertcat(motion.X, motion.P, motion.L, motion.q, motion.l)
    k1 = rate(y)
    k2 = rate(y + h / 2.0 * k1)
    k3 = rate(y + h / 2.0 * k2)
    k4 = rate(y + h * k3)
    end = _motion(y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
    return Motion(end.X, end.P, end.L, end.q / ca.norm_2(end.q), end.l)


def _motion(y: ca.MX) -> Motion:
    return Motion(*ca.vertsplit(y, [0, 3, 6, 9, 13, 16]))
