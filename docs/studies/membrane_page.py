"""The page about the membrane's mesh, from the computed study."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .mesh_error import STEPS, ZONES, H, MeshRow, MeshStudy
from .style import BLUE, GREEN, MEASURED, RED, panels, save, show

DEFAULT = "spectral, order 4"
HEAD = """# How right the membrane's histories are

`make figures` writes this page; do not edit it. It compares meshes of the default membrane (damping 20 1/s, 10 kPa at
7.9 Hz) by the change of strain at the four sensors over 0.3 s, in steps of 3e-4 s. Errors are relative L2 against 4 x 4
elements of order 8, whose 33 x 33 nodes are stepped in at most 3.75e-5 s.

- **error**: what a user of the mesh gets. **mesh**, **step**: its two parts, with fine steps and against fine steps.
- **signature**: error of what 40 % damage in zone 1, 2 or 6 changes, relative to that change. Subtracting a healthy record
  does not remove the error of the mesh.
- **parts**: internal steps in 3e-4 s. **cost**: CPU time of a case and a step of 3e-4 s in the batch kernel, eight cases at
  once, on one core; it varies by a quarter from run to run. Up to order 4 and 8 x 8 the kernel is straight code, beyond it
  is loops, which take nearly twice as long per operation.
"""
WHY = """## Why order 4 by default, and 6 for more

- **Error per cost.** Order 4 costs {cost:.0f} us and leaves {error:.1f} %. Bilinear elements leave {bilinear:.1f} % for
  {same:.1f} times that cost (16 x 16) and {finest:.1f} % for {dear:.0f} times that cost (32 x 32). Elements of half the
  size, four times as many in twice as many steps, about halve their error.
- **One knob.** The mesh stays 4 x 4, one element per damage zone, so the edges of zones are edges of elements. Strain
  can be read anywhere at full order. The mass is diagonal by itself, so the step stays explicit.
- **Step.** The step of order 4 by itself is {step:.2f} % off. It adds little to the error of the mesh, {mesh:.2f} %, since
  their shapes differ. Higher orders need shorter steps; the step of order 6 is {step_6:.2f} % off.
- **More.** Order 6 has {error_6:.2f} %, and halves the errors of the signatures, for {ratio_6:.0f} times the cost:
  `gossamer build membrane --order 6`.
