r"""What a viewer needs to draw a membrane from a state of its model, as a file.

Symbols: ``N`` nodes, ``M`` of them free, ``n`` faces that are drawn, ``S`` ways in which inputs and parameters move nodes,
``R`` regions, ``K`` sensors. The place of a node is :math:`x = l X + q + \sum_s m_s w_s`: ``nodes`` times the variable
``size``; the displacements of the nodes in ``moving``, in the state from the place ``q`` on; and ``ways``, each times its
variable in ``moved_by``.
"""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHAPE = "shape.npz"
SCHEMA, VERSION = "gossamer.shape", 2


def shape_file(name: str, **arrays: Any) -> bytes:  # noqa: ANN401
    """Describe the shape of a membrane.

    Parameters
    ----------
    name : str
        Of the membrane.
    **arrays
        ``nodes`` (N, 3), in units of the size; ``faces`` (n, 4), nodes of quadrilaterals and, with -1 as the last, of
        triangles; ``element``, ``region`` and ``zone`` (n,) from 0, zone -1 where damage does not act; ``q``, place of the
        displacements in the state, three for each node in ``moving`` (M,); ``ways`` (S, N, 3) and ``moved_by`` (S,).
        Numbers of variables, or -1 for none: ``moved_by`` and ``size``, none being 1, and ``youngs_modulus``,
        ``temperature`` and ``poisson_from`` (R,), which is in place of ``poisson_ratio`` (R,) [1]. Of regions also
        ``thermal_expansion`` [1/K] (R,), ``prestress`` [Pa] and ``direction`` (R, 3). ``sensor_points``, in units of
        the size, and ``sensor_directions`` (K, 3).

    Returns
    -------
    bytes
        An NPZ file, with schema, version and name as JSON in ``card``; the same arrays give the same bytes.
    """
    file = io.BytesIO()
    np.savez(file, card=np.array(json.dumps({"schema": SCHEMA, "version": VERSION, "name": name})), **arrays)
    return file.getvalue()


def faces_of(elements: NDArray[np.int64], order: int) -> NDArray[np.int64]:
    """Return the quadrilaterals between neighbouring nodes of elements, whose nodes are numbered row by row."""
    side = order + 1
    s, t = np.meshgrid(np.arange(order), np.arange(order))
    first = (t * side + s).ravel()
    corners = np.column_stack([first, first + 1, first + side + 1, first + side])
    return elements[:, corners].reshape(-1, 4)
