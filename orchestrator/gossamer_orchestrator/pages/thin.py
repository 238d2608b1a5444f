"""Thin curves for a page: of each pixel's rows the smallest and the largest value, in their order.

Up to twice as many rows as pixels are kept as they are. So no peak is lost, whatever the length of the run, and a page of
any run has about the same size.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

PIXELS = 2500  # in the width of a picture
ROWS = 20_000  # that are in memory at a time

Array = NDArray[np.float64]


class Pixels:
    """The rows of a run as pixels.

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
