"""Sensors that are swapped or wrong: orders of the sensors, and sets without one, that explain a record better.

The membrane is symmetric about two axes, and so are its sensors. Swapping sensors 1 and 2 is therefore the same as
swapping 3 and 4 and mirroring the damage; of 24 orders, 6 can be told apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .record import N_SENSORS, Record

# Orders of the histories that no mirror turns into each other, and what to say of them; the first is as given.
ORDERS = {
    (1, 0, 2, 3): "1 and 2, or 3 and 4",
    (2, 1, 0, 3): "1 and 3, or 2 and 4",
    (3, 1, 2, 0): "1 and 4, or 2 and 3",
    (1, 2, 0, 3): "three of them",
    (2, 0, 1, 3): "three of them",
}


@dataclass(frozen=True)
class Wiring:
    """Another reading of a record.

    Attributes
    ----------
    order : tuple of int
        Sensors, 0 to 3, whose histories are taken for those of sensors 0 to 3.
    without : tuple of int
        Sensors that are left out.
    doubt : str
        What to say.
    """

    order: tuple[int, ...]
    without: tuple[int, ...]
    doubt: str

    @property
    def swaps(self) -> bool:
        """Whether it swaps sensors."""
        return self.order != tuple(range(N_SENSORS))

    def applied(self, record: Record) -> Record:
        """Return the record read this way."""
        return record.ordered(self.order).without(self.without)


def other_wirings(record: Record) -> list[Wiring]:
    """List what else a record of these sensors may be: swapped sensors, and one wrong sensor."""
    as_given, present = tuple(range(N_SENSORS)), record.sensors
    found = []
    if len(present) == N_SENSORS:
        for order, who in ORDERS.items():
            doubt = f"the record fits with sensors swapped: {who}. Damage may be mirrored; check the wiring"
            found.append(Wiring(order, (), doubt))
    if len(present) > 2:
        found += [Wiring(as_given, (k,), f"sensor {k + 1} contradicts the others and is left out") for k in present]
    return found


def best_wiring(record: Record, misfit: Callable[[Record], float]) -> Wiring | None:
    """Return the reading with the smallest misfit, or None if none passes.

    Parameters
    ----------
    record : Record
        Record that does not fit as it is.
    misfit : callable
        Takes a record and returns by how many standard deviations chi2 is above the expected one; above 3 is no fit.
    """
    wirings = other_wirings(record)
    misfits = np.array([misfit(wiring.applied(record)) for wiring in wirings])
    if misfits.size == 0 or not misfits.min() < 3.0:
        return None
    return wirings[int(misfits.argmin())]
