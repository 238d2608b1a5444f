r"""Reduced membranes as other programs take flexible parts: flex files of 42, and masses on springs.

Symbols: ``p`` and ``q`` participations of a mode along [kg^1/2] and about [kg^1/2 m] the axes through the membrane's own
origin, ``omega`` its angular frequency [1/s], ``c`` mass damping [1/s].
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from .reduction import Reduced

NOTHING = 1e-12  # of the membrane's mass: a mode of less shakes no frame
TURNS = 1e-6  # of a mode's participation: along the axes less than that is none


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringMasses:
    r"""Masses that move along a line against spring and damper, one for each mode that shakes its frame along the axes.

    Attributes
    ----------
    mode : ndarray of int, shape (k,)
        Numbers of the modes, from 1.
    mass : ndarray, shape (k,)
        :math:`p^2` [kg].
    place, direction : ndarray, shape (k, 3)
        :math:`p \times q / p^2` from the membrane's own origin [m], and p over its length [1].
    stiffness, damping : ndarray, shape (k,)
        :math:`\omega^2 p^2` [N/m], :math:`c\,p^2` [N s/m].
    lost : ndarray, shape (k,)
        Share of q along p [1], the twist about the direction, which a mass on a line does not have.
    """

    mode: NDArray[np.int64]
    mass: Vector
    place: Matrix
    direction: Matrix
    stiffness: Vector
    damping: Vector
    lost: Vector


def spring_masses(reduced: Reduced) -> SpringMasses:
    """Return modes as masses on springs, such as Basilisk's linearSpringMassDamper.

    Modes that only turn the frame have none. What carries them has the whole mass of the membrane less theirs.
    """
    p, q = np.hsplit(reduced.modes.participation, 2)
    mass = np.sum(p**2, axis=1)
    size = np.sum(q**2, axis=1) / reduced.modes.linearised.structure.mesh.size**2
    moves = (mass > TURNS * (mass + size)) & (mass > NOTHING * reduced.modes.moving[0, 0])
    p, q, mass, squares = p[moves], q[moves], mass[moves], reduced.modes.squares[moves]
    along = np.abs(np.sum(p * q, axis=1)) / np.sqrt(mass)
    length = np.linalg.norm(q, axis=1)
    return SpringMasses(
        mode=np.flatnonzero(moves) + 1,
        mass=mass,
        place=np.cross(p, q) / mass[:, None],
        direction=p / np.sqrt(mass)[:, None],
        stiffness=squares * mass,
        damping=np.full(len(mass), reduced.damping) * mass,
        lost=np.divide(along, length, out=np.zeros_like(along), where=length > 0.0),
    )


def flex_file(reduced: Reduced, title: str) -> str:
    """Write the modes as a flex file of 42, the spacecraft simulator.

    Parameters
    ----------
    reduced : Reduced
        The membrane, fixed at its frame, which is its joint; its nodes are those of ``node_file``.
    title : str
        A line of description.

    Notes
    -----
    As its ``42init.c`` reads it [1]_: modal mass 1 kg, momentum integrals about the membrane's own origin, in its axes. 42
    takes these where motion is referred to the joint (``RefPt``), not to the centre of mass. The integrals of second order,
    L and N, are left out.

    References
    ----------
    .. [1] E. Stoneking, 42: A General-Purpose Spacecraft Simulation, https://github.com/ericstoneking/42.
    """
    modes, c = reduced.modes, reduced.damping
    n = len(modes.squares)
    psi = modes.shapes[:, [node - 1 for node in reduced.nodes]]
    none = ["0  ! Number of non-zero elements"]

    def diagonal(values: Iterable[float]) -> list[str]:
        return [f"{n}  ! Number of non-zero elements", *(f"{k} {k} {x:.17e}  ! [Row] [Col]" for k, x in enumerate(values))]

    def by_mode(rows: Matrix) -> list[str]:
        return [" ".join(f"{x:.17e}" for x in row) + f"  ! Mode {k}, [x y z]" for k, row in enumerate(rows)]

    moved = [f"{k} {i} {axis} {x:.17e}  ! [Mode] [Node] [Axis]" for (k, i, axis), x in np.ndenumerate(psi) if x]
    return "\n".join(
        [
            "<<<<<<<<<<<<<<  Flexible Body Inputs for 42  >>>>>>>>>>>>>>>>>>>",
            f"{title}  ! Description",
            f"{n}  ! Number of Flex Modes",
            "****************** Initial Modal States x, u  ******************",
            *(f"0.0 0.0  ! Mode {k}  x, u" for k in range(n)),
            "****************** Joint Node Mode Shapes *********************",
            "*******  Non-zero Translation Mode Shape (PSI) Elements ********",
            *none,
            "*******  Non-zero Rotation Mode Shape (THETA) Elements ********",
            *none,
            "**************** Analysis Node Mode Shapes *********************",
            "*******  Non-zero Translation Mode Shape (PSI) Elements ********",
            f"{len(moved)}  ! Number of non-zero elements",
            *moved,
            "*******  Non-zero Rotation Mode Shape (THETA) Elements ********",
            *none,
            "****************  Non-zero Mass Matrix Elements ******************",
            *diagonal(np.ones(n)),
            "*************  Non-zero Stiffness Matrix Elements ****************",
            *diagonal(modes.squares),
            "*************  Non-zero Damping Matrix Elements ****************",
            *diagonal(np.full(n, c)),
            "*********  Linear Momentum Modal Integral, Pf, 3 x Nf  *********",
            *by_mode(modes.participation[:, :3]),
            "********  Angular Momentum Modal Integral, Hf, 3 x Nf  *********",
            *by_mode(modes.participation[:, 3:]),
            "**********  Linear Modal Integral, L, 3 x 3 x Nf  **************",
            *none,
            "*********  Angular Modal Integral, N, 3 x 3 x Nf x Nf  *********",
            *none,
            "[EOF]\n",
        ]
    )


def node_file(reduced: Reduced, title: str) -> str:
    """Write nodes whose displacements are outputs as a node file of 42: places in equilibrium from the own origin [m]."""
    known = reduced.modes.linearised
    places = known.structure.mesh.nodes - known.structure.origin + known.displacement
    rows = [(" ".join(f"{x:.17e}" for x in places[node - 1]), node) for node in reduced.nodes]
    return "\n".join(
        [
            "<<<<<<<<<<<<<<<<  Body Node Inputs for 42  >>>>>>>>>>>>>>>>>>>>>",
            f"{title}  ! Description",
            f"{len(rows)}  ! Number of Nodes",
            "******************* Node Location, Comment *********************",
            *(f'{place}  "node {node}"' for place, node in rows),
            "",
        ]
    )
