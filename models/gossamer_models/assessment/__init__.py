"""Assessment of damage detection: judges under conditions, with the statistics that an inspector asks for."""

from .conditions import conditions, detections, plan_of_square
from .figures import Figures, confusion, figures, reliability
from .judges import AlwaysZero, DetectorJudge, PosteriorJudge, TwinJudge, Verdicts, read_judge, shipped_judges, twin_judges
from .pod import fit_pod, share, size_by_counts, threshold_for
from .results import AssessmentResults, read_assessment, write_assessment
from .run import assess

__all__ = [
    # whom to assess
    "AlwaysZero",
    "DetectorJudge",
    "PosteriorJudge",
    "read_judge",
    "shipped_judges",
    "twin_judges",
    "TwinJudge",
    "Verdicts",
    # all at once
    "assess",
    "AssessmentResults",
    "conditions",
    "plan_of_square",
    "detections",
    "read_assessment",
    "write_assessment",
    # statistics
    "confusion",
    "Figures",
    "figures",
    "fit_pod",
    "reliability",
    "share",
    "size_by_counts",
    "threshold_for",
]
