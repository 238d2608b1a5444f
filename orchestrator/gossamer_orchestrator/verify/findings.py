"""The outcome of a check."""

from __future__ import annotations

from dataclasses import dataclass

PASSED, FAILED, REMARK, NOT_APPLICABLE = "passed", "failed", "remark", "not applicable"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Outcome of one check.

    Attributes
    ----------
    check : str
        Its name.
    verdict : str
        "passed", "failed", "remark" (allowed, but worth knowing) or "not applicable".
    why : str
        A sentence.
    """

    check: str
    verdict: str
    why: str
