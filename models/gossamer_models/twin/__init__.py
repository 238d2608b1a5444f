"""The digital twin: damages with standard deviations, from a record of strain or resistance."""

from .answer import Answer
from .calibrating import calibrate
from .calibration import Calibration
from .faults import known_faults
from .forward import Forward, MembraneForward
from .history import InspectionHistory
from .inspecting import Earlier, inspect
from .mesh_error import MeshErrors
from .nuisances import Loads, LoadTable, Nuisances
from .reading import make_record, read_arriving, read_loads, read_survey, read_table
from .recalibration import Recalibrated, recalibrate
from .record import ResponseRecord, StaticRecord
from .twin import Twin
from .watch import Watch
from .window import DamageOnset, Window

__all__ = [
    "Answer",
    "Calibration",
    "DamageOnset",
    "Earlier",
    "Forward",
    "InspectionHistory",
    "LoadTable",
    "Loads",
    "MembraneForward",
    "MeshErrors",
    "Nuisances",
    "Recalibrated",
    "ResponseRecord",
    "StaticRecord",
    "Twin",
    "Watch",
    "Window",
    "calibrate",
    "inspect",
    "known_faults",
    "make_record",
    "read_arriving",
    "read_loads",
    "read_survey",
    "read_table",
    "recalibrate",
]
