"""Verify any FMU: check it against the FMI standard and against its declared capabilities."""

from .process import verify
from .registry import FAILED, NOT_APPLICABLE, PASSED, REMARK, Finding

__all__ = ["FAILED", "NOT_APPLICABLE", "PASSED", "REMARK", "Finding", "verify"]
