"""Detectors: strain histories to damage per zone, by posterior networks or by the neuro-fuzzy networks of the thesis."""

from .artifact import DetectorArtifact
from .features import packet_energies
from .model import detector_model, posterior_model
from .networks import defuzzify, similarity, triangular_memberships
from .posterior import judge_records
from .posterior_artifact import PosteriorArtifact, read_detector, shipped_detectors

__all__ = [
    # trained detectors
    "read_detector",
    "shipped_detectors",
    # posterior networks
    "PosteriorArtifact",
    "judge_records",
    "posterior_model",
    # their features
    # the detector of the thesis
    "DetectorArtifact",
    "defuzzify",
    "detector_model",
    "packet_energies",
    "similarity",
    "triangular_memberships",
]
