"""Assessment of damage detection: judges under conditions, with the statistics that an inspector asks for."""

from .conditions import Condition, Detection, conditions, detections, plan_of_square
from .figures import Figures, confusion, figures, reliability
from .judges import (
    AlwaysZero,
    DetectorJudge,
    Judge,
    PosteriorJudge,
    TwinJudge,
    Verdicts,
    read_judge,
    shipped_judges,
    twin_judges,
)
from .pod import Pod, Share, fit_pod, share, size_by_counts, threshold_for
from .results import AssessmentResults, read_assessment, write_assessment
from .run import assess

__all__ = [
    # whom to assess
    "AlwaysZero",
    "DetectorJudge",
    "Judge",
    "PosteriorJudge",
    "read_judge",
    "shipped_judges",
    "twin_judges",
    "TwinJudge",
    "Verdicts",
    # all at once
    "assess",
    "AssessmentResults",
    "Condition",
    "conditions",
    "Detection",
    "plan_of_square",
    "detections",
    "read_assessment",
    "write_assessment",
    # statistics
    "confusion",
    "Figures",
    "figures",
    "fit_pod",
    "Pod",
    "reliability",
    "Share",
    "share",
    "size_by_counts",
    "threshold_for",
]
