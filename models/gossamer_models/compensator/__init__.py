"""Compensator: resistance back to strain, as the exact inverse of the sensor or as an estimator that bears noise."""

from .estimator import estimator_model
from .model import compensator_model

__all__ = ["compensator_model", "estimator_model"]
