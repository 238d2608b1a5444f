r"""The membrane as a pure step: what the FMU runs.

Symbols: ``q`` displacements [m] of the interior nodes from the stretched plane, ``v`` their velocities [m/s], ``phase`` of
the built-in pressure [cycles], ``u`` inputs, ``p`` parameters, ``h`` step [s], ``c`` mass damping [1/s]::

    x = (q, v, phase)        u = (pressure, base_acceleration, damage[1..16])
"""

from __future__ import annotations

from dataclasses import fields

import casadi as ca
import numpy as np

from gossamer_models.step_model import StepModel
from gossamer_models.variables import Variable

from .equations import N_ZONES, MembraneEquations
from .params import N_PARAMETERS, MembraneParams, named
from .prestress import prestress
from .strain import SENSOR_POINTS, nominal_strain_expression

# part of a/c (element size over wave speed) that one step may use; see ``max_step_expression``
STEP_FRACTION = 0.42
STEPS_PER_CYCLE = 20.0  # of the built-in pressure, at least

_ADVICE = (
    "Check the prestress (edge_displacement against side_length), damage, pressure and base acceleration: the membrane may "
    "be stretched beyond any use, or the damaged prestress equilibrium was not found."
)


def membrane_model(elements_per_side: int = 8, *, compiled: bool = False) -> StepModel:
    r"""Build the step model of a prestressed square membrane under pressure, with damage in 16 zones.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4, at least 4.
    compiled : bool
        True if the step is to become C code rather than to run in CasADi's virtual machine; the numbers are the same.

    Returns
    -------
    StepModel
        Model ``membrane``; ``max_step`` limits its internal step.

    Raises
    ------
    ParameterError
        ``elements_per_side`` does not fit the 4 x 4 damage zones.

    Notes
    -----
    Position Verlet with the damping taken implicitly; inputs hold over the step:

    .. math::

        q_{1/2} &= q + \tfrac h2 v, \\
        v^+ &= \frac{(1 - \tfrac{ch}{2})\,v + h\,(f(q_{1/2}, t + \tfrac h2)/m - a_{base} e_z)}{1 + \tfrac{ch}{2}}, \\
        q^+ &= q_{1/2} + \tfrac h2 v^+.

    One force evaluation, second order, self-starting, any sequence of steps. With equal steps its half-step positions are
    those of the central difference method of [1]_, whose limit :math:`h < 2/\omega_{max}` it shares, damped or not.
    Without damping it is symplectic [2]_. The phase of the built-in pressure is kept within one cycle, so that its
    round-off does not grow with time. ``max_step`` belongs to the middle of the last step, where the forces are evaluated.

    References
    ----------
    .. [1] T. Belytschko, W. K. Liu, B. Moran, K. Elkhodary, Nonlinear Finite Elements for Continua and Structures,
       2nd ed., Wiley, 2014, Section 6.2.
    .. [2] E. Hairer, C. Lubich, G. Wanner, Acta Numerica 12, 399-450, 2003, doi:10.1017/S0962492902000144.
    """
    equations = MembraneEquations(elements_per_side, compiled=compiled)
    n = equations.n_q
    u, p = ca.MX.sym("u", 2 + N_ZONES), ca.MX.sym("p", N_PARAMETERS)
    pressure, base_acceleration, damage = u[0], u[1], u[2:]
    v = named(p)

    q0, wave0 = prestress(equations, damage, p)
    turns = v["pressure_phase"] / (2.0 * np.pi)
    x0 = ca.vertcat(q0, ca.MX.zeros(n), turns - ca.floor(turns))
    init = ca.Function("init", [u, p], [x0, _results(equations, q0, wave0, p)], ["u", "p"], ["x", "y"])

    x, h = ca.MX.sym("x", 2 * n + 1), ca.MX.sym("h")
    q, velocity, phase = x[:n], x[n : 2 * n], x[2 * n]
    q_half = q + h / 2.0 * velocity
    cycles = v["pressure_frequency"] * h
    load = pressure + v["pressure_amplitude"] * ca.sin(2.0 * np.pi * (phase + cycles / 2.0))
    f, wave = equations.force_expression(q_half, damage, load, p)
    mass = equations.masses(v["density"], v["thickness"], v["side_length"])
    normal = ca.DM(np.tile([0.0, 0.0, 1.0], n // 3))
    drag = v["mass_damping"] * h / 2.0
    velocity_next = ((1.0 - drag) * velocity + h * (f / mass - base_acceleration * normal)) / (1.0 + drag)
    q_next = q_half + h / 2.0 * velocity_next
    phase_next = phase + cycles
    x_next = ca.vertcat(q_next, velocity_next, phase_next - ca.floor(phase_next))
    step = ca.Function(
        "step",
        [x, u, p, h],
        [x_next, _results(equations, q_next, wave, p)],
        ["x", "u", "p", "h"],
        ["x_next", "y"],
    )
    return StepModel(
        name="membrane",
        description=f"Prestressed square membrane with damage zones, {elements_per_side} x {elements_per_side} elements",
        variables=_variables(equations),
        init=init,
        step=step,
        step_limit="max_step",
        advice=_ADVICE,
    )


def max_step_expression(equations: MembraneEquations, wave: ca.MX, p: ca.MX) -> ca.MX:
    r"""Write the largest internal step [s] from the largest :math:`\rho c^2` [Pa] of the stretched membrane.

    Notes
    -----
    For square elements of size :math:`a` with lumped mass and 2 x 2 integration the highest frequency of a uniformly
    stretched, unbounded mesh is :math:`2c/a` (a wave of length :math:`2a` along a side), so :math:`2/\omega_{max} = a/c`.
    With the largest :math:`c` of any Gauss point, :math:`a/c` was 0.73 to 0.99 of the true limit, from the highest
    eigenvalue of the assembled mesh, and never above it: 4, 8 and 16 elements per side, static states up to 100 kPa and
    0.5 m deflection, damage up to 95 %, and the states of undamped and damped runs of 0.18 s. ``STEP_FRACTION`` is therefore
    a margin for the change of :math:`c` within a step, and for accuracy: the default run in communication steps of 3e-4 s
    takes two internal steps each and stays within 0.11 % (deflection) and 0.36 % (change of strain) of its converged
    solution over 0.3 s, relative L2. Where the built-in pressure is fast, its cycle limits the step.
    """
    v = named(p)
    size = v["side_length"] / equations.mesh.elements_per_side
    cycle = 1.0 / ca.fmax(v["pressure_frequency"], 1e-300)
    return ca.fmin(STEP_FRACTION * size * ca.sqrt(v["density"] / wave), cycle / STEPS_PER_CYCLE)


def _results(equations: MembraneEquations, q: ca.MX, wave: ca.MX, p: ca.MX) -> ca.MX:
    """Write outputs and locals in the order of the table."""
    strains = [nominal_strain_expression(equations, q, p, point) for point in SENSOR_POINTS]
    grid = equations.mesh.interior_grid
    middle = grid.shape[0] // 2
    deflections = q[(3 * grid + 2).reshape(-1).tolist()]
    limit = max_step_expression(equations, wave, p)
    return ca.vertcat(*strains, q[int(3 * grid[middle, middle] + 2)], deflections, limit)


def _variables(equations: MembraneEquations) -> tuple[Variable, ...]:
    defaults = MembraneParams()
    parameters = [
        Variable(
            name=field.name,
            causality="parameter",
            unit=unit,
            description=description,
            start=getattr(defaults, field.name),
            minimum=low,
            maximum=high,
        )
        for field, (unit, description, low, high) in zip(fields(defaults), _PARAMETERS, strict=True)
    ]
    inputs = [
        Variable(
            name="pressure",
            causality="input",
            unit="Pa",
            description="Uniform follower pressure added to the built-in one",
            start=0.0,
            minimum=-1e6,
            maximum=1e6,
            nominal=1e4,
        ),
        Variable(
            name="base_acceleration",
            causality="input",
            unit="m/s2",
            description="Acceleration of the rigid frame, normal to the membrane, that displacements are relative to",
            start=0.0,
            minimum=-1e5,
            maximum=1e5,
            nominal=10.0,
        ),
        *(
            Variable(
                name=f"damage[{k + 1}]",
                causality="input",
                unit="1",
                description=f"Lost fraction of Young's modulus in zone {k + 1} "
                f"(column {k % 4 + 1} along x, row {k // 4 + 1} along y)",
                start=0.0,
                minimum=0.0,
                maximum=0.95,
            )
            for k in range(N_ZONES)
        ),
    ]
    outputs = [
        *(
            Variable(
                name=f"strain[{k + 1}]",
                causality="output",
                unit="1",
                description=f"Nominal strain along y, prestrain included, at x = {_THIRDS[a]}, y = {_THIRDS[b]} of the side",
                nominal=0.1,
            )
            for k, (a, b) in enumerate(SENSOR_POINTS)
        ),
        Variable(name="deflection", causality="output", unit="m", description="Deflection of the centre", nominal=0.1),
    ]
    m = equations.mesh.elements_per_side - 1
    local = [
        *(
            Variable(
                name=f"w[{i},{j}]",
                causality="local",
                unit="m",
                description=f"Deflection of interior node {i} along x, {j} along y",
                nominal=0.1,
            )
            for i in range(1, m + 1)
            for j in range(1, m + 1)
        ),
        Variable(
            name="max_step",
            causality="local",
            unit="s",
            description="Largest internal step; longer communication steps are divided",
        ),
    ]
    return (*parameters, *inputs, *outputs, *local)


_THIRDS = {1 / 3: "1/3", 2 / 3: "2/3"}

# unit, description, minimum, maximum in the order of MembraneParams
_PARAMETERS = (
    ("m", "Side of the unstretched square", 1e-3, 1e3),
    ("m", "Unstretched thickness", 1e-7, 1.0),
    ("Pa", "Young's modulus of the undamaged material", 1.0, 1e13),
    ("1", "Poisson's ratio", -0.9, 0.499),
    ("kg/m3", "Density of the unstretched material", 1e-3, 1e5),
    ("m", "Outward displacement of every edge before it is held", 0.0, 1e3),
    ("1/s", "Damping force per mass and velocity relative to the base", 0.0, 1e4),
    ("Pa", "Amplitude of the built-in follower pressure", 0.0, 1e6),
    ("Hz", "Frequency of the built-in follower pressure", 0.0, 1e4),
    ("rad", "Phase of the built-in follower pressure when the run begins", -1e3, 1e3),
)
