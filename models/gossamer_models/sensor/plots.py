"""Pictures of a sensor: densities over the Preisach plane and Everett surfaces.

A picture that is added to ``sensor_pictures`` is drawn by ``gossamer identify``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from gossamer_files.pictures import axes_or_new

from ..arrays import Matrix
from ..fitting.plots import FITTED, PREDICTED, Picture, into_axes
from .artifact import SensorArtifact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ETA_SCALE = (0.9, 1.1)  # [1]
SAME_ETA = 0.01  # [1] less is one colour on that scale
TITLES = {"mu": "mu (the elastic line may exceed the scale)", "eta": "eta, the share of mu that a down-switch removes"}


def preisach_plane(artifact: SensorArtifact, name: str) -> Matrix:
    """Return ``mu`` or ``eta`` over the Preisach plane, shape (N, N).

    The cell of line i and bin k lies in row k, column k - i; not a number above the elastic line, and eta where mu is zero.
    """
    N = artifact.n_lines
    plane = np.full((N, N), np.nan)
    line, k = np.triu_indices(N)
    values = artifact.tables()[0] if name == "mu" else _eta(artifact)
    plane[k, k - line] = values[line, k]
    return plane


def plot_plane(artifact: SensorArtifact, name: str, *, ax: Axes | None = None) -> Axes:
    """Draw ``mu`` or ``eta`` over the Preisach plane."""
    ax = axes_or_new(ax)
    plane = preisach_plane(artifact, name)
    off_line = plane[np.tril_indices(artifact.n_lines, -1)]
    top = float(np.nanmax(off_line)) if np.isfinite(off_line).any() else 1.0
    low = None
    if name == "eta":  # keep meaningless differences out of the colours
        low, top = min(ETA_SCALE[0], float(np.nanmin(plane))), max(ETA_SCALE[1], top)
    image = ax.imshow(plane, origin="lower", extent=(0, 1, 0, 1), vmin=low, vmax=top, cmap="viridis")
    ax.figure.colorbar(image, ax=ax, label=r"$\mu$ [1]" if name == "mu" else r"$\eta$ [1]")
    ax.grid(visible=False)
    ax.set(xlabel=r"$\beta$ [1]", ylabel=r"$\alpha$ [1]", title=TITLES[name])
    return ax


def constant_eta(artifact: SensorArtifact) -> float | None:
    """Return ``eta`` [1] if it is the same all over the plane but for ``SAME_ETA``, else None."""
    eta = _eta(artifact)
    return float(np.nanmean(eta)) if np.nanmax(eta) - np.nanmin(eta) < SAME_ETA else None


def _eta(artifact: SensorArtifact) -> Matrix:
    """Return ``eta`` [1] of each line and bin, shape (N, N); not a number where ``mu`` is zero."""
    mu, nu = artifact.tables()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mu > 0.0, nu / mu, np.nan)


def everett(artifact: SensorArtifact) -> tuple[Matrix, Matrix]:
    """Return the Everett surfaces of the static operators on the lattice.

    Returns
    -------
    up, down : ndarray, shape (N + 1, N + 1)
        Element [a, b]: rise of the output [1] when strain rises from b/N, at rest or after falling from full scale, to a/N
        >= b/N, and its fall on the way back from a/N to b/N, Eqs. (5.3) and (5.4) of the thesis without
        relaxation; not a number for a < b.
    """
    N = artifact.n_lines
    surfaces = np.full((2, N + 1, N + 1), np.nan)
    line, k = np.triu_indices(N)
    for surface, table in zip(surfaces, artifact.tables(), strict=True):
        square = np.zeros((N, N))
        square[k, k - line] = table[line, k] / N
        for b in range(N + 1):
            grown = square[:, b:].sum(axis=1)
            surface[b:, b] = np.concatenate([[0.0], np.cumsum(grown[b:])])
    return surfaces[0], surfaces[1]


def plot_everett(artifact: SensorArtifact, *, ax: Any) -> Any:  # noqa: ANN401
    """Draw the Everett surfaces for rising and falling strain into axes in space."""
    up, down = everett(artifact)
    axis = np.linspace(0.0, 1.0, artifact.n_lines + 1)
    low, high = np.meshgrid(axis, axis)
    ax.plot_wireframe(high, low, up, color=FITTED, lw=0.6, label="rising")
    ax.plot_wireframe(low, high, -down, color=PREDICTED, lw=0.6, label="falling")
    ax.set(
        xlabel="new strain [1]", ylabel="extreme before [1]", zlabel="change of output [1]", title="Everett surfaces"
    )
    ax.xaxis.labelpad = ax.yaxis.labelpad = 8.0
    ax.zaxis.labelpad = 14.0
    ax.tick_params(axis="z", pad=8.0)  # room for a sign
    ax.view_init(elev=30.0, azim=110.0)  # the surfaces are close to a plane, which is edge-on from the front
    ax.set_box_aspect(None, zoom=0.9)  # room for the label
    ax.legend()
    return ax


def sensor_pictures(artifact: SensorArtifact) -> dict[str, Picture]:
    """Return the pictures of a sensor by name; a constant ``eta`` stands in the title of ``mu``."""

    def draw_mu(figure: Figure) -> None:
        ax = plot_plane(artifact, "mu", ax=figure.subplots())
        if constant is not None:
            ax.set_title(f"{TITLES['mu']}; eta = {constant:.3g} all over the plane")

    def draw_everett(figure: Figure) -> None:
        plot_everett(artifact, ax=figure.add_subplot(projection="3d"))

    constant = constant_eta(artifact)
    eta = {"eta": into_axes(plot_plane, artifact, "eta")} if constant is None else {}
    return {"mu": draw_mu, **eta, "everett": draw_everett}
