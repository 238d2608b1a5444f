"""Vectors of a running model, and momenta of a hub and the membrane that it carries, from the results of a run.

Symbols: ``R`` attitude as a matrix, ``O``, ``V`` place [m] and velocity [m/s] of the hub's origin, in inertial axes;
``P`` momentum [kg m/s] and ``L`` angular momentum about the inertial origin [kg m2/s], one row per time.
"""

from dataclasses import dataclass

import numpy as np


def put(stepper, name, values):
    """Set a vector."""
    for k, value in enumerate(values, 1):
        stepper.set(f"{name}[{k}]", float(value))


def get(stepper, name, size=3):
    """Read a vector."""
    return np.array([stepper.get(f"{name}[{k}]") for k in range(1, size + 1)])


def column(data, name):
    """Rows of an array of the results, one per time."""
    return data[name].transpose("time", ...).to_numpy()


def matrix(q):
    """Matrix of a quaternion, scalar first, that turns body axes to inertial ones."""
    Q = np.array([[0.0, -q[3], q[2]], [q[3], 0.0, -q[1]], [-q[2], q[1], 0.0]])
    return np.eye(3) + 2.0 * q[0] * Q + 2.0 * Q @ Q


@dataclass
class Balance:
    """Totals over time.

    Attributes
    ----------
    P, L : ndarray, shape (times, 3)
        Of hub and membrane, and of what the hub has not received yet.
    peak_P, peak_L : float
        Largest of the membrane alone.
    """

    P: np.ndarray
    L: np.ndarray
    peak_P: float
    peak_L: float

    def change(self, begin=0):
        """Largest change of momentum and angular momentum from some time on, over the membrane's peaks."""
        return (
            np.linalg.norm(self.P[begin:] - self.P[begin], axis=1).max() / self.peak_P,
            np.linalg.norm(self.L[begin:] - self.L[begin], axis=1).max() / self.peak_L,
        )


def balance(data, step, *, extrapolated=True):
    """Add up hub and membrane; ``step`` is the communication step [s], every one of which is recorded."""
    R = np.array([matrix(q) for q in column(data, "hub.attitude")])
    turn = lambda v: np.einsum("tij,tj->ti", R, v)  # noqa: E731
    O, V = column(data, "hub.position"), column(data, "hub.velocity")
    S, mass = turn(column(data, "membrane.moving_first_moment")), data["membrane.moving_mass"].to_numpy()[:, None]
    P = mass * V + turn(column(data, "membrane.momentum"))
    L = np.cross(S, V) + turn(column(data, "membrane.angular_momentum"))
    L_inertial = L + np.cross(O, P)
    owed = np.zeros_like(P), np.zeros_like(P)
    if extrapolated:
        J, K = (step * np.diff(column(data, f"membrane.{name}"), axis=0, prepend=0.0) for name in ("force", "torque"))
        J, K = turn(J), turn(K)
        J[0] = K[0] = 0.0
        owed = J, K + np.cross(O, J)
    return Balance(
        P + column(data, "hub.momentum") + owed[0],
        L_inertial + column(data, "hub.angular_momentum") + owed[1],
        np.linalg.norm(P, axis=1).max(),
        np.linalg.norm(L, axis=1).max(),
    )
