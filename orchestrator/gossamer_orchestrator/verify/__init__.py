"""Verify any FMU: check it against the FMI standard and against its declared capabilities."""

from .checks import FAILED, NOT_APPLICABLE, PASSED, REMARK, Finding
from .process import verify

__all__ = ["FAILED", "NOT_APPLICABLE", "PASSED", "REMARK", "Finding", "verify"]
