"""Compensator: resistance back to strain, the exact inverse of the sensor."""

from .model import compensator_model

__all__ = ["compensator_model"]
