"""The square's forces, tangent and masses as functions of numbers, for studies and tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import cached_property
from types import SimpleNamespace

import casadi as ca
import numpy as np
import scipy.sparse
from gossamer_models.membrane import MembraneEquations, MembraneParams, Structure, square_structure
from gossamer_models.membrane.assembly import Shared
from gossamer_models.membrane.element import dense
from gossamer_models.membrane.equilibrium import tangent
from gossamer_models.membrane.square import PARAMETERS
from gossamer_models.variables import Values, by_name
from numpy.typing import NDArray

Vector = NDArray[np.float64]
DEFAULTS = MembraneParams()


class SquareEquations:
    """Functions of displacements of the moving nodes [m], damage [1], pressure [Pa] and ``MembraneParams.vector``."""

    def __init__(self, structure: Structure | None = None) -> None:
        self.structure = square_structure() if structure is None else structure
        self._equations = MembraneEquations(self.structure)
        self.n_q = self._equations.n_q
        nodes, (block,) = self.structure.mesh.nodes[:, :2] / self.structure.mesh.size, self.structure.elements
        moving = self.structure.moving
        centre = int(np.argmin(np.abs(nodes[moving] - 0.5).sum(axis=1)))
        zone = self.structure.zone[block.combination]
        self.mesh = SimpleNamespace(nodes=nodes, elements=block.nodes, zone=zone, interior=moving, centre=centre)

    def _function(self, write: Callable[[ca.MX, Shared, Values], ca.MX]) -> ca.Function:
        q, damage, pressure = ca.MX.sym("q", self.n_q), ca.MX.sym("damage", 16), ca.MX.sym("pressure")
        p = ca.MX.sym("p", len(PARAMETERS))
        u, named = SimpleNamespace(damage=damage, pressure=pressure), by_name(PARAMETERS, p)
        x = self._equations.positions(q, u, named)
        shared = self._equations.shared(u, named, ca.MX(0.0), ca.MX(0.0))
        return ca.Function("f", [q, damage, pressure, p], [write(x, shared, named)])

    @cached_property
    def force(self) -> ca.Function:
        """Forces [N], shape (n_q,)."""
        return self._function(lambda x, shared, p: self._equations.forces(x, shared, p, p).f[: self.n_q])

    @cached_property
    def tangent(self) -> ca.Function:
        """``K = -df/dq`` [N/m], sparse; not symmetric under pressure."""
        return self._function(lambda x, shared, p: tangent(self._equations, x, shared, p, p, axes=3))

    def node_mass(self, params: MembraneParams) -> Vector:
        """Masses [kg] of the moving nodes, once for each of x, y, z."""
        return np.repeat(np.asarray(ca.evalf(self._equations.mass(SimpleNamespace(**asdict(params))))), 3)[: self.n_q]

    def lumped_mass(self, params: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the diagonal mass matrix [kg]."""
        return scipy.sparse.diags(self.node_mass(params), format="csc")

    def consistent_mass(self, params: MembraneParams) -> scipy.sparse.csc_matrix:
        """Return the mass matrix [kg] by the quadrature of the elements."""
        structure, (block,) = self.structure, self.structure.elements
        N = np.asarray(dense(block.element.N, block.nodes.shape[1]))
        per_area = params.density * params.thickness * (params.side_length / structure.mesh.size) ** 2
        entries = per_area * np.einsum("np,pa,pb->nab", block.geometry.J * block.element.w, N, N)
        row, column = np.repeat(block.nodes, N.shape[1], axis=1), np.tile(block.nodes, (1, N.shape[1]))
        whole = scipy.sparse.csc_matrix((entries.ravel(), (row.ravel(), column.ravel())))
        return scipy.sparse.kron(whole[structure.moving][:, structure.moving], np.eye(3), format="csc")

    def strain(self, q: Vector, params: MembraneParams = DEFAULTS) -> Vector:
        """Return what the gauges read [1]."""
        at = self.places(q, params)
        lines = np.concatenate([gauge.lines @ at for gauge in self.structure.gauges])
        return np.asarray(np.linalg.norm(lines, axis=1) - 1.0)

    def places(self, q: Vector, params: MembraneParams = DEFAULTS) -> Vector:
        """Return the positions of all nodes [sides of the mesh], shape (N, 3)."""
        x = np.asarray(self._positions(q, 0.0, 0.0, params.vector())).reshape(-1, 3)
        return x[np.argsort(self.structure.order)] * self.structure.mesh.size / params.side_length

    @cached_property
    def _positions(self) -> ca.Function:
        return self._function(lambda x, _shared, _p: x)
