"""What a page of plots is: a picture file of one idea."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..roles import find

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Draw = Callable[["xr.Dataset", "Figure"], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page.

    Attributes
    ----------
    draw : callable
        Draws results into a figure; raises ``ResultsError`` if they do not allow it.
    size : tuple of float
        Width and height [inch].
    roles : tuple of str
        Components that the results must have: "membrane", "sensor", "compensator" or "detector".
    """

    draw: Draw
    size: tuple[float, float]
    roles: tuple[str, ...]

    def __call__(self, data: xr.Dataset, figure: Figure) -> None:
        """Draw the page, if the components that it needs are there."""
        for role in self.roles:
            find(data, role)
        self.draw(data, figure)


class Pages(dict[str, Page]):
    """Pages by file name; an instance is the decorator that adds one."""

    def __call__(self, name: str, *, size: tuple[float, float], roles: tuple[str, ...]) -> Callable[[Draw], Draw]:
        """Add a page."""

        def add(draw: Draw) -> Draw:
            self[name] = Page(draw=draw, size=size, roles=roles)
            return draw

        return add
