"""Fit of the modified Preisach sensor to records of strain and resistance."""

from .preisach import PreisachFit, fit_preisach
from .settings import PreisachSettings

__all__ = ["PreisachFit", "PreisachSettings", "fit_preisach"]
