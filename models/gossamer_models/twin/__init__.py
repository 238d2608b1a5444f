"""The digital twin: damages with standard deviations, from a record of strain or resistance."""

from .answer import Answer
from .reading import make_record, read_table
from .record import Record
from .twin import Twin

__all__ = ["Answer", "Record", "Twin", "make_record", "read_table"]
