"""Long curves with fewer points that look the same: no peak is lost."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

PIXELS = 2500  # in the width of a picture
ROWS = 20_000  # that are in memory at a time

Array = NDArray[np.float64]


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Return fewer points: of a curve over time smallest and largest of each pixel, of a loop those of x and of y."""
    pixels = Pixels(len(x))
    if pixels.stride == 1:
        return x, y
    if (np.diff(x) > 0.0).all():
        parts = [(pixels.times(x[rows]), pixels.thin(y[rows])) for rows in pixels.parts()]
        return np.concatenate([time for time, _ in parts]), np.concatenate([values for _, values in parts])
    rows = _turns(x, y, 2 * pixels.stride)
    return x[rows], y[rows]


def _turns(x: Array, y: Array, length: int) -> NDArray[np.intp]:
    """Return the rows of the smallest and the largest x and y of every so many points, in their order along the curve."""
    rows = np.arange(-(-len(x) // length) * length).clip(max=len(x) - 1).reshape(-1, length)
    found = []
    for values in (x[rows], y[rows]):
        known = np.isfinite(values)
        found += [np.where(known, values, np.inf).argmin(axis=1), np.where(known, values, -np.inf).argmax(axis=1)]
    return np.unique(np.take_along_axis(rows, np.column_stack(found), axis=1))


class Pixels:
    """The rows of a long curve as pixels: of each the smallest and the largest value are kept, in their order.

    Up to twice as many rows as pixels are kept as they are. So no peak is lost, and
    a page of any run has about the same size.

    Parameters
    ----------
    rows : int
        How many there are.
    pixels : int
        How many pixels they become, at most.

    Attributes
    ----------
    stride : int
        Rows of a pixel; 1 if every row is kept.
    """

    def __init__(self, rows: int, pixels: int = PIXELS) -> None:
        self.rows = rows
        self.stride = 1 if rows <= 2 * pixels else -(-rows // pixels)

    def parts(self) -> Iterator[slice]:
        """Divide the rows into parts of whole pixels that fit in memory."""
        size = self.stride * max(1, ROWS // self.stride)
        return (slice(first, min(first + size, self.rows)) for first in range(0, self.rows, size))

    def thin(self, values: Array) -> Array:
        """Return the values to draw of one part.

        Parameters
        ----------
        values : numpy.ndarray, shape (n,)
            Values of the rows of a part.

        Returns
        -------
        numpy.ndarray, shape (n,) or (2 * ceil(n / stride),)
            The values, or smallest and largest of each pixel. A pixel without any value is not a number.
        """
        if self.stride == 1:
            return values
        table = self._table(values)
        known = np.isfinite(table)
        low, high = np.where(known, table, np.inf).argmin(axis=1), np.where(known, table, -np.inf).argmax(axis=1)
        order = np.sort(np.column_stack([low, high]), axis=1)
        return np.take_along_axis(table, order, axis=1).ravel()

    def times(self, time: Array) -> Array:
        """Return the times at which the values of a part are drawn: a quarter and three quarters into each pixel."""
        if self.stride == 1:
            return time
        return self._table(time)[:, [self.stride // 4, 3 * self.stride // 4]].ravel()

    def _table(self, values: Array) -> Array:
        """Return a row of values for each pixel; the last is filled with its last value."""
        missing = -len(values) % self.stride
        return np.concatenate([values, np.repeat(values[-1:], missing)]).reshape(-1, self.stride)
