r"""Impulse that one body owes another, where force arrives one step late.

Symbols: ``R`` matrix that turns body axes to inertial ones; ``w`` angular velocity [rad/s] and ``w_dot`` angular
acceleration [rad/s2] of the body, in body axes; ``W`` force [N] and torque about the body's origin [N m] in body axes,
shape (6,); ``J`` impulse [N s] and angular impulse about the origin [N m s] in inertial axes, shape (6,); ``h`` step
[s].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def turn(angle: Array) -> Array:
    """Return the matrix of a rotation [rad], shape (3,), which takes vectors from the turned axes to the first ones."""
    return np.asarray(Rotation.from_rotvec(angle).as_matrix())


class Debt:
    """Keeps the books: what an appendage gave a body, and what the body has received.

    Parameters
    ----------
    W : ndarray, shape (6,)
        Force and torque of the appendage when the run begins.

    Attributes
    ----------
    owed : ndarray, shape (6,)
        Impulse [N s] and angular impulse about the body's origin [N m s] that the appendage gave and the body has not
        received, or has received too much, in inertial axes.

    Notes
    -----
    The body receives what the appendage gave over the last step, and what is owed. With equal steps that is the linear
    extrapolation of the mean force. The FMU ``hub`` does the same inside.
    """

    def __init__(self, W: Array) -> None:
        self.owed = np.zeros(6)
        self._applied = np.array(W)

    def applied(self, R: Array, w: Array, w_dot: Array, W: Array, h: float) -> Array:
        """Note a step that has ended; return force [N] and torque [N m] for the next one, constant in body axes, shape (6,).

        Parameters
        ----------
        R : ndarray, shape (3, 3)
            Axes at the end of the step.
        w, w_dot : ndarray, shape (3,)
            Angular velocity [rad/s] at its end, and mean angular acceleration [rad/s2].
        W : ndarray, shape (6,)
            Mean force and torque of the appendage over the step, in the axes half way.
        h : float
            Its length, and that of the next [s].
        """
        back = h / 2.0 * w - h**2 / 4.0 * w_dot
        half, W_mean = R @ turn(-back), _skew(w - h / 2.0 * w_dot)
        mean = (
            R @ turn(-back - h**2 / 12.0 * w_dot) @ (np.eye(3) + h**2 / 24.0 * W_mean @ W_mean)
        )  # of the axes over the step
        self.owed = self.owed + h * (_both(half, W) - _both(mean, self._applied))
        self._applied = W + _both((R @ turn(h / 2.0 * w)).T, self.owed) / h
        return self._applied


def _skew(v: Array) -> Array:
    """Return the matrix that takes a vector to its cross product with ``v``."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _both(R: Array, W: Array) -> Array:
    return np.concatenate([R @ W[:3], R @ W[3:]])
