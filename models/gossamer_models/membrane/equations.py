r"""The membrane's equations of motion in space: elements assembled on a mesh.

Symbols: ``q`` displacements [m] of the interior nodes from the homogeneously stretched plane, node by node as (x, y, z),
shape (3 m,); ``damage`` of the 16 zones [1]; ``pressure`` [Pa]; ``p`` the parameter vector of ``params.py``; ``f`` nodal
forces [N]; ``K`` tangent [N/m]; ``M`` masses [kg]::

    M (q'' + c q' + a_base e_z) = f(q, damage, pressure; p)

The undamaged, unloaded membrane rests at ``q = 0`` exactly, since a bilinear mesh represents a homogeneous stretch.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from .element import CORNERS, GAUSS, element_energy, element_force, gauss_points, shape_functions
from .mesh import square_mesh
from .params import N_PARAMETERS, MembraneParams, named

N_ZONES = 16


class MembraneEquations:
    """Forces, tangent and masses of a membrane on a regular mesh.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4.
    compiled : bool
        True: write forces as a loop over elements, twice as fast as compiled C. False: as one expression of columns, five
        times faster in CasADi's virtual machine. The numbers are the same.

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
        self._per_side = elements_per_side / 2.0  # length units per side
        self._points = gauss_points(mesh.nodes[mesh.elements[0]] * self._per_side)
        self._element_dofs = (3 * mesh.elements[:, :, None] + np.arange(3)).reshape(-1)
        self._interior_dofs = (3 * mesh.interior[:, None] + np.arange(3)).reshape(-1)
        interior_of = np.full(3 * len(mesh.nodes), -1)
        interior_of[self._interior_dofs] = np.arange(self.n_q)
        self._row = interior_of[self._element_dofs]  # place in q of each element force, -1 where the edge holds it
        used = np.flatnonzero(self._row >= 0)
        self._gather_forces = _selection(self._row[used], used, (self.n_q, self._row.size))

    def positions(self, q: ca.MX, p: ca.MX) -> ca.MX:
        """Return the current coordinates of all nodes in units of two element sizes [1], shape (3 nodes,)."""
        v, N = named(p), self._per_side
        shift = v["edge_displacement"] / v["side_length"]
        flat = np.column_stack([self.mesh.nodes, np.zeros(len(self.mesh.nodes))]).reshape(-1)
        outward = np.column_stack([2.0 * self.mesh.nodes - 1.0, np.zeros(len(self.mesh.nodes))]).reshape(-1)
        x = ca.MX(ca.DM(N * flat)) + shift * ca.DM(N * outward)
        x[self._interior_dofs.tolist()] += N / v["side_length"] * q
        return x

    def force_expression(self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Write the forces [N] on the interior nodes, shape (n_q,), and the largest rho c^2 [Pa] of any Gauss point."""
        x, E, nu, load, scale = self._element_arguments(q, damage, pressure, p)
        if self._compiled:
            f, wave = self._element_force.map(E.numel(), [False, False, True, True])(x, E.T, nu, load)
        else:
            columns, wave = ca.cse([*element_force(x.T, self._points, E, nu, load)])
            f = columns.T
        return scale * ca.mtimes(self._gather_forces, ca.vec(f)), ca.mmax(wave)

    @cached_property
    def force(self) -> ca.Function:
        """``force(q, damage, pressure, p) -> (f [N], rho c^2 [Pa])``."""
        symbols = self._symbols()
        return ca.Function("force", symbols, self.force_expression(*symbols))

    @cached_property
    def tangent(self) -> ca.Function:
        """``tangent(q, damage, pressure, p) -> K = -df/dq`` [N/m], sparse; not symmetric under pressure."""
        symbols = self._symbols()
        return ca.Function("tangent", symbols, [self.tangent_expression(*symbols)])

    def tangent_expression(
        self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: ca.MX, directions: tuple[int, ...] = (0, 1, 2)
    ) -> ca.MX:
        """Write the tangent [N/m], for all or some of the three directions of each node."""
        x, E, nu, load, scale = self._element_arguments(q, damage, pressure, p)
        n = len(self.mesh.elements)
        Ke = self._element_tangent.map(n, "serial")(x, E.T, ca.repmat(nu, 1, n), ca.repmat(load, 1, n))
        selected, pattern = self._scatter_tangent(directions)
        return ca.MX(pattern, -scale * self._per_side / named(p)["side_length"] * ca.mtimes(selected, ca.vec(Ke)))

    @cached_property
    def energy(self) -> ca.Function:
        """``energy(q, damage, pressure, p) -> strain energy`` [J]; the pressure does not enter."""
        symbols = self._symbols()
        x, E, nu, _, scale = self._element_arguments(*symbols)
        energies = element_energy(x.T, self._points, E, nu)
        return ca.Function("energy", symbols, [scale / self._per_side * symbols[3][0] * ca.sum1(energies)])

    def masses(self, density: ca.MX | float, thickness: ca.MX | float, side_length: ca.MX | float) -> ca.MX | float:
        """Return the lumped mass [kg] of one interior node: all are alike on a regular mesh."""
        return density * thickness * (side_length / self.mesh.elements_per_side) ** 2

    def consistent_mass(self, params: MembraneParams) -> scipy.sparse.csc_matrix:
        """Integrate the consistent mass matrix [kg] over the interior nodes, shape (n_q, n_q)."""
        N = np.array([shape_functions(s, t)[0] for s, t in CORNERS * GAUSS])
        dA = np.array([point.dA for point in self._points])
        m = np.kron(N.T @ (dA[:, None] * N), np.eye(3))
        n = len(self.mesh.elements)
        row = np.repeat(self._row.reshape(n, 12, 1), 12, axis=2).reshape(-1)
        column = np.repeat(self._row.reshape(n, 1, 12), 12, axis=1).reshape(-1)
        keep = (row >= 0) & (column >= 0)
        unit = params.side_length / self._per_side
        values = params.density * params.thickness * unit**2 * np.tile(m.reshape(-1), n)
        shape = (self.n_q, self.n_q)
        return scipy.sparse.coo_matrix((values[keep], (row[keep], column[keep])), shape=shape).tocsc()

    def lumped_mass(self, params: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the lumped mass matrix [kg] of the interior nodes, shape (n_q, n_q)."""
        mass = self.masses(params.density, params.thickness, params.side_length)
        return scipy.sparse.identity(self.n_q, format="csc") * mass

    def _symbols(self) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        return (
            ca.MX.sym("q", self.n_q),
            ca.MX.sym("damage", N_ZONES),
            ca.MX.sym("pressure"),
            ca.MX.sym("p", N_PARAMETERS),
        )

    @cached_property
    def _element_force(self) -> ca.Function:
        """Force on the nodes of one element, shape (12,), and its largest rho c^2."""
        x, E, nu, load = ca.SX.sym("x", 12), ca.SX.sym("E"), ca.SX.sym("nu"), ca.SX.sym("load")
        f, wave = element_force(x.T, self._points, E, nu, load)
        return ca.Function("element_force", [x, E, nu, load], ca.cse([ca.vec(f), wave]))

    @cached_property
    def _element_tangent(self) -> ca.Function:
        """Derivative of the force on one element's nodes by their positions, 12 x 12."""
        x, E, nu, load = arguments = self._element_force.sx_in()
        f, _ = element_force(x.T, self._points, E, nu, load)
        return ca.Function("element_tangent", arguments, ca.cse([ca.jacobian(ca.vec(f), x)]))

    def _element_arguments(
        self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: ca.MX
    ) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX, ca.MX]:
        """Return what ``element_force`` takes, one column per element, and the factor that makes its forces newtons."""
        v = named(p)
        x = ca.reshape(self.positions(q, p)[self._element_dofs.tolist()], 12, -1)
        E = (v["youngs_modulus"] * (1.0 - damage))[self.mesh.zone.tolist()]
        unit = v["side_length"] / self._per_side
        return x, E, v["poisson_ratio"], pressure * unit / v["thickness"], unit * v["thickness"]

    def _scatter_tangent(self, directions: tuple[int, ...]) -> tuple[ca.DM, ca.Sparsity]:
        """Return the matrix that sums element tangents into the nonzeros of ``K``, and the pattern of ``K``."""
        n, size = len(self.mesh.elements), len(directions)
        kept = np.full(3, -1)
        kept[list(directions)] = np.arange(size)
        direction = kept[self._row % 3]
        place = np.where((self._row >= 0) & (direction >= 0), self._row // 3 * size + direction, -1).reshape(n, 12)
        row = np.repeat(place[:, None, :], 12, axis=1).reshape(-1)  # CasADi stores each 12 x 12 block column by column
        column = np.repeat(place[:, :, None], 12, axis=2).reshape(-1)
        source = np.flatnonzero((row >= 0) & (column >= 0))
        order = self.n_q // 3 * size
        key, nonzero = np.unique(column[source] * order + row[source], return_inverse=True)
        pattern = ca.Sparsity.triplet(order, order, (key % order).tolist(), (key // order).tolist())
        return _selection(nonzero, source, (key.size, row.size)), pattern


def _selection(row: NDArray[np.int64], column: NDArray[np.int64], shape: tuple[int, int]) -> ca.DM:
    """Make a sparse matrix of ones that adds up chosen entries of a vector."""
    pattern = ca.Sparsity.triplet(*shape, row.tolist(), column.tolist())
    return ca.DM(pattern, 1.0)
