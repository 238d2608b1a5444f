"""Names, units and packaging: builds FMUs from step models."""

from .build import build_all, build_models
from .catalogue import CHAIN, NAMES, fmu_folder
from .page import variables_table

__all__ = ["CHAIN", "NAMES", "build_all", "build_models", "fmu_folder", "variables_table"]
