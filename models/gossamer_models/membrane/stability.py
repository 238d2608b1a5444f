r"""The largest step that explicit integration may take.

Symbols: ``a`` element size [m], ``c`` wave speed [m/s], both in the unstretched membrane.
"""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

from .mesh import SquareMesh

STEP_FRACTION = 0.42  # of a/c
STEPS_PER_CYCLE = 20.0  # of the built-in pressure, at least


def max_step_expression(mesh: SquareMesh, wave: ca.MX, p: SimpleNamespace) -> ca.MX:
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
    size = p.side_length / mesh.elements_per_side
    cycle = 1.0 / ca.fmax(p.pressure_frequency, 1e-300)
    return ca.fmin(STEP_FRACTION * size * ca.sqrt(p.density / wave), cycle / STEPS_PER_CYCLE)
