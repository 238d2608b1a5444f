"""The membrane as a textbook writes it, with shape functions and an energy; and the models and meshes that tests share.

Symbols: ``X`` reference and ``x`` current node positions, ``N`` shape functions at ``s``, ``t``, which run from -1 to 1,
``w`` weights, ``F`` deformation gradient, ``e`` Green-Lagrange strain. Gauss-Lobatto-Legendre rules are Table 25.6 of
M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, National Bureau of Standards, 1964.
"""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
from gossamer_models import Stepper
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.membrane.square import stretch
from studies.square import SquareEquations

LOBATTO = {
    2: ([-1.0, 0.0, 1.0], [1 / 3, 4 / 3, 1 / 3]),
    3: ([-1.0, -np.sqrt(1 / 5), np.sqrt(1 / 5), 1.0], [1 / 6, 5 / 6, 5 / 6, 1 / 6]),
    4: ([-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7), 1.0], [1 / 10, 49 / 90, 32 / 45, 49 / 90, 1 / 10]),
}


@cache
def membrane(elements_per_side, order=1):
    return membrane_model(square_structure(elements_per_side, order))


@cache
def equations(elements_per_side, order=1):
    return SquareEquations(square_structure(elements_per_side, order))


def started(model, damage=None, **start):
    """Return an initialized stepper; damage [1] by the number of its zone."""
    stepper = Stepper(model, **start)
    for zone, value in (damage or {}).items():
        stepper.set(f"damage[{zone}]", value)
    stepper.initialize()
    return stepper


def vectors(model, **start):
    """Return inputs and parameters as the functions of a model take them, at their start values but for those given."""
    values = np.array([start.get(variable.name, variable.start) for variable in model.variables], dtype=float)
    p, u, _ = model.slices()
    return values[u], values[p]


def motion(model, x):
    """Return displacements [m] and velocities [m/s] of a state."""
    q, v, _ = np.split(np.asarray(x).ravel(), [model.n_states // 2, model.n_states - 1])
    return q, v


def shape_functions(order, s, t):
    """Evaluate the shape functions and their parent derivatives, s fastest, shapes (m,) and (m, 2)."""
    nodes = [-1.0, 1.0] if order == 1 else LOBATTO[order][0]
    powers = np.arange(order + 1)
    coefficients = np.linalg.inv(np.vander(nodes, increasing=True))  # one column per node
    a, b = (coordinate**powers @ coefficients for coordinate in (s, t))
    da, db = (powers * coordinate ** np.maximum(powers - 1, 0) @ coefficients for coordinate in (s, t))
    return np.kron(b, a), np.column_stack([np.kron(b, da), np.kron(db, a)])


def quadrature(order):
    """Return points and weights in the parent square of a Gauss rule (order 1) or of the nodes."""
    points, w = ([-np.sqrt(1 / 3), np.sqrt(1 / 3)], [1.0, 1.0]) if order == 1 else LOBATTO[order]
    return [(s, t, w_s * w_t) for t, w_t in zip(points, w, strict=True) for s, w_s in zip(points, w, strict=True)]


def element_nodes(order, corners):
    """Place the nodes of an element between four corners, s fastest, shape (m, 2)."""
    nodes = [-1.0, 1.0] if order == 1 else LOBATTO[order][0]
    return np.array([shape_functions(1, s, t)[0] @ corners for t in nodes for s in nodes])


def order_of(X):
    """Return the order of an element from its number of nodes."""
    return round(np.sqrt(len(X))) - 1


def element_energy(x, X, E, nu):
    """Integrate the strain energy per thickness of one element; x has shape (3, m), X (m, 2)."""
    energy = 0.0
    for s, t, w in quadrature(order_of(X)):
        _, dN = shape_functions(order_of(X), s, t)
        J = X.T @ dN
        F = x @ ca.DM(dN @ np.linalg.inv(J))
        e = (F.T @ F - ca.DM.eye(2)) / 2.0
        S = E / (1.0 - nu**2) * ((1.0 - nu) * e + nu * ca.trace(e) * ca.DM.eye(2))
        energy += w * ca.trace(S @ e) / 2.0 * np.linalg.det(J)
    return energy


def element_force(x, X, E, nu, pressure_over_thickness):
    """Integrate the pressure over the element and subtract the gradient of the energy, shape (3, m)."""
    f = -ca.gradient(element_energy(x, X, E, nu), x)
    for s, t, w in quadrature(order_of(X)):
        N, dN = shape_functions(order_of(X), s, t)
        tangents = x @ ca.DM(dN)
        f += w * pressure_over_thickness * ca.cross(tangents[:, 0], tangents[:, 1]) @ ca.DM(N).T
    return f


def energy_function(mesh, params):
    """Return ``energy(q, damage)``, the strain energy [J] of all elements at displacements [m] of the interior nodes."""
    X = mesh.nodes * params.side_length
    x, E = ca.MX.sym("x", 3, mesh.elements.shape[1]), ca.MX.sym("E")
    one = ca.Function("energy", [x, E], [element_energy(x, X[mesh.elements[0]], E, params.poisson_ratio)]).expand()
    all_of_them = one.map(len(mesh.elements))

    def energy(q, damage=0.0):
        positions = stretch(params) * np.column_stack([X, np.zeros(len(X))])
        positions[mesh.interior] += np.reshape(q, (-1, 3))
        moduli = params.youngs_modulus * (1.0 - np.broadcast_to(damage, 16))[mesh.zone]
        return params.thickness * float(
            ca.sum2(all_of_them(positions[mesh.elements].reshape(-1, 3).T, moduli.reshape(1, -1)))
        )

    return energy
