"""What a page of plots is: a picture file of one idea."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import xarray as xr

from ..roles import find

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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

    draw: Callable[[xr.Dataset, Figure], None]
    size: tuple[float, float]
    roles: tuple[str, ...]

    def __call__(self, data: xr.Dataset, figure: Figure) -> None:
        """Draw the page, if the components that it needs are there."""
        for role in self.roles:
            find(data, role)
        self.draw(data, figure)
