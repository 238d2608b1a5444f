"""The membrane as a textbook writes it, with shape functions and an energy; and the models and meshes that tests share.

Symbols: ``X`` reference and ``x`` current node positions, ``N`` shape functions at ``s``, ``t``, ``F`` deformation gradient,
``e`` Green-Lagrange strain.
"""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
from gossamer_models import Stepper
from gossamer_models.membrane import MembraneEquations, membrane_model
from gossamer_models.membrane.params import stretch

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])


@cache
def membrane(elements_per_side, order=1):
    return membrane_model(elements_per_side, order)


@cache
def equations(elements_per_side, order=1):
    return MembraneEquations(elements_per_side, order)


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


def shape_functions(s, t):
    """Evaluate the bilinear shape functions and their parent derivatives, shapes (4,) and (4, 2)."""
    a, b = 1.0 + CORNERS[:, 0] * s, 1.0 + CORNERS[:, 1] * t
    return a * b / 4.0, np.column_stack([CORNERS[:, 0] * b, CORNERS[:, 1] * a]) / 4.0


def element_energy(x, X, E, nu):
    """Integrate the strain energy per thickness of one element; x has shape (3, 4), X (4, 2)."""
    energy = 0.0
    for s, t in CORNERS / np.sqrt(3.0):
        _, dN = shape_functions(s, t)
        J = X.T @ dN
        F = x @ ca.DM(dN @ np.linalg.inv(J))
        e = (F.T @ F - ca.DM.eye(2)) / 2.0
        S = E / (1.0 - nu**2) * ((1.0 - nu) * e + nu * ca.trace(e) * ca.DM.eye(2))
        energy += ca.trace(S @ e) / 2.0 * np.linalg.det(J)
    return energy


def element_force(x, X, E, nu, pressure_over_thickness):
    """Integrate the pressure over the element and subtract the gradient of the energy, shape (3, 4)."""
    f = -ca.gradient(element_energy(x, X, E, nu), x)
    for s, t in CORNERS / np.sqrt(3.0):
        N, dN = shape_functions(s, t)
        tangents = x @ ca.DM(dN)
        f += pressure_over_thickness * ca.cross(tangents[:, 0], tangents[:, 1]) @ ca.DM(N).T
    return f


def energy_function(mesh, params):
    """Return ``energy(q, damage)``, the strain energy [J] of all elements at displacements [m] of the interior nodes."""
    X = mesh.nodes * params.side_length
    x, E = ca.MX.sym("x", 3, 4), ca.MX.sym("E")
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
