"""Names, units and packaging: builds FMUs from step models."""

from .build import build_all, build_fmu, build_native_fmu
from .description import variables_table
from .interface import NAMES, Interface, read_interface

__all__ = ["NAMES", "Interface", "build_all", "build_fmu", "build_native_fmu", "read_interface", "variables_table"]
