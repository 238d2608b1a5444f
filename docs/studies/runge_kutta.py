"""The membrane by another integrator: the classical Runge-Kutta method of order 4 in place of Verlet's of order 2."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
from gossamer_models.membrane import MembraneEquations, membrane_model, square_structure
from gossamer_models.step_model import StepModel
from gossamer_models.variables import by_name


def runge_kutta_membrane(elements_per_side: int, order: int) -> StepModel:
    """Return the membrane's model with four forces per step; its results are those of Verlet's method at the new state."""
    verlet = membrane_model(square_structure(elements_per_side, order))
    equations = MembraneEquations(square_structure(elements_per_side, order))
    n = equations.n_q
    normal = ca.DM(np.tile([0.0, 0.0, 1.0], n // 3))
    parameters, inputs, _ = verlet.slices()
    x, u, p, h = (ca.MX.sym(name, verlet.step.size1_in(i)) for i, name in enumerate("xuph"))
    named, given = by_name(verlet.variables[parameters], p), by_name(verlet.variables[inputs], u)

    def rate(q: ca.MX, v: ca.MX, phase: ca.MX) -> tuple[ca.MX, ca.MX]:
        shared = equations.shared(given, named, named.pressure_amplitude * ca.sin(2.0 * np.pi * phase), ca.MX(0.0))
        f = equations.forces(equations.positions(q, given, named), shared, given, named).f[:n]
        a = equations.lightness(named) * equations.arrays["mobility"] * f
        a += -named.mass_damping * v - given.base_acceleration * normal
        return v, a

    q, v, phase = x[:n], x[n : 2 * n], x[2 * n]
    half, end = (phase + named.pressure_frequency * part for part in (h / 2.0, h))
    q1, v1 = rate(q, v, phase)
    q2, v2 = rate(q + h / 2.0 * q1, v + h / 2.0 * v1, half)
    q3, v3 = rate(q + h / 2.0 * q2, v + h / 2.0 * v2, half)
    q4, v4 = rate(q + h * q3, v + h * v3, end)
    x_next = ca.vertcat(
        q + h / 6.0 * (q1 + 2.0 * q2 + 2.0 * q3 + q4), v + h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4), end - ca.floor(end)
    )
    _, y = verlet.step(x_next, u, p, 0.0)
    step = ca.Function("step", [x, u, p, h], [x_next, y])
    return replace(verlet, step=step, compiled=None, description="By Runge and Kutta")
