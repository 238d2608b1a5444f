"""The page of a membrane's modes: their shapes in motion, and what damage does to their frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gossamer_files.charts import Array, Chart, bars, heat
from gossamer_files.tables import TableText
from gossamer_models.membrane import Modes, Sensitivities
from gossamer_orchestrator.pages import Page
from gossamer_orchestrator.results.report.page import ASSETS

from .space import in_space, space_chart

FRAMES = 16  # of a cycle
DRAWN = 0.08  # of the size: how far a mode moves on the page
MOST_NUMBERS = 4_000_000  # of all places on a page


def modes_page(title: str, modes: Modes, changes: Sensitivities | None, sentence: str, tables: Sequence[TableText]) -> Page:
    """Describe modes, as many as fit on a page."""
    structure, labels = modes.linearised.structure, [str(k + 1) for k in range(len(modes.squares))]
    note = "Each mode moves through a cycle, by 8 % of the size at most."
    charts = [space_chart("Shapes", note, "The modes in motion.")]
    share = 100.0 * modes.effective_masses[:, :3] / np.diag(modes.moving)[:3]
    along = [bars(f"along {axis}", labels, share[:, k], f"@{k}") for k, axis in enumerate("xyz")]
    charts.append(Chart("Effective mass", "mode", "share of what moves [%]", along, layout={"xaxis": {"type": "category"}}))
    if changes is not None and structure.n_zones:
        zones = [str(k + 1) for k in range(structure.n_zones)]
        map_ = heat(zones, labels, changes.frequency, "per damage [1]")
        category = {axis: {"type": "category"} for axis in ("xaxis", "yaxis")}
        charts.append(Chart("Relative change of frequency by damage", "zone", "mode", [map_], layout=category))
    return Page(
        title=title,
        kind="none",
        sentence=sentence,
        charts=charts,
        content=_moving(modes),
        scripts=[ASSETS / "surface.js", ASSETS / "run.js"],
        controls=(ASSETS / "player.html").read_text(encoding="utf-8"),
        facts=list(tables),
        how="The forces that step the membrane are linearised exactly about its equilibrium under the loads given.",
    )


def _moving(modes: Modes) -> dict[str, Any]:
    """Return what the page needs to draw the modes in motion, one after the other."""
    linearised, f = modes.linearised, modes.frequencies
    nodes = linearised.structure.mesh.nodes
    most = MOST_NUMBERS // (3 * FRAMES * len(nodes))
    shapes = modes.shapes[: max(1, most)]
    sizes: Array = np.linalg.norm(shapes, axis=2)
    largest = sizes.max(axis=1)
    phase = np.cos(2.0 * np.pi * np.arange(FRAMES) / FRAMES)
    size = float(np.ptp(nodes, axis=0).max())
    moved = np.einsum("f,mna->mfna", phase, shapes * (DRAWN * size / largest)[:, None, None]).reshape(-1, *nodes.shape)
    count = np.arange(len(moved))
    values = np.einsum("f,mn->mfn", np.abs(phase), sizes / largest[:, None]).reshape(len(moved), -1)
    colour = {"name": "displacement", "of": "node", "values": values, "ends": [0.0, 1.0], "unit": "of the largest"}
    names = linearised.structure.zone_names
    return {
        "start": 0.0,
        "end": float(count[-1]),
        "begin": 0,
        "instants": [f"mode {k // FRAMES + 1}: {f[k // FRAMES]:.4g} Hz" for k in count],
        **in_space(linearised.structure, count.astype(float), [colour], names, linearised.displacement + moved),
    }
