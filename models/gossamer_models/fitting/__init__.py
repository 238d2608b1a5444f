"""Records, errors and least squares: what every fit of a model to measurements needs."""

from .errors import covariance, e1, nrmse
from .reading import Columns, read_record, read_records
from .records import Record, training_rows

__all__ = ["Columns", "Record", "covariance", "e1", "nrmse", "read_record", "read_records", "training_rows"]
