"""Put judges to conditions and collect what they say.

Symbols: ``a`` sizes of single damages [1].
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..arrays import Rows, Vector
from ..campaign import CampaignPlan, Mesh
from ..detector.thesis_tables import TABLES, ThesisTables
from ..errors import ParameterError, require
from .conditions import KNOWN, SIZES, Condition, chosen, conditions, detections, finer, plan_of_square, table_conditions
from .figures import confusion, figures, reliability, scores
from .judges import Judge, Verdicts, ask
from .pod import fit_pod, share, threshold_for
from .records import Records, make_records
from .results import AssessmentResults, ConfusionRow, DetectionRow, Row, TableRow

FALSE_CALLS = 0.01  # share of healthy records that a threshold lets be called [1]
LEAST_SIZES = 12  # of a zone, for a curve of its own
CURVE = np.geomspace(SIZES[0], SIZES[-1], 25)
Report = Callable[[str, int, int], None]


def assess(
    judges: Sequence[Judge],
    folder: Path,
    *,
    cases: int = 400,
    plan: CampaignPlan | None = None,
    only: Sequence[str] = (),
    report: Report = lambda *_: None,
) -> AssessmentResults:
    """Assess judges under all conditions.

    Parameters
    ----------
    judges : sequence of Judge
        Whom to assess; their names differ.
    folder : Path
        Where simulations are kept, and what slow judges said of them: what is there is not repeated.
    cases : int
        Records of each condition, and of the healthy ones that thresholds come from; there are a fifth as many sizes in
        each zone.
    plan : CampaignPlan, optional
        Membrane, load, noise and times of a record; by default those that the shipped detectors are trained for.
    only : sequence of str
        Conditions by name, or ``all`` or ``short``: these alone, of which every judge is asked about all records, and no
        probability of detection. Empty for a whole assessment, in which slow judges leave out what is quick.
    report : callable
        Called with what is going on, and how many of all parts are done.

    Returns
    -------
    AssessmentResults

    Raises
    ------
    ParameterError
        Two judges have the same name, there are too few cases, or no such condition.
    GossamerError, OSError
        A simulation cannot run, or cannot be kept.
    """
    names = [judge.name for judge in judges]
    require(len(set(names)) == len(names), f"two judges have the same name: {', '.join(names)}. Name the files differently.")
    if cases < 4 and not only:
        msg = f"{cases} cases are too few to choose a threshold on one half and count on the other. Take 4 or more."
        raise ParameterError(msg)
    plan = plan or plan_of_square()
    mesh = plan.membrane
    other = finer(mesh)
    meshes = {"mesh": mesh, "another mesh": other}
    put, pairs = conditions(plan, other, cases), [] if only else detections(plan, cases)
    lacking = ", ".join(sorted(KNOWN - {condition.name for condition in put}))
    found = AssessmentResults(
        provenance={
            "gossamer": version("gossamer"),
            "cases": str(cases),
            **{what: _described(each) for what, each in meshes.items() if each is not None},
            **({"left out, since this structure cannot have it": lacking} if lacking else {}),
        },
        zone_names=list(mesh.structure.zone_names) if mesh.setup else [],
    )
    put = chosen(put, only) if only else put
    tables = TABLES if mesh.setup is None and not only else ()
    listed = [(table, condition) for table in tables for condition in table_conditions(table.damages, mesh)]
    total, done = len(put) + len(pairs) + len(listed), itertools.count()

    def begin(what: str) -> None:
        report(what, next(done), total)

    for condition in put:
        begin(condition.name)
        records = make_records(condition, folder)
        for judge in _readers(judges, records):
            if only or judge.most is None or not condition.quick:
                found.rows.append(_row(judge, condition, records, folder))
    for pair in pairs:
        begin(pair.name)
        healthy, damaged = (make_records(c, folder) for c in (pair.healthy, pair.damaged))
        for judge in _thorough(_readers(judges, healthy)):
            rows, counts = _detection(judge, pair.name, healthy, damaged, folder)
            found.detections.extend(rows)
            found.confusions.append(counts)
    for table, condition in listed:
        begin(f"{table.name}, {condition.name}")
        records = make_records(condition, folder)
        for judge in _thorough(_readers(judges, records)):
            found.tables.extend(_table(judge, table, condition, records, folder))
    begin("done")
    return found


def _described(mesh: Mesh) -> str:
    if mesh.setup is not None:
        return f"{mesh.setup.title or mesh.structure.mesh.name}, order {mesh.setup.order}"
    return f"{mesh.elements_per_side} x {mesh.elements_per_side} elements of order {mesh.order}"


def _readers(judges: Sequence[Judge], records: Records) -> list[Judge]:
    """Return the judges that can read the records."""
    return [judge for judge in judges if judge.reads == "strain" or records.resistance is not None]


def _thorough(judges: list[Judge]) -> list[Judge]:
    """Leave out the judges that have time for the conditions only."""
    return [judge for judge in judges if judge.sizes != 0]


def _ask(judge: Judge, records: Records, most: int | None, folder: Path) -> tuple[Verdicts, int]:
    """Return the verdicts on the first records, and their number."""
    histories = records.strain if judge.reads == "strain" else records.resistance
    assert histories is not None
    histories = histories[:most]
    return ask(judge, histories, records.step, folder / "verdicts"), len(histories)


def _row(judge: Judge, condition: Condition, records: Records, folder: Path) -> Row:
    verdicts, n = _ask(judge, records, judge.most, folder)
    damage = records.damage[:n]
    return Row(
        judge=judge.name,
        condition=condition.name,
        held_out=condition.held_out,
        figures=figures(damage, verdicts),
        reliability=reliability(damage, verdicts).tolist() if verdicts.deviation is not None else [],
        largest=[] if damage.any() else np.where(verdicts.valid, verdicts.damage.max(axis=1), 0.0).tolist(),
    )


def _detection(
    judge: Judge, name: str, healthy: Records, damaged: Records, folder: Path
) -> tuple[list[DetectionRow], ConfusionRow]:
    """Choose a threshold on every other healthy record, count on the others, and fit each zone and all together."""
    zones = damaged.damage.shape[1]
    most = None if judge.sizes is None else judge.sizes * zones
    quiet, _ = _ask(judge, healthy, None if most is None else most // 2, folder)
    largest = scores(quiet).max(axis=1)
    threshold = threshold_for(largest[::2], FALSE_CALLS)
    false_calls = share(largest[1::2] > threshold)
    verdicts, n = _ask(judge, damaged, most, folder)
    damage = damaged.damage[:n]
    a, zone = damage.max(axis=1), damage.argmax(axis=1)
    hit = scores(verdicts)[np.arange(n), zone] > threshold
    rows = []
    for number in range(zones + 1):
        among: Rows = np.ones(n, dtype=bool) if number == 0 else zone == number - 1
        if number and among.sum() < LEAST_SIZES:
            continue
        pod = fit_pod(a[among], hit[among])
        curve = np.column_stack([CURVE, pod.probability(CURVE), pod.lower_bound(CURVE)]).tolist()
        rows.append(
            DetectionRow(
                judge=judge.name,
                condition=name,
                zone=number,
                threshold=threshold,
                score="estimate" if verdicts.probability is None else "P(damaged)",
                false_calls=false_calls,
                sizes=int(among.sum()),
                hits=int(hit[among].sum()),
                curve=curve,
                hit_sizes=pod.size[pod.hit].round(5).tolist(),
                missed_sizes=pod.size[~pod.hit].round(5).tolist(),
                **{part: getattr(pod, part) for part in ("a50", "a90", "a90_95", "by_counts", "remark")},
            )
        )
    return rows, ConfusionRow(judge=judge.name, condition=name, counts=confusion(damage, verdicts, threshold).tolist())


def _table(judge: Judge, table: ThesisTables, condition: Condition, records: Records, folder: Path) -> list[TableRow]:
    verdicts, n = _ask(judge, records, None, folder)

    def percent(values: Vector) -> list[float]:
        return [round(100.0 * float(value), 4) for value in values]

    return [
        TableRow(
            table=table.name,
            case=table.cases[k],
            judge=judge.name,
            condition=condition.name,
            damage=percent(verdicts.damage[k]),
            deviation=[] if verdicts.deviation is None else percent(verdicts.deviation[k]),
            valid=bool(verdicts.valid[k]),
        )
        for k in range(n)
    ]
