"""How far the membrane's histories are from the converged ones, for each mesh, and what a mesh costs.

Symbols: ``h`` communication step [s]; ``change`` of the strains [1] since the start, shape (cases, sensors, steps); the
cases are the healthy membrane and 40 % damage in one of ``ZONES``; its ``signature`` is what that damage changes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg
from gossamer_models.batch import Batch
from gossamer_models.membrane import MembraneParams, membrane_model, square_structure
from numpy.typing import NDArray

from .corrected_bilinear import corrected_bilinear
from .square import SquareEquations

Vector = NDArray[np.float64]

STRAINS = [f"strain[{k}]" for k in range(1, 5)]
H, STEPS, FINER = 3e-4, 1000, 8
ZONES = (1, 2, 6)
DAMAGE = np.zeros((1 + len(ZONES), 16))
DAMAGE[np.arange(1, 1 + len(ZONES)), np.array(ZONES) - 1] = 0.4
REFERENCE = (4, 8)  # elements per side and order
MESHES = ((8, 1), (16, 1), (32, 1), (4, 3), (4, 4), (4, 5), (4, 6))
CORRECTED = (8, 16)


@dataclass(frozen=True, kw_only=True)
class MeshRow:
    """Errors and cost of one mesh; errors are relative L2 [1] over all sensors and 0.3 s.

    Attributes
    ----------
    name : str
        Of the mesh.
    nodes : int
        Along a side.
    frequency : float
        First natural frequency [Hz], or nan.
    error, mesh_error, step_error : float
        Of the healthy history with steps of ``H``: against the reference; of the mesh alone, with fine steps; of the steps
        alone, against fine steps on the same mesh.
    signatures : tuple of float
        Errors of the signatures of damage in ``ZONES``, relative to them, with steps of ``H``.
    parts : float
        Internal steps in a step of ``H``, on average over the healthy run, or nan.
    cost : float
        CPU time of a case and a step of ``H`` in the batch kernel [s], or nan.
    change : ndarray, shape (cases, sensors, steps)
        The histories.
    """

    name: str
    nodes: int
    frequency: float
    error: float
    mesh_error: float
    step_error: float
    signatures: tuple[float, ...]
    parts: float
    cost: float
    change: Vector


@dataclass(frozen=True, kw_only=True)
class MeshStudy:
    """All meshes beside the reference.

    Attributes
    ----------
    rows : list of MeshRow
        The meshes.
    reference : ndarray, shape (cases, sensors, steps)
        Histories on ``REFERENCE`` with fine steps.
    """

    rows: list[MeshRow]
    reference: Vector


def run_study(report: Callable[[str], None] = lambda _: None) -> MeshStudy:
    """Run all meshes; takes minutes, most of which the compiler needs."""
    report("reference")
    reference, *_ = histories(*REFERENCE, finer=FINER)
    rows = []
    for n, order in MESHES:
        report(f"{n} x {n}, order {order}")
        coarse, parts, cost = histories(n, order)
        fine, *_ = histories(n, order, finer=FINER)
        name = f"bilinear, {n} x {n}" if order == 1 else f"spectral, order {order}"
        frequency = first_frequency(n, order)
        rows.append(_row(name, n * order + 1, coarse, fine, reference, frequency, parts, cost))
    for n in CORRECTED:
        report(f"corrected bilinear, {n} x {n}")
        coarse = corrected_bilinear(n, DAMAGE, STEPS, H)
        fine = corrected_bilinear(n, DAMAGE, STEPS, H, finer=FINER)
        rows.append(_row(f"bilinear, corrected, {n} x {n}", n + 1, coarse, fine, reference))
    return MeshStudy(rows=rows, reference=reference)


def histories(n: int, order: int, finer: int = 1, steps: int = STEPS) -> tuple[Vector, float, float]:
    """Run all cases on one mesh; return the change of strain, internal steps per step, and CPU time per case and step [s].

    Every case runs twice, so that the kernel's eight lanes are full.
    """
    batch = Batch(membrane_model(square_structure(n, order)), [*STRAINS, "max_step"])
    cost = np.inf
    for _ in range(3 if finer == 1 else 1):
        begin = time.process_time()
        run = batch.run(steps * finer, H / finer, {"damage": np.tile(DAMAGE, (2, 1))}, every=finer)
        cost = min(cost, (time.process_time() - begin) / (run.results.shape[0] * steps))
    change = (run.results - run.initial[:, :, None])[: len(DAMAGE), : len(STRAINS)]
    parts = np.ceil(H / finer / run.results[0, -1] - 1e-9).mean()
    return change, float(parts), cost


def distance(change: Vector, reference: Vector) -> float:
    """Return the relative L2 error [1]."""
    return float(np.linalg.norm(change - reference) / np.linalg.norm(reference))


def first_frequency(n: int, order: int) -> float:
    """Compute the first natural frequency [Hz] of the healthy membrane."""
    equations, params = SquareEquations(square_structure(n, order)), MembraneParams()
    K = equations.tangent(0.0, 0.0, 0.0, params.vector()).sparse()
    M = equations.lumped_mass(params)
    square = scipy.sparse.linalg.eigsh(K, 1, M, sigma=0.0, v0=np.ones(equations.n_q), return_eigenvectors=False)
    return float(np.sqrt(square[0]) / (2.0 * np.pi))


def _row(
    name: str,
    nodes: int,
    coarse: Vector,
    fine: Vector,
    reference: Vector,
    frequency: float = np.nan,
    parts: float = np.nan,
    cost: float = np.nan,
) -> MeshRow:
    signatures, true = coarse[1:] - coarse[0], reference[1:] - reference[0]
    return MeshRow(
        name=name,
        nodes=nodes,
        frequency=frequency,
        error=distance(coarse[0], reference[0]),
        mesh_error=distance(fine[0], reference[0]),
        step_error=distance(coarse[0], fine[0]),
        signatures=tuple(distance(*pair) for pair in zip(signatures, true, strict=True)),
        parts=parts,
        cost=cost,
        change=coarse,
    )
