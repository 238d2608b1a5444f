"""All checks, in the order of the report.

To add a check, write its function, decorated with ``check``, in the file of its theme.
"""

from . import archive_checks, behaviour_checks  # noqa: F401  each registers its checks
from .registry import CHECKS as CHECKS
