r"""Nodes, weights and Lagrange polynomials on [-1/2, 1/2], the side of a parent element of size one.

Symbols: ``P`` Legendre polynomial, ``n`` number of points.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre, legendre

from ..arrays import Vector


def gauss_points(n: int) -> tuple[Vector, Vector]:
    """Return nodes and weights of the Gauss-Legendre rule [1], shapes (n,); exact to degree 2 n - 1."""
    points, weights = legendre.leggauss(n)
    return np.asarray(points / 2.0, dtype=np.float64), np.asarray(weights / 2.0, dtype=np.float64)


def lobatto_points(n: int) -> tuple[Vector, Vector]:
    r"""Return nodes and weights of the Gauss-Lobatto-Legendre rule [1], shapes (n,); exact to degree 2 n - 3.

    Notes
    -----
    The ends and the roots of :math:`P_{n-1}'`, with weights :math:`2/(n (n-1) P_{n-1}(x)^2)`, Eq. (25.4.32) of [1]_, on an
    interval of length 2; here both are halved.

    References
    ----------
    .. [1] M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, National Bureau of Standards, 1964.
    """
    P = Legendre.basis(n - 1)
    inner = np.sort(np.real(P.deriv().roots()))  # real; NumPy 2.5 returns them as complex numbers
    points = np.concatenate([[-1.0], (inner - inner[::-1]) / 2.0, [1.0]])  # symmetric to the last bit
    return points / 2.0, 1.0 / (n * (n - 1) * P(points) ** 2)


def value_matrix(nodes: Vector, points: Vector) -> Vector:
    """Evaluate the Lagrange polynomials through ``nodes``, shape (points, nodes); exact ones and zeros at the nodes."""
    columns = []
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        columns.append(np.prod((points[:, None] - others) / (node - others), axis=1))
    return np.column_stack(columns)


def derivative_matrix(nodes: Vector, points: Vector) -> Vector:
    """Evaluate the derivatives of the Lagrange polynomials through ``nodes``, shape (points, nodes)."""
    n = len(nodes)
    columns = np.zeros((len(points), n))
    for i in range(n):
        for j in set(range(n)) - {i}:
            others = np.delete(nodes, [i, j])
            columns[:, i] += np.prod((points[:, None] - others) / (nodes[i] - others), axis=1) / (nodes[i] - nodes[j])
    return columns
