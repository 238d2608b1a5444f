"""Write docs/damage.md and its pictures: Chapter 7 of the thesis and the assessment of our detectors.

Run ``make figures``. It shows what ``gossamer assess-detector --twin --cases 200`` left in out/assessment. If there is
nothing, it assesses the detectors alone, in ten minutes; the twins, which have columns here too, take half an hour more.
"""

from __future__ import annotations

from pathlib import Path

from gossamer_models.assessment import AlwaysZero, assess, read_assessment, shipped_judges, write_assessment
from gossamer_models.assessment.results import FILE
from studies.damage import thesis_trainings, write

DOCS = Path(__file__).resolve().parent
FOLDER = DOCS.parent / "out" / "assessment"
CASES = 200


def main() -> None:
    """Assess, unless that has been done, and write the page."""
    if not (FOLDER / FILE).exists():

        def report(what: str, done: int, total: int) -> None:
            print(f"{done} of {total}: {what}", flush=True)

        judges = [AlwaysZero(), *shipped_judges()]
        write_assessment(assess(judges, FOLDER / "simulations", cases=CASES, report=report), FOLDER)
    write(read_assessment(FOLDER), thesis_trainings(), DOCS)


if __name__ == "__main__":
    main()
