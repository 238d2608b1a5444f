"""The digital twin: damages with standard deviations, from a record of strain or resistance."""

from .reading import make_record, read_table
from .record import ResponseRecord
from .twin import Answer, Twin
from .watch import DamageOnset, Watch, Window

__all__ = ["Answer", "DamageOnset", "ResponseRecord", "Twin", "Watch", "Window", "make_record", "read_table"]
