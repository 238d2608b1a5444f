"""The page and the pictures of a run: charts of its results, and the two pens that draw them.

To add a picture, describe it as a ``Chart`` in the file of its theme, in a list of the page; as a file it has a name in
``PICTURES`` at the end of that file.
"""

from .page import run_page, write_report
from .pictures import save_pictures

__all__ = ["run_page", "save_pictures", "write_report"]
