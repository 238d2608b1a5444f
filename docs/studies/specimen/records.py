"""The SYNTHETIC datasets as records to fit."""

from __future__ import annotations

import numpy as np
from gossamer_models.fitting import Record

from .datasets import dataset


def specimen_record(number: int) -> Record:
    """Return a SYNTHETIC dataset as a record of the change of resistance [ohm]."""
    data = dataset(number)
    return Record(
        name=data.name,
        time=data.time,
        strain=data.strain,
        resistance=data.resistance_change,
        lines=np.arange(data.time.size, dtype=int) + 2,
    )
