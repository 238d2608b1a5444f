"""A stored sensor judged on other records: the work of the command ``gossamer assess``."""

from .judge import Judged, judge_files, save_judged
from .scales import RelaxingScales, fit_scales

__all__ = ["Judged", "RelaxingScales", "fit_scales", "judge_files", "save_judged"]
