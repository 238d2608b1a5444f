"""Detectors: strain histories to damage per zone, by posterior networks or by the neuro-fuzzy networks of the thesis."""

from .artifact import DetectorArtifact
from .features import Components, block_means, difference_noise, principal_components
from .files import read_detector, shipped_detectors
from .model import detector_model
from .neurofuzzy import defuzzify, similarity, triangular_memberships
from .packets import block_energies, packet_energies
from .posterior import judge_records
from .posterior_artifact import PosteriorArtifact
from .posterior_model import posterior_model

__all__ = [
    # trained detectors
    "read_detector",
    "shipped_detectors",
    # posterior networks
    "PosteriorArtifact",
    "judge_records",
    "posterior_model",
    # their features
    "Components",
    "block_means",
    "difference_noise",
    "principal_components",
    # the detector of the thesis
    "DetectorArtifact",
    "block_energies",
    "defuzzify",
    "detector_model",
    "packet_energies",
    "similarity",
    "triangular_memberships",
]
