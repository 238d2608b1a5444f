r"""The membrane's equations of motion in space: elements assembled on a mesh.

Symbols: ``q`` displacements [m] of the interior nodes from the homogeneously stretched plane, node by node as (x, y, z),
shape (n_q,); ``damage`` of the 16 zones [1]: Young's modulus of a zone is ``E (1 - damage)``, Section 7.1 of the thesis;
``pressure`` [Pa]; ``p`` parameters by name; ``f`` nodal forces [N]; ``K`` tangent [N/m]; ``M`` masses [kg]; ``c`` mass
damping [1/s]; ``x`` node positions in units of two element sizes [1]::

    M (q'' + c q' + a_base e_z) = f(q, damage, pressure; p)

The undamaged, unloaded membrane rests at ``q = 0`` exactly, since a bilinear mesh represents a homogeneous stretch.
"""

from __future__ import annotations

from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from ..variables import by_name
from .element import element_force, element_mass, gauss_points
from .mesh import N_ZONES, dofs, square_mesh
from .params import PARAMETERS, MembraneParams, stretch


class MembraneEquations:
    """Forces, tangent and masses of a membrane on a regular mesh.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4.
    compiled : bool
        True: write forces as a loop over elements, one and a half times as fast as compiled C. False: as one expression of
        columns, two and a half times as fast in CasADi's virtual machine. The numbers are the same.

    Notes
    -----
    All elements are the same square. The tangent maps the ``ca.jacobian`` of one element over the mesh. The element works
    in units of two element sizes, in which ``F`` is found without a multiplication, and its forces are multiplied by that
    unit and the thickness.
    """

    def __init__(self, elements_per_side: int, *, compiled: bool = False) -> None:
        self._compiled = compiled
        mesh = self.mesh = square_mesh(elements_per_side)
        self.n_q = 3 * mesh.interior.size
        self._units_per_side = elements_per_side / 2.0
        self._points = gauss_points(mesh.nodes[mesh.elements[0]] * self._units_per_side)
        interior_of = np.full(3 * len(mesh.nodes), -1)
        interior_of[dofs(mesh.interior)] = np.arange(self.n_q)
        self._row = interior_of[dofs(mesh.elements)]  # place in q of each element force, -1 where the edge holds it

    def positions(self, q: ca.MX, p: SimpleNamespace) -> ca.MX:
        """Return the positions of all nodes from the centre in units of two element sizes [1], shape (3 nodes,)."""
        plane = np.column_stack([self.mesh.nodes - 0.5, np.zeros(len(self.mesh.nodes))]) * self._units_per_side
        x = stretch(p) * ca.MX(ca.DM(plane.reshape(-1)))
        x[dofs(self.mesh.interior).tolist()] += self._units_per_side / p.side_length * q
        return x

    def force_expression(self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: SimpleNamespace) -> tuple[ca.MX, ca.MX]:
        """Write the forces [N] on the interior nodes, shape (n_q,), and the largest rho c^2 [Pa] of any Gauss point."""
        x, E, nu, load, scale = self._element_arguments(q, damage, pressure, p)
        if self._compiled:
            f, wave = self._element_force.map(E.numel(), [False, False, True, True])(x, E.T, nu, load)
        else:
            columns, wave = ca.cse([*element_force(x.T, self._points, E, nu, load)])
            f = columns.T
        free = np.flatnonzero(self._row >= 0)
        gather = _selection(self._row[free], free, (self.n_q, self._row.size))
        return scale * ca.mtimes(gather, ca.vec(f)), ca.mmax(wave)

    @cached_property
    def force(self) -> ca.Function:
        """``force(q, damage, pressure, p) -> (f [N], rho c^2 [Pa])``, ``p`` as ``MembraneParams.vector``."""
        symbols, arguments = self._symbols()
        return ca.Function("force", symbols, self.force_expression(*arguments))

    @cached_property
    def tangent(self) -> ca.Function:
        """``tangent(q, damage, pressure, p) -> K = -df/dq`` [N/m], sparse; not symmetric under pressure."""
        symbols, arguments = self._symbols()
        x, E, nu, load, scale = self._element_arguments(*arguments)
        n = len(self.mesh.elements)
        blocks = self._element_tangent.map(n, "serial")(x, E.T, ca.repmat(nu, 1, n), ca.repmat(load, 1, n))
        per_metre = self._units_per_side / arguments[3].side_length
        return ca.Function("tangent", symbols, [-scale * per_metre * self._assemble(blocks)])

    def node_mass(self, p: SimpleNamespace | MembraneParams) -> Any:  # noqa: ANN401
        """Return the lumped mass [kg] of one interior node: all are alike on a regular mesh."""
        return p.density * p.thickness * (p.side_length / self.mesh.elements_per_side) ** 2

    def lumped_mass(self, p: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the lumped mass matrix [kg] of the interior nodes, shape (n_q, n_q)."""
        return scipy.sparse.identity(self.n_q, format="csc") * self.node_mass(p)

    def consistent_mass(self, p: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the consistent mass matrix [kg] of the interior nodes, shape (n_q, n_q)."""
        blocks = np.tile(element_mass(self._points), len(self.mesh.elements))
        unit = p.side_length / self._units_per_side
        return p.density * p.thickness * unit**2 * self._assemble(ca.DM(blocks)).sparse()

    def _symbols(self) -> tuple[list[ca.MX], tuple[ca.MX, ca.MX, ca.MX, SimpleNamespace]]:
        """Make the arguments of a function: as vectors, and with the parameters by name."""
        q, damage, pressure = ca.MX.sym("q", self.n_q), ca.MX.sym("damage", N_ZONES), ca.MX.sym("pressure")
        p = ca.MX.sym("p", len(PARAMETERS))
        return [q, damage, pressure, p], (q, damage, pressure, by_name(PARAMETERS, p))

    @cached_property
    def _element_force(self) -> ca.Function:
        """Force on the nodes of one element, shape (12,), and its largest rho c^2."""
        x, E, nu, load = symbols = ca.SX.sym("x", 12), ca.SX.sym("E"), ca.SX.sym("nu"), ca.SX.sym("load")
        f, wave = element_force(x.T, self._points, E, nu, load)
        return ca.Function("element_force", symbols, ca.cse([f.T, wave]))

    @cached_property
    def _element_tangent(self) -> ca.Function:
        """Derivative of the force on one element's nodes by their positions, 12 x 12."""
        symbols = self._element_force.sx_in()
        f, _ = self._element_force(*symbols)
        return ca.Function("element_tangent", symbols, ca.cse([ca.jacobian(f, symbols[0])]))

    def _element_arguments(
        self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: SimpleNamespace
    ) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX, ca.MX]:
        """Return what ``element_force`` takes, one column per element, and the factor that makes its forces newtons."""
        x = ca.reshape(self.positions(q, p)[dofs(self.mesh.elements).tolist()], 12, -1)
        E = (p.youngs_modulus * (1.0 - damage))[self.mesh.zone.tolist()]
        unit = p.side_length / self._units_per_side
        return x, E, p.poisson_ratio, pressure * unit / p.thickness, unit * p.thickness

    def _assemble(self, blocks: ca.MX | ca.DM) -> ca.MX | ca.DM:
        """Sum the 12 x 12 matrices of all elements, side by side, into a sparse matrix, shape (n_q, n_q)."""
        n = len(self.mesh.elements)
        row = np.repeat(self._row.reshape(n, 1, 12), 12, axis=1).reshape(-1)  # CasADi stores column by column
        column = np.repeat(self._row.reshape(n, 12, 1), 12, axis=2).reshape(-1)
        free = np.flatnonzero((row >= 0) & (column >= 0))
        key, place = np.unique(column[free] * self.n_q + row[free], return_inverse=True)
        pattern = ca.Sparsity.triplet(self.n_q, self.n_q, (key % self.n_q).tolist(), (key // self.n_q).tolist())
        return type(blocks)(pattern, ca.mtimes(_selection(place, free, (key.size, row.size)), ca.vec(blocks)))


def _selection(row: NDArray[np.int64], column: NDArray[np.int64], shape: tuple[int, int]) -> ca.DM:
    """Make a sparse matrix of ones that adds up chosen entries of a vector."""
    return ca.DM(ca.Sparsity.triplet(*shape, row.tolist(), column.tolist()), 1.0)
