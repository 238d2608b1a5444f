"""Any step model for many cases at once, eight in the lanes of one vector."""

from .batch import Batch
from .cases import BatchRun, BatchState

__all__ = ["Batch", "BatchRun", "BatchState"]
