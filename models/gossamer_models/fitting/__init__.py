"""Records, errors and least squares: what every fit of a model to measurements needs."""

from .errors import Errors, Parameter, covariance, e1, nrmse, stretch_errors
from .reading import Columns, read_record, read_records
from .records import Record, training_rows

__all__ = [
    "Columns",
    "Errors",
    "Parameter",
    "Record",
    "covariance",
    "e1",
    "nrmse",
    "read_record",
    "read_records",
    "stretch_errors",
    "training_rows",
]
