"""Figures 4.1 to 4.6: relays, the Preisach plane and the output in four stages of a cycle, drawn from the equations.

Symbols as in Section 4.1: ``alpha >= beta`` switching strains, ``mu`` density, here uniform, ``eta`` share of ``mu`` that
a relay loses when it switches down; all over full scale [1].
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from .style import BLUE, ORANGE, RED, SKY, Vector, panels, save

ETA = 0.7
STAGES = ("(a) at rest", "(b) rising to u", "(c) at the peak", "(d) falling to u")
U = 0.6
UP, PARTLY, DOWN = SKY, ORANGE, "white"


def relays(pictures: Path) -> str:
    """Draw the relay of the classical and of the modified model."""
    figure, axes = panels(1, 2, (8.0, 2.9))
    alpha, beta = 0.65, 0.3
    for ax, low, drop, title in (
        (axes[0, 0], -1.0, 2.0, r"classical $\gamma_{\alpha\beta}$"),
        (axes[0, 1], 0.0, ETA, r"modified: up by 1, down by $\eta$"),
    ):
        colours = (BLUE, RED)
        start = low
        for cycle, colour in enumerate(colours if low == 0.0 else colours[:1]):
            top = start + (1.0 if low == 0.0 else 2.0)
            after = top - drop
            shift = 0.012 * cycle
            ax.plot([0.0, alpha, alpha, 1.0], [start, start, top, top], color=colour, label=f"cycle {cycle + 1}")
            ax.plot([1.0, beta + shift, beta + shift, 0.0], [top, top, after, after], color=colour, ls="--")
            for x, y, step in ((alpha, 0.5 * (start + top), 0.1), (beta + shift, 0.5 * (top + after), -0.1)):
                ax.annotate("", (x, y + step), (x, y - step), arrowprops={"arrowstyle": "-|>", "color": colour})
            start = after
        ax.set_xticks([0.0, beta, alpha, 1.0], ["0", r"$\beta$", r"$\alpha$", "1"])
        ax.set(xlabel="strain over full scale [1]", ylabel="output of one relay [1]", title=title)
    axes[0, 1].legend(loc="lower right")
    return save(figure, pictures, "relays")


def stages(pictures: Path) -> str:
    """Draw the plane and the output of both models in four stages of the first cycle."""
    figure, axes = panels(4, 4, (9.5, 9.3))
    for column, title in enumerate(STAGES):
        for first, eta, name in ((0, 1.0, "classical"), (2, ETA, rf"modified, $\eta$ = {ETA}")):
            _plane(axes[first, column], column, PARTLY if eta < 1.0 else DOWN)
            _output(axes[first + 1, column], column, eta)
            axes[first, column].set_title(f"{title}\n{name}" if column == 0 else f"{title}\n")
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")
    for colour, label in ((UP, "up"), (PARTLY, "down after up: keeps $1-\\eta$"), (DOWN, "never up")):
        axes[2, 0].fill_between([], [], [], fc=colour, ec="0.4", label=label)
    figure.legend(loc="outside lower center", ncols=3)
    return save(figure, pictures, "preisach_stages")


def path(stage: int) -> Vector:
    """Return the strains [1] from rest up to a stage."""
    ends = ((0.0,), (0.0, U), (0.0, 1.0), (0.0, 1.0, U))[stage]
    legs = [np.linspace(a, b, round(200 * abs(b - a)) + 1) for a, b in pairwise(ends)]
    return np.concatenate(legs) if legs else np.zeros(1)


def output(strain: Vector, eta: float, points: int = 200) -> Vector:
    """Return the output [1] of relays of uniform density that rise by 1 and fall by eta, over that of all of them up."""
    middles = (np.arange(points) + 0.5) / points
    beta, alpha = np.meshgrid(middles, middles)
    acting = alpha >= beta
    up = np.zeros_like(acting)
    f, outputs = 0.0, []
    for u in strain:
        rise, fall = acting & ~up & (alpha <= u), up & (beta >= u)
        f += (rise.sum() - eta * fall.sum()) / acting.sum()
        up = (up | rise) & ~fall
        outputs.append(f)
    return np.array(outputs)


def _plane(ax: Axes, stage: int, fallen: str) -> None:
    """Fill the triangle alpha >= beta by the state of its relays."""
    ax.fill([0, 0, 1], [0, 1, 1], color=DOWN)
    if stage == 1:
        ax.fill([0, 0, U], [0, U, U], color=UP)
    elif stage == 2:
        ax.fill([0, 0, 1], [0, 1, 1], color=UP)
    elif stage == 3:
        ax.fill([0, 0, U, U], [0, 1, 1, U], color=UP)
        ax.fill([U, U, 1], [U, 1, 1], color=fallen)
        ax.plot([U, U], [U, 1], color="0.2")
    if stage == 1:
        ax.plot([0, U], [U, U], color="0.2")
    ax.plot([0, 0, 1, 0], [0, 1, 1, 0], color="0.2", lw=0.8)
    ax.set(xlim=(-0.04, 1.04), ylim=(-0.04, 1.04), xlabel=r"$\beta$ [1]", ylabel=r"$\alpha$ [1]", aspect="equal")


def _output(ax: Axes, stage: int, eta: float) -> None:
    whole = np.concatenate([path(2), path(2)[::-1]])
    if eta < 1.0:
        whole = np.concatenate([whole, whole])
    ax.plot(whole, output(whole, eta), color="0.8", lw=0.9)
    strain = path(stage)
    ax.plot(strain, output(strain, eta), color=BLUE)
    ax.plot(strain[-1], output(strain, eta)[-1], "o", color=BLUE, ms=4)
    ax.set(xlim=(-0.04, 1.04), ylim=(-0.05, 1.4), xlabel="strain [1]", ylabel="output [1]")
