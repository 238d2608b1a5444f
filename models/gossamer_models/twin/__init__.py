"""The digital twin: damages with standard deviations, from a record of strain or resistance."""

from .answer import Answer
from .forward import Forward, MembraneForward
from .mesh_error import MeshErrors
from .nuisances import Loads, LoadTable, Nuisances
from .reading import make_record, read_arriving, read_loads, read_table
from .record import ResponseRecord, StaticRecord
from .twin import Twin
from .watch import DamageOnset, Watch, Window

__all__ = [
    "Answer",
    "DamageOnset",
    "Forward",
    "LoadTable",
    "Loads",
    "MembraneForward",
    "MeshErrors",
    "Nuisances",
    "ResponseRecord",
    "StaticRecord",
    "Twin",
    "Watch",
    "Window",
    "make_record",
    "read_arriving",
    "read_loads",
    "read_table",
]
