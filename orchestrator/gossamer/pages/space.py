"""A structure in space on a page: its faces, how they move, and what colours them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gossamer_files.charts import Array, Chart
from gossamer_models.membrane import Structure
from gossamer_models.membrane.shape import membrane_shape
from gossamer_orchestrator.fmi.shape import Surface
from gossamer_orchestrator.results.report.membrane import surface_content
from gossamer_orchestrator.results.shapes import ShapeHistory


def surface_of(structure: Structure) -> Surface:
    """Return a structure as faces, from the membrane's own origin [m]."""
    with np.load(io.BytesIO(membrane_shape(structure, structure.table))) as files:
        known, size = Surface.stored(files), structure.mesh.size if files["size"] >= 0 else 1.0
    return replace(known, nodes=size * known.nodes, sensor_points=size * known.sensor_points)


def in_space(
    structure: Structure, time: Array, colours: Sequence[dict[str, Any]], names: Sequence[str], moved: Array | None = None
) -> dict[str, Any]:
    """Return what a page needs to draw a structure at n times, at rest or displaced by ``moved`` [m], shape (n, N, 3)."""
    surface, count = surface_of(structure), len(time)
    places = surface.nodes + (np.zeros((count, 1, 1)) if moved is None else moved)
    history = ShapeHistory(surface, time, places, np.zeros((count, len(surface.poisson_ratio), 3)))
    drawn = surface_content(history, np.arange(count))
    return {
        "frames": time,
        "surface": drawn | {"unit": "m", "marked": False, "names": list(names), "colours": list(colours)},
    }


def space_chart(title: str, note: str, text: str) -> Chart:
    """Return the chart that a structure is drawn into."""
    note = f"{note} Drag to turn; squares are zones, dots sensors."
    return Chart(title, note=note, text=text, tall=True, broad=True, script="addSurface")
