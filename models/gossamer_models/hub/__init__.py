"""A rigid hub that flies: what carries a membrane where no other program simulates the spacecraft."""

from .model import hub_model

__all__ = ["hub_model"]
