"""Names, units and packaging: builds FMUs from step models."""

from .build import build_all, build_fmu
from .catalogue import CHAIN, NAMES
from .page import variables_table

__all__ = ["CHAIN", "NAMES", "build_all", "build_fmu", "variables_table"]
