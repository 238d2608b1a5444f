r"""The membrane as a pure step: what the FMU runs.

Symbols: ``q`` displacements [m] of the interior nodes from the stretched plane, ``v`` their velocities [m/s], ``phase`` of
the built-in pressure [cycles], ``f`` forces [N], ``c`` mass damping [1/s], ``h`` step [s], ``u`` inputs and ``p`` parameters
by name.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import ParameterError
from ..shape import SHAPE
from ..step_model import StepModel
from ..variables import Results, Values, input_, local, output
from .assembly import MembraneEquations
from .frame import FRAME_INPUTS, FRAME_OUTPUTS, FRAME_PARAMETERS, RESTARTED, FrameState
from .law import LAWS
from .mesh import N_ZONES, ZONES_PER_SIDE
from .mounted import Force, MountedMembrane
from .params import PARAMETERS
from .prestress import prestress
from .shape import square_shape
from .stability import max_step_expression
from .strain import SENSOR_POINTS, sensor_strains_expression

GRID_STEPS = 8  # deflections are results on a grid of 7 x 7 points, whatever the mesh


@dataclass(frozen=True, slots=True)
class MembraneState:
    """State of the membrane.

    Attributes
    ----------
    q, v : casadi.MX, shape (n,)
        Displacements [m] of the interior nodes from the stretched plane, node by node, and their velocities [m/s]: relative
        to the base, but on a frame that flies, less the velocity of the frame's origin.
    phase : casadi.MX, scalar
        Phase of the built-in pressure [cycles].
    frame : FrameState or casadi.MX of no element
        What is known of the frame, if it flies.
    """

    q: ca.MX
    v: ca.MX
    phase: ca.MX
    frame: FrameState | ca.MX


def membrane_model(
    elements_per_side: int = 4,
    order: int = 4,
    law: str = "st_venant_kirchhoff",
    *,
    frame: bool = False,
    compiled: bool = False,
) -> StepModel:
    r"""Build the step model of a prestressed square membrane under pressure, with damage in 16 zones.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4, at least 4.
    order : int
        Order of the elements: 1 for bilinear, 2 to 12 for spectral ones.
    law : {"st_venant_kirchhoff", "hencky", "relaxed"}
        Law of the material. St Venant-Kirchhoff's carries compression, the relaxed one wrinkles instead; Hencky's is linear
        in the logarithmic strain.
    frame : bool
        True: the frame flies. It moves and turns in space, and the membrane returns force and torque on it. False: it moves
        along the membrane's normal only.
    compiled : bool
        True if the step is to become C code rather than to run in CasADi's virtual machine; the numbers are the same.

    Returns
    -------
    StepModel
        Model ``membrane``; ``max_step`` limits its internal step.

    Raises
    ------
    ParameterError
        ``elements_per_side`` does not fit the 4 x 4 damage zones, ``order`` is out of range, or there is no such law.

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
    On a frame that flies the step is that of ``frame.FrameStep``.

    References
    ----------
    .. [1] T. Belytschko, W. K. Liu, B. Moran, K. Elkhodary, Nonlinear Finite Elements for Continua and Structures,
       2nd ed., Wiley, 2014, Section 6.2.
    .. [2] E. Hairer, C. Lubich, G. Wanner, Acta Numerica 12, 399-450, 2003, doi:10.1017/S0962492902000144.
    """
    if law not in LAWS:
        msg = f"there is no law {law!r} of the membrane's material. Choose one of {', '.join(LAWS)}."
        raise ParameterError(msg)
    equations = MembraneEquations(elements_per_side, order, law, compiled=compiled)
    n = equations.n_q
    normal = ca.DM(np.tile([0.0, 0.0, 1.0], n // 3))

    def step(x: MembraneState, u: Values, p: Values, h: ca.MX) -> tuple[MembraneState, Results]:
        phase_half, phase_end = (x.phase + p.pressure_frequency * part for part in (h / 2.0, h))
        pressure = u.pressure + p.pressure_amplitude * ca.sin(2.0 * np.pi * phase_half)
        drag = p.mass_damping * h / 2.0
        keep, gain = (1.0 - drag) / (1.0 + drag), h / (1.0 + drag)  # two divisions, where one per node would be slow

        phase = phase_end - ca.floor(phase_end)
        if frame:
            ride = MountedMembrane(equations, p).advance(x.q, x.v, x.frame, force(u, p, pressure), u, h)
            state = MembraneState(ride.q, ride.s, phase, ride.frame)
            return state, results(ride.q, ride.wave, ride.strain, p) | ride.results

        q = x.q + h / 2.0 * x.v  # half a step
        f, wave, strain = equations.force_expression(q, u.damage, pressure, p)
        v = keep * x.v + gain * (f * equations.inverse_mass(p) - u.base_acceleration * normal)
        q = q + h / 2.0 * v  # the other half

        return MembraneState(q, v, phase, x.frame), results(q, wave, strain, p)

    def init(u: Values, p: Values) -> tuple[MembraneState, Results]:
        q, wave, strain = prestress(equations, u.damage, p)
        phase = p.pressure_phase / (2.0 * np.pi)
        phase = phase - ca.floor(phase)
        if frame:
            pressure = u.pressure + p.pressure_amplitude * ca.sin(p.pressure_phase)
            ride = MountedMembrane(equations, p).start(q, force(u, p, pressure), u)
            return MembraneState(q, ride.s, phase, ride.frame), results(q, wave, strain, p) | ride.results
        return MembraneState(q, ca.MX.zeros(n), phase, ca.MX.zeros(0)), results(q, wave, strain, p)

    def force(u: Values, p: Values, pressure: ca.MX) -> Force:
        return lambda q: equations.force_expression(q, u.damage, pressure, p, everywhere=True)

    def results(q: ca.MX, wave: ca.MX, strain: ca.MX, p: Values) -> dict[str, ca.MX]:
        mesh, deflections = equations.mesh, q[2::3]
        w = ca.mtimes(mesh.interpolation(GRID)[:, mesh.interior.tolist()], deflections)
        return {
            "strain": sensor_strains_expression(mesh, q, p),
            "deflection": deflections[mesh.centre],
            "w": w,
            "largest_strain": ca.sqrt(1.0 + strain) - 1.0,
            "deflection_ratio": ca.mmax(ca.fabs(w)) / p.side_length,
            "max_step": max_step_expression(mesh, wave, p),
        }

    variables = (
        *PARAMETERS,
        *(FRAME_PARAMETERS if frame else ()),
        *((*PRESSURE, *FRAME_INPUTS, *DAMAGE) if frame else INPUTS),
        *OUTPUTS,
        *(FRAME_OUTPUTS if frame else ()),
        *LOCALS,
    )
    return StepModel.written(
        name="membrane",
        description="Prestressed square membrane with damage zones, "
        f"{elements_per_side} x {elements_per_side} elements of order {order}"
        + ("" if law == "st_venant_kirchhoff" else f", law {law}")
        + (", on a frame that flies" if frame else ""),
        variables=variables,
        init=init,
        step=step,
        step_limit="max_step",
        restarted=RESTARTED if frame else 0,
        resources={SHAPE: square_shape(equations.mesh, variables)},
        advice="Check the prestress (edge_displacement against side_length), damage, pressure and "
        + (
            "the motion of the frame, and that mount_x does not lie along mount_normal"
            if frame
            else "base acceleration"
        )
        + ": the membrane may be stretched beyond any use, or the damaged prestress equilibrium was not found.",
    )


PRESSURE = (
    input_("pressure", "Pa", "Uniform follower pressure added to the built-in one", 0.0, -1e6, 1e6, nominal=1e4),
)
BASE = (
    input_(
        "base_acceleration",
        "m/s2",
        "Acceleration of the rigid frame, normal to the membrane, that displacements are relative to",
        0.0,
        -1e5,
        1e5,
        nominal=10.0,
    ),
)
DAMAGE = tuple(
    input_(
        f"damage[{k + 1}]",
        "1",
        f"Lost fraction of Young's modulus in zone {k + 1} "
        f"(column {k % ZONES_PER_SIDE + 1} along x, row {k // ZONES_PER_SIDE + 1} along y)",
        0.0,
        0.0,
        0.95,
    )
    for k in range(N_ZONES)
)
INPUTS = (*PRESSURE, *BASE, *DAMAGE)
OUTPUTS = (
    *(
        output(
            f"strain[{k + 1}]",
            "1",
            f"Nominal strain along y, prestrain included, at x = {3 * X:.0f}/3, y = {3 * Y:.0f}/3 of the side",
            nominal=0.1,
        )
        for k, (X, Y) in enumerate(SENSOR_POINTS)
    ),
    output("deflection", "m", "Deflection of the centre", nominal=0.1),
)
GRID = [(i / GRID_STEPS, j / GRID_STEPS) for i in range(1, GRID_STEPS) for j in range(1, GRID_STEPS)]
LOCALS = (
    *(
        local(
            f"w[{round(GRID_STEPS * X)},{round(GRID_STEPS * Y)}]",
            "m",
            f"Deflection at {round(GRID_STEPS * X)}/{GRID_STEPS} of the side along x, "
            f"{round(GRID_STEPS * Y)}/{GRID_STEPS} along y",
            nominal=0.1,
        )
        for X, Y in GRID
    ),
    local(
        "largest_strain", "1", "Largest principal nominal strain of all points", minimum=-1.0, maximum=0.5, nominal=0.1
    ),
    local("deflection_ratio", "1", "Largest of the deflections w over the side", minimum=0.0, maximum=1.0, nominal=0.1),
    local("max_step", "s", "Largest internal step; longer communication steps are divided"),
)
