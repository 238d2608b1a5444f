"""Detector: strain histories to damage per zone (Haar packet energies, similarity-based neuro-fuzzy networks)."""

from .artifact import DetectorArtifact
from .model import detector_model
from .neurofuzzy import defuzzify, similarity, triangular_memberships
from .packets import block_energies, packet_energies

__all__ = [
    "DetectorArtifact",
    "block_energies",
    "defuzzify",
    "detector_model",
    "packet_energies",
    "similarity",
    "triangular_memberships",
]