- **The alternative.** Bilinear elements with Gauss points at ±√(2/3) and one mass pass (*corrected*) cancel the dispersion
  of second order. They have a third of the error of plain ones, for 10 to 40 % more than their cost (a prototype's figure).
  At 17 x 17 nodes they are behind order 4 in the history and equal in the signatures. They need a product with the
  consistent mass in every step, and their strain is still read from bilinear elements.
- **Other programs.** Bilinear elements with lumped mass are what finite element programs have. They stay as
  `--elements-per-side 8 --order 1`, and equal Kratos to 1e-9 ([verification](verification.md)).
"""


def write(study: MeshStudy, docs: Path) -> None:
    """Write the page and its pictures into a folder."""
    rows = {row.name: row for row in study.rows}
    names = (DEFAULT, "spectral, order 6", "bilinear, 16 x 16", "bilinear, 32 x 32")
    default, six, sixteen, finest = (rows[name] for name in names)
    why = WHY.format(
        error=100.0 * default.error,
        cost=1e6 * default.cost,
        bilinear=100.0 * sixteen.error,
        same=sixteen.cost / default.cost,
        finest=100.0 * finest.error,
        dear=finest.cost / default.cost,
        step=100.0 * default.step_error,
        mesh=100.0 * default.mesh_error,
        step_6=100.0 * six.step_error,
        error_6=100.0 * six.error,
        ratio_6=six.cost / default.cost,
    )
    pictures = docs / "membrane"
    lines = [HEAD, *table(study.rows), "", *_error_picture(study, pictures), why, *_history_picture(study, pictures)]
    text = "\n".join(lines).replace("\n\n\n", "\n\n").rstrip() + "\n"
    (docs / "membrane.md").write_text(text, encoding="utf-8")


def table(rows: list[MeshRow]) -> list[str]:
    """Return the lines of the table."""
    zones = ", ".join(map(str, ZONES))
    lines = [
        "| mesh | nodes per side | first frequency [Hz], exact 20.1132 | error [%] | mesh | step "
        f"| signature {zones} [%] | parts | cost [us] |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        errors = " | ".join(f"{100.0 * error:.2f}" for error in (row.error, row.mesh_error, row.step_error))
        signatures = ", ".join(f"{100.0 * error:.0f}" for error in row.signatures)
        computed = ("-", "-", "-") if np.isnan(row.cost) else _figures(row)
        lines.append(
            f"| {row.name} | {row.nodes} | {computed[0]} | {errors} | {signatures} | {computed[1]} | {computed[2]} |"
        )
    return lines


def _figures(row: MeshRow) -> tuple[str, str, str]:
    return f"{row.frequency:.4f}", f"{row.parts:.1f}", f"{1e6 * row.cost:.1f}"


def _error_picture(study: MeshStudy, pictures: Path) -> list[str]:
    figure, ((history, signature),) = panels(1, 2, (9.0, 3.4))
    plain = {row.nodes: row.cost for row in study.rows if row.name.startswith("bilinear") and not np.isnan(row.cost)}
    kinds = {"bilinear, plain": (RED, "s"), "bilinear, corrected": (GREEN, "D"), "spectral, order 3 to 6": (BLUE, "o")}
    for kind, (colour, marker) in kinds.items():
        of_kind = [row for row in study.rows if _kind(row) == kind]
        cost = [1e6 * (plain[row.nodes] if np.isnan(row.cost) else row.cost) for row in of_kind]
        for ax, errors in (
            (history, [row.error for row in of_kind]),
            (signature, [float(np.mean(row.signatures)) for row in of_kind]),
        ):
            ax.loglog(cost, [100.0 * error for error in errors], marker=marker, color=colour, label=kind)
    history.set(xlabel="cost of a step [us]", ylabel="error [%]", title="History of strain")
    signature.set(xlabel="cost of a step [us]", ylabel="error [%]", title="Signature of 40 % in a zone, mean of three")
    for axis in (history.xaxis, signature.xaxis, history.yaxis, signature.yaxis):
        axis.set_major_formatter("{x:g}")
    signature.yaxis.set_minor_formatter("{x:g}")
    history.legend()
    caption = (
        "Error against cost: CPU time of a case and a step of 3e-4 s in the batch kernel. Corrected elements are drawn "
        "at the cost of plain ones, which they exceed by 10 to 40 % in a prototype."
    )
    return show(save(figure, pictures, "error_against_cost"), caption)


def _kind(row: MeshRow) -> str:
    if row.name.startswith("spectral"):
        return "spectral, order 3 to 6"
    return "bilinear, corrected" if "corrected" in row.name else "bilinear, plain"


def _history_picture(study: MeshStudy, pictures: Path) -> list[str]:
    figure, ((whole,), (left,)) = panels(2, 1, (9.0, 4.6), sharex=True)
    time, reference = H * np.arange(1, STEPS + 1), study.reference[0, 0]
    whole.plot(time, 100.0 * reference, color=MEASURED, lw=2.2, label="order 8")
    for name, colour in (("bilinear, 8 x 8", RED), (DEFAULT, BLUE)):
        change = next(row for row in study.rows if row.name == name).change[0, 0]
        whole.plot(time, 100.0 * change, color=colour, lw=0.9, label=name)
        left.plot(time, 100.0 * (change - reference), color=colour, lw=0.9, label=name)
    whole.set(ylabel="change of strain [%]", title="Sensor 1, undamaged membrane")
    left.set(xlabel="time [s]", ylabel="less that of order 8 [%]")
    whole.legend()
    return show(save(figure, pictures, "histories"), "Histories: strain at sensor 1 on two meshes and on the reference.")
