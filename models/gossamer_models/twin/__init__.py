"""The digital twin: damages with standard deviations, from a record of strain or resistance."""

from .answer import Answer
from .reading import make_record, read_table
from .record import Record
from .twin import Twin
from .watch import Finding, Watch, Window

__all__ = ["Answer", "Finding", "Record", "Twin", "Watch", "Window", "make_record", "read_table"]
