"""The SYNTHETIC datasets as records of either kind of fit."""

from __future__ import annotations

import numpy as np
from gossamer_models.fractional import UniformRecord
from gossamer_models.identification import Record
from gossamer_models.specimen import dataset


def specimen_record(number: int) -> Record:
    """Return a SYNTHETIC dataset as a record of the change of resistance [ohm]."""
    data = dataset(number)
    return Record(
        name=data.name,
        time=data.time,
        strain=data.strain,
        output=data.resistance_change,
        lines=np.arange(data.time.size, dtype=int) + 2,
    )


def uniform_record(number: int) -> UniformRecord:
    """Return a SYNTHETIC dataset as a record of the resistance [ohm] in equal steps, with its stretch for fitting."""
    data = dataset(number)
    return UniformRecord(
        strain=data.strain,
        resistance=data.resistance,
        sampling_step=float(data.time[1] - data.time[0]),
        rest_resistance=data.rest_resistance,
        train=data.train,
        name=data.name,
    )
