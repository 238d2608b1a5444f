"""Keep the warnings of a run beside its results, for its page."""

from __future__ import annotations

import logging
from pathlib import Path
from types import TracebackType

from gossamer_files import replacing

from ..errors import ResultsError, writing
from ..results.files import MESSAGES

_PACKAGE = logging.getLogger(__name__.partition(".")[0])


class Messages(logging.Handler):
    """Collects warnings and errors of this package while it is a context.

    Attributes
    ----------
    texts : list of str
        Each with its level, on one line.
    """

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def __enter__(self) -> Messages:
        _PACKAGE.addHandler(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        _PACKAGE.removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message."""
        self.texts.append(f"{record.levelname.lower()}: {' '.join(record.getMessage().split())}")

    def save(self, folder: Path) -> None:
        """Write ``messages.txt``, or remove that of an earlier run if there is nothing to say."""
        path = folder / MESSAGES
        with writing(path, ResultsError):
            if not self.texts:
                path.unlink(missing_ok=True)
                return
            with replacing(path) as new:
                new.write_text("\n".join(self.texts) + "\n", encoding="utf-8")
