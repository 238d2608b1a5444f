r"""A rigid hub that flies, where no other program simulates the spacecraft: a body with wheels that carries a membrane.

Symbols: ``q`` attitude, a unit quaternion (scalar first) that turns body axes to inertial ones, ``R`` its matrix; ``X``
position of the centre of mass [m], ``P`` momentum [kg m/s], ``L`` angular momentum about the centre of mass, wheels
included [kg m2/s], in inertial axes; ``O`` and ``V`` place [m] and velocity [m/s] of the body's origin, ``a`` its
acceleration [m/s2]; in body axes ``l`` angular momentum of the wheels relative to the body [kg m2/s], ``w`` angular
velocity [rad/s], ``c`` centre of mass [m], ``J`` inertia about it [kg m2], wheels included, ``tau`` torque on the wheels
[N m]; ``M`` mass [kg]; ``F`` force [N] and ``T`` torque about the origin [N m] in body axes, ``W`` both, shape (6,), that
the appendage exerts, as the mean over its step; ``j`` impulse [N s] and ``k`` angular impulse about the origin [N m s] in
inertial axes; ``h`` step [s]; ``u`` inputs and ``p`` parameters by name. There is no gravity: positions are those in a
frame that falls freely.
"""

from dataclasses import dataclass, replace

import casadi as ca

from .step_model import StepModel
from .variables import Results, Values, array, input_, local, output, pack, parameter, unpack

_INERTIA, _QUATERNION = ("xx", "yy", "zz", "xy", "xz", "yz"), ("scalar", "x", "y", "z")
_BODY, _INERTIAL = "in body axes", "in inertial axes"
_BEGINS = "when the run begins"
VARIABLES = (
    parameter("mass", "kg", "Mass of the hub", 120.0, 1e-6, 1e9),
    *array(parameter, "centre_of_mass", "m", f"Centre of mass of the hub from its origin, {_BODY}", 0.0, 1e4),
    *array(
        parameter,
        "inertia",
        "kg m2",
        f"Inertia of the hub about its centre of mass, {_BODY}",
        (90.0, 80.0, 60.0, 0.0, 0.0, 0.0),
        1e12,
        parts=_INERTIA,
    ),
    *array(parameter, "initial_position", "m", f"Position of the hub's origin {_BEGINS}, {_INERTIAL}", 0.0, 1e12),
    *array(parameter, "initial_velocity", "m/s", f"Velocity of the hub's origin {_BEGINS}, {_INERTIAL}", 0.0, 1e6),
    *array(
        parameter,
        "initial_attitude",
        "1",
        f"Quaternion from body to inertial axes {_BEGINS}, of any length",
        (1.0, 0.0, 0.0, 0.0),
        1e3,
        parts=_QUATERNION,
    ),
    *array(parameter, "initial_angular_velocity", "rad/s", f"Angular velocity {_BEGINS}, {_BODY}", 0.0, 1e3),
    *array(parameter, "initial_wheel_momentum", "kg m2/s", f"Angular momentum of the wheels {_BEGINS}, {_BODY}", 0.0, 1e9),
    parameter(
        "extrapolation",
        "1",
        "1 if force and torque of the appendage are those of the last step, 0 if they are those of the present one",
        1.0,
        0.0,
        1.0,
    ),
    *array(input_, "force", "N", f"Force of the appendage, mean over its step, {_BODY}", 0.0, 1e9),
    *array(
        input_, "torque", "N m", f"Torque of the appendage about the hub's origin, mean over its step, {_BODY}", 0.0, 1e9
    ),
    *array(input_, "thruster_force", "N", f"Force of the thrusters, {_BODY}", 0.0, 1e9),
    *array(input_, "thruster_torque", "N m", f"Torque of the thrusters about the hub's origin, {_BODY}", 0.0, 1e9),
    *array(
        input_,
        "wheel_torque",
        "N m",
        f"Torque of the motors on the wheels, the opposite of that on the hub, {_BODY}",
        0.0,
        1e9,
    ),
    input_("attached_mass", "kg", "Mass of the appendage's part that is fixed to the hub; constant", 0.0, 0.0, 1e9),
    *array(input_, "attached_first_moment", "kg m", f"Its mass times place from the hub's origin, {_BODY}", 0.0, 1e9),
    *array(input_, "attached_inertia", "kg m2", f"Its inertia about the hub's origin, {_BODY}", 0.0, 1e9, parts=_INERTIA),
    *array(
        output,
        "acceleration",
        "m/s2",
        "Acceleration of the hub's origin, mean over the step, in the body axes half way",
        nominal=1.0,
    ),
    *array(output, "angular_acceleration", "rad/s2", f"Angular acceleration, mean over the step, {_BODY}", nominal=1.0),
    *array(output, "angular_velocity", "rad/s", f"Angular velocity, {_BODY}"),
    *array(output, "attitude", "1", "Quaternion from body to inertial axes", parts=_QUATERNION),
    *array(output, "position", "m", f"Position of the hub's origin, {_INERTIAL}"),
    *array(output, "velocity", "m/s", f"Velocity of the hub's origin, {_INERTIAL}"),
    *array(output, "wheel_momentum", "kg m2/s", f"Angular momentum of the wheels relative to the hub, {_BODY}"),
    *array(local, "momentum", "kg m/s", f"Momentum of the hub and what is attached, {_INERTIAL}"),
    *array(
        local,
        "angular_momentum",
        "kg m2/s",
        f"Angular momentum of the same about the inertial origin, wheels included, {_INERTIAL}",
    ),
    local("kinetic_energy", "J", "Kinetic energy of the same, the spin of the wheels left out"),
)


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
        now = unpack(motion, y)
        q, R, w = now.q, rotation(now.q), body.angular_velocity(now)
        turning = ca.vertcat(-ca.dot(q[1:], w), q[0] * w + ca.cross(q[1:], w)) / 2.0
        push = ca.mtimes(R, W[:3]) + J[:3] / h
        torque = ca.mtimes(R, W[3:]) + J[3:] / h - ca.cross(ca.mtimes(R, body.c), push)
        return ca.vertcat(now.P / body.M, push, torque, turning, tau)

    y = pack(motion)
    k1 = rate(y)
    k2 = rate(y + h / 2.0 * k1)
    k3 = rate(y + h / 2.0 * k2)
    k4 = rate(y + h * k3)
    end = unpack(motion, y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
    return replace(end, q=end.q / ca.norm_2(end.q))


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
