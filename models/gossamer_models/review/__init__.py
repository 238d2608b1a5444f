"""A stored sensor judged on other records: the work of the command ``gossamer assess``."""

from .judge import Judged, judge_files, save_judged
from .scales import fit_scales

__all__ = ["Judged", "fit_scales", "judge_files", "save_judged"]
