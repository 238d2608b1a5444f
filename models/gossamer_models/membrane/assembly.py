r"""The membrane's equations of motion in space: elements assembled on a mesh.

Symbols: ``q`` displacements [m] of the interior nodes from the homogeneously stretched plane, node by node as (x, y, z),
shape (n_q,); ``damage`` of the 16 zones [1]: Young's modulus of a zone is ``E (1 - damage)``, Section 7.1 of the thesis;
``pressure`` [Pa]; ``p`` parameters by name; ``f`` nodal forces [N]; ``K`` tangent [N/m]; ``M`` masses [kg]; ``c`` mass
damping [1/s]; ``x`` node positions from the centre in units of the size of an element [1]::

    M (q'' + c q' + a_base e_z) = f(q, damage, pressure; p)

The undamaged, unloaded membrane rests at ``q = 0`` exactly, since the elements represent a homogeneous stretch.
"""

from __future__ import annotations

from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from ..arrays import Vector
from ..variables import by_name
from .element import element_force, element_force_function, element_mass, element_tangent_function, make_element
from .law import LAWS
from .mesh import N_ZONES, dofs, square_mesh
from .params import PARAMETERS, MembraneParams, stretch
from .quadrature import lobatto_points


class MembraneEquations:
    """Forces, tangent and masses of a membrane on a regular mesh.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4.
    order : int
        Order of the elements: 1 for bilinear, 2 and more for spectral ones.
    law : str
        Law of the material, one of ``law.LAWS``.
    compiled : bool
        True: write forces as a loop over elements, faster as compiled C. False: as one expression of matrices with a column
        per element, faster in CasADi's virtual machine. The numbers are the same but for round-off.

    Notes
    -----
    All elements are the same square. The tangent maps the ``ca.jacobian`` of one element over the mesh. The element works
    in units of its size, in which the deformation gradient is the parent derivative, and its forces are multiplied by
    that unit and the thickness.
    """

    def __init__(
        self, elements_per_side: int = 4, order: int = 4, law: str = "st_venant_kirchhoff", *, compiled: bool = False
    ) -> None:
        self._compiled = compiled
        mesh = self.mesh = square_mesh(elements_per_side, order)
        self.element = make_element(order, law=LAWS[law])
        self.n_q = 3 * mesh.interior.size
        self._units_per_side = float(elements_per_side)
        interior_of = np.full(3 * len(mesh.nodes), self.n_q)
        interior_of[dofs(mesh.interior)] = np.arange(self.n_q)
        # element by element: x of its nodes, y, z
        self._place = (3 * mesh.elements[:, None, :] + np.arange(3)[:, None]).reshape(len(mesh.elements), -1)
        self._row = interior_of[self._place]  # place in q of each element force, n_q where the edge holds it
        self.edge = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.interior)

    def positions(self, q: ca.MX, p: SimpleNamespace) -> ca.MX:
        """Return the positions of all nodes from the centre in units of the size of an element [1], shape (3 nodes,)."""
        plane = np.column_stack([self.mesh.nodes - 0.5, np.zeros(len(self.mesh.nodes))]) * self._units_per_side
        x = stretch(p) * ca.MX(ca.DM(plane.reshape(-1)))
        x[dofs(self.mesh.interior).tolist()] += self._units_per_side / p.side_length * q
        return x

    def force_expression(
        self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: SimpleNamespace, *, everywhere: bool = False
    ) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Write the forces [N] on the interior nodes, shape (n_q,), and what ``element_force`` finds over all points.

        Returns
        -------
        f : casadi.MX, shape (n_q,)
            Forces [N]; if ``everywhere``, those on all nodes of the mesh, the edge included, shape (3 nodes,).
        wave : casadi.MX, scalar
            Largest rho c^2 [Pa].
        strain : casadi.MX, scalar
            Twice the largest principal Green-Lagrange strain [1].
        """
        x, E, nu, load, scale = self._element_arguments(q, damage, pressure, p)
        if self._compiled:
            f, wave, strain = self._element_forces(x, E, nu, load)
        else:
            positions = ca.vertsplit(x, len(self.element.nodes))
            f, wave, strain = ca.cse([*element_force(positions, self.element, E, nu, load)])
        row, size = (self._place, 3 * len(self.mesh.nodes)) if everywhere else (self._row, self.n_q)
        return scale * sum_at(row.reshape(-1), ca.vec(f), size), ca.mmax(wave), ca.mmax(strain)

    @cached_property
    def _element_forces(self) -> ca.Function:
        """The loop over elements, one object, so that C has its code once."""
        return element_force_function(self.element).map(len(self.mesh.elements), [False, False, True, True])

    @cached_property
    def force(self) -> ca.Function:
        """``force(q, damage, pressure, p) -> f [N]``, ``p`` as ``MembraneParams.vector``."""
        symbols, arguments = self._symbols()
        return ca.Function("force", symbols, [self.force_expression(*arguments)[0]])

    @cached_property
    def tangent(self) -> ca.Function:
        """``tangent(q, damage, pressure, p) -> K = -df/dq`` [N/m], sparse; not symmetric under pressure."""
        symbols, arguments = self._symbols()
        return ca.Function("tangent", symbols, [self.tangent_expression(*arguments)])

    def tangent_expression(self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: SimpleNamespace, axes: int = 3) -> ca.MX:
        """Write the tangent ``K = -df/dq`` [N/m], sparse, shape (n_q axes/3, n_q axes/3), along the first 2 or 3 axes."""
        x, E, nu, load, scale = self._element_arguments(q, damage, pressure, p)
        n, size = len(self.mesh.elements), axes * len(self.element.nodes)
        tangent = element_tangent_function(self.element, axes).map(n, "serial")
        blocks = tangent(x, E, ca.repmat(nu, 1, n), ca.repmat(load, 1, n))
        row = self._row[:, :size]
        row = row // 3 * axes + row % 3
        return -scale * self._units_per_side / p.side_length * self._assemble(blocks, row, self.n_q * axes // 3)

    @cached_property
    def node_area(self) -> Vector:
        """Share of each interior node in the area of the square [1], shape (n_q / 3,): the weights of Gauss-Lobatto."""
        return self._node_areas[self.mesh.interior]

    @cached_property
    def edge_area(self) -> Vector:
        """Share of each node of ``edge`` in the area of the square [1]."""
        return self._node_areas[self.edge]

    @cached_property
    def _node_areas(self) -> Vector:
        _, w = lobatto_points(self.mesh.order + 1)
        area = np.zeros(len(self.mesh.nodes))
        np.add.at(area, self.mesh.elements.reshape(-1), np.tile(np.kron(w, w), len(self.mesh.elements)))
        return area / self._units_per_side**2

    def node_mass(self, p: SimpleNamespace | MembraneParams) -> Any:  # noqa: ANN401
        """Return the masses [kg] of the interior nodes, once for each of x, y, z, shape (n_q,)."""
        return p.density * p.thickness * p.side_length**2 * np.repeat(self.node_area, 3)

    def inverse_mass(self, p: SimpleNamespace) -> ca.MX:
        """Return one over ``node_mass`` [1/kg] with a single division, shape (n_q,)."""
        return 1.0 / (p.density * p.thickness * p.side_length**2) * ca.DM(1.0 / np.repeat(self.node_area, 3))

    def lumped_mass(self, p: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the diagonal mass matrix [kg] of the interior nodes, shape (n_q, n_q)."""
        return scipy.sparse.diags(self.node_mass(p), format="csc")

    def consistent_mass(self, p: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the mass matrix [kg] by the element's own quadrature, shape (n_q, n_q); diagonal for spectral elements."""
        m = len(self.element.nodes)
        by_axis = np.arange(3 * m).reshape(m, 3).T.reshape(-1)
        block = element_mass(self.element)[np.ix_(by_axis, by_axis)]
        blocks = np.tile(block, len(self.mesh.elements))
        unit = p.side_length / self._units_per_side
        mass = ca.evalf(self._assemble(ca.MX(ca.DM(blocks)), self._row, self.n_q))
        return p.density * p.thickness * unit**2 * mass.sparse()

    def _symbols(self) -> tuple[list[ca.MX], tuple[ca.MX, ca.MX, ca.MX, SimpleNamespace]]:
        """Make the arguments of a function: as vectors, and with the parameters by name."""
        q, damage, pressure = ca.MX.sym("q", self.n_q), ca.MX.sym("damage", N_ZONES), ca.MX.sym("pressure")
        p = ca.MX.sym("p", len(PARAMETERS))
        return [q, damage, pressure, p], (q, damage, pressure, by_name(PARAMETERS, p))

    def _element_arguments(
        self, q: ca.MX, damage: ca.MX, pressure: ca.MX, p: SimpleNamespace
    ) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX, ca.MX]:
        """Return what ``element_force`` takes, one column per element, and the factor that makes its forces newtons."""
        x = ca.reshape(self.positions(q, p)[self._place.reshape(-1).tolist()], -1, len(self.mesh.elements))
        E = (p.youngs_modulus * (1.0 - damage))[self.mesh.zone.tolist()].T
        unit = p.side_length / self._units_per_side
        return x, E, p.poisson_ratio, pressure * unit / p.thickness, unit * p.thickness

    def _assemble(self, blocks: ca.MX, rows: NDArray[np.int64], size: int) -> ca.MX:
        """Sum square matrices of all elements, side by side, into a sparse matrix, shape (size, size)."""
        n, m = rows.shape
        row = np.repeat(rows.reshape(n, 1, m), m, axis=1).reshape(-1)  # CasADi stores column by column
        column = np.repeat(rows.reshape(n, m, 1), m, axis=2).reshape(-1)
        held = (row == size) | (column == size)
        key, place = np.unique(np.where(held, size**2, column * size + row), return_inverse=True)
        key = key[key < size**2]
        pattern = ca.Sparsity.triplet(size, size, (key % size).tolist(), (key // size).tolist())
        return ca.MX(pattern, sum_at(place, ca.vec(blocks), key.size))


def sum_at(places: NDArray[np.int64], values: ca.MX, size: int) -> ca.MX:
    """Sum values at their places, shape (size,), and leave out those at place ``size``: the transpose of indexing."""
    x = ca.MX.sym("x", size + 1)
    return ca.jtimes(x[places.tolist()], x, values, True)[:size]
