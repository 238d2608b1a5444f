"""Write docs/identification.md and its pictures: the thesis' tables and figures of chapters 3 to 5, and ours.

Run ``make figures``; it takes minutes. Elsewhere than beside a development checkout, the page omits the measured records.
"""

from __future__ import annotations

from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from studies.compute import compute
from studies.page import write

DOCS = Path(__file__).resolve().parent
DATA = DOCS.parents[1] / "shared" / "data"


def main() -> None:
    """Compute everything and write the page."""
    columns = (TextColumn("{task.description:>30}"), BarColumn(), TextColumn("{task.completed:.0f}"), TimeElapsedColumn())
    with Progress(*columns) as progress:
        task = progress.add_task("fits", total=None)

        def report(what: str, done: int, total: int) -> None:
            progress.console.print(f"{done} of {total}: {what}")  # also where there is no terminal to draw a bar on
            progress.update(task, completed=done, total=total)

        results = compute(DATA if DATA.is_dir() else None, report)
        progress.update(task, description="pictures")
        write(results, DOCS)


if __name__ == "__main__":
    main()
