r"""The hub as a pure step: a rigid body that carries a membrane or another appendage.

Symbols: those of ``rigid_body``; ``W`` force [N] and torque about the body's origin [N m] that the appendage exerts,
shape (6,), as the mean over its step; ``O`` and ``V`` place [m] and velocity [m/s] of the origin, ``a`` its
acceleration [m/s2]; ``h`` step [s]; ``u`` inputs and ``p`` parameters by name. There is no gravity: positions are those
in a frame that falls freely.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..step_model import StepModel
from ..variables import Results, Values
from .rigid_body import Body, Motion, advance, between, impulse, inverse, rotation, turned
from .table import VARIABLES


@dataclass(frozen=True, slots=True)
class HubState:
    """State of the hub.

    Attributes
    ----------
    O, V : casadi.MX, shape (3,)
        Place [m] and velocity [m/s] of the origin, in inertial axes.
    q : casadi.MX, shape (4,)
        Attitude [1].
    w, l : casadi.MX, shape (3,)
        Angular velocity [rad/s], and angular momentum of the wheels [kg m2/s], in body axes.
    taken : casadi.MX, shape (6,)
        Impulse [N s] and angular impulse about the origin [N m s] that the last step assumed, in inertial axes.
    q_half : casadi.MX, shape (4,)
        Attitude half way through the last step [1].
    W : casadi.MX, shape (6,)
        Force [N] and torque [N m] of the appendage that the last step received.
    h : casadi.MX, scalar
        Length of the last step [s]; 0 before the first.
    """

    O: ca.MX
    V: ca.MX
    q: ca.MX
    w: ca.MX
    l: ca.MX
    taken: ca.MX
    q_half: ca.MX
    W: ca.MX
    h: ca.MX


def hub_model() -> StepModel:
    r"""Build the step model of a rigid hub with wheels, thrusters and an appendage.

    Returns
    -------
    StepModel
        Model ``hub``.

    Notes
    -----
    Where the appendage steps after the hub, its force :math:`W_k` over step k arrives one step late. A step assumes
    that the force goes on as it was, and makes up for what the last step assumed wrongly:

    .. math:: h\,\bar W_{k+1} = h\,W_k + h_k\,(W_k - W_{k-1})

    With equal steps that is the linear extrapolation of the mean force. The difference is taken between impulses in
    inertial axes, so whatever the steps and however the hub turns, it receives all momentum and angular momentum that
    the appendage gives, but for the last difference. With ``extrapolation`` = 0 the force is that of the present step:
    for an appendage that steps before the hub, and within a group that is iterated. Then only the attitude half way is
    made up for, which is not known before the step.

    What is attached joins the hub's motion when it first arrives, which may be after the initialization. Motion over a
    step, for the appendage: :math:`\dot w = (w^+ - w)/h`, and :math:`a = \bar R^T (V^+ - V)/h` with the velocity V of
    the origin and the mean of the axes over the step, which lie :math:`\dot w h^2/12` before those half way.
    """

    def step(x: HubState, u: Values, p: Values, h: ca.MX) -> tuple[HubState, Results]:
        body, arrived = _body(u, p), ca.vertcat(u.force, u.torque)
        thrust = ca.vertcat(u.thruster_force, u.thruster_torque)
        O, V, q, w = x.O, x.V, x.q, x.w

        gave = impulse(x.q_half, p.extrapolation * arrived + (1.0 - p.extrapolation) * x.W, x.h)
        goes_on = impulse(turned(q, h / 2.0 * w), arrived, h)
        given = goes_on + gave - x.taken
        motion = advance(body.motion(O, V, q, w, x.l), body, thrust, u.wheel_torque, given, h)

        (O, V), q, w = body.origin(motion), motion.q, body.angular_velocity(motion)
        w_dot, q_half = (w - x.w) / h, between(x.q, q)
        mean_axes = rotation(turned(q_half, -(h**2) / 12.0 * w_dot))
        state = HubState(O, V, q, w, motion.l, goes_on, q_half, arrived, h)
        return state, results(state, motion, body, ca.mtimes(mean_axes.T, V - x.V) / h, w_dot)

    def init(u: Values, p: Values) -> tuple[HubState, Results]:
        body, W = _body(u, p), ca.vertcat(u.force, u.torque)
        O, V, w, l = p.initial_position, p.initial_velocity, p.initial_angular_velocity, p.initial_wheel_momentum
        q = p.initial_attitude / ca.norm_2(p.initial_attitude)
        F, T = u.thruster_force + u.force, u.thruster_torque + u.torque
        spin = ca.mtimes(body.J, w) + l
        w_dot = ca.mtimes(inverse(body.J), T - ca.cross(body.c, F) - u.wheel_torque - ca.cross(w, spin))
        a = F / body.M - ca.cross(w_dot, body.c) - ca.cross(w, ca.cross(w, body.c))
        state = HubState(O, V, q, w, l, ca.MX.zeros(6), q, W, ca.MX(0.0))
        return state, results(state, body.motion(O, V, q, w, l), body, a, w_dot)

    def results(x: HubState, motion: Motion, body: Body, a: ca.MX, w_dot: ca.MX) -> Results:
        return {
            "acceleration": a,
            "angular_acceleration": w_dot,
            "angular_velocity": x.w,
            "attitude": x.q,
            "position": x.O,
            "velocity": x.V,
            "wheel_momentum": x.l,
            "momentum": motion.P,
            "angular_momentum": motion.L + ca.cross(motion.X, motion.P),
            "kinetic_energy": ca.dot(motion.P, motion.P) / (2.0 * body.M) + ca.dot(x.w, ca.mtimes(body.J, x.w)) / 2.0,
        }

    return StepModel.written(
        name="hub",
        description="Rigid hub of a spacecraft with wheels, thrusters and an appendage",
        variables=VARIABLES,
        init=init,
        step=step,
        advice="Check mass and inertia, which must be positive, the attitude, forces and torques: a hub much lighter than "
        "its appendage needs a group that is iterated.",
    )


def _body(u: Values, p: Values) -> Body:
    """Add the appendage's part that is fixed to the hub."""
    M = p.mass + u.attached_mass
    c = (p.mass * p.centre_of_mass + u.attached_first_moment) / M
    about_origin = _matrix(p.inertia) + p.mass * _point(p.centre_of_mass) + _matrix(u.attached_inertia)
    return Body(M, c, about_origin - M * _point(c))


def _matrix(six: ca.MX) -> ca.MX:
    """Return a symmetric matrix from xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = ca.vertsplit(six)
    return ca.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _point(c: ca.MX) -> ca.MX:
    """Return the inertia of a unit mass at a place [m]."""
    return ca.dot(c, c) * ca.MX.eye(3) - ca.mtimes(c, c.T)
