"""Tables of sensors that were identified or judged: what was read, errors, rivals, trials, what a sensor consists of."""

import math
from collections.abc import Sequence
from itertools import zip_longest

from gossamer_files.tables import TableText

from .fitting import Record
from .fitting.errors import Parameter
from .fitting.records import Quantity
from .fractional import FractionalArtifact
from .identify import Identified
from .review import Judged
from .sensor import RelaxationTerm
from .sensor.fit import PreisachFit
from .sensor.plots import driven_by, time_of

UNITS = {"ohm": " ohm", "1": "", None: " (unit not stated)"}  # after a number, of ``Record.unit``


def recognised_table(records: Sequence[Record]) -> TableText:
    """Return what was recognised in the files of records, a row per quantity; nothing of one that comes from no file."""
    rows: list[tuple[str, ...]] = []
    for record in records:
        if (found := record.summary) is None:
            continue
        even = found.longest - found.shortest < 1e-3 * found.step
        varied = f"{found.shortest:.3g} to {found.longest:.4g} s, median {found.step:.3g} s"
        samples = f"{found.samples} samples" + f" of {found.rows} rows" * (found.rows > found.samples)
        first = (record.name, found.written, "")
        last = (samples, f"{found.step:.4g} s" if even else varied, f"gaps: {len(found.gaps)}" if found.gaps else "no gap")
        cells = [_cells(each) for each in found.quantities]
        cells += [("",) * 4] * (3 - len(cells))  # no time in a record without a clock
        rows += [(one, *four, six) for one, four, six in zip_longest(first, cells, last, fillvalue="")]
    return TableText(("record", "quantity", "column", "unit", "range", "samples, steps"), rows, "Read as")


def _cells(quantity: Quantity) -> tuple[str, ...]:
    column = quantity.column
    factor = 100.0 if column.what == "strain" else 1.0
    low, high = factor * quantity.lowest, factor * quantity.highest
    unit = column.unit or {"time": "s, not stated", "strain": "ratio, not stated"}.get(column.what, "not stated")
    resistance = " ohm" if column.what == "resistance" and column.unit is not None and column.si == "ohm" else ""
    after = {"time": " s", "strain": " %", "value": f" {unit}"}.get(column.what, resistance)
    return "temperature" if column.what == "value" else column.what, column.name, unit, f"{low:.5g} to {high:.5g}{after}"


def error_table(result: Identified, rest: str) -> TableText:
    """Return the errors on training and test stretches; ``rest`` is the resistance from which changes count, in words."""
    caption = f"E1: sum of errors over sum of changes from the {rest}"
    starts = result.fit.artifact.provenance.get("starts ended at", "")
    if "," in starts:
        caption += f".\nStarts ended at {starts} of the fitted range, regularisation included"
    head = ("record", "stretch", "samples", "E1 [% of change]", "NRMSE [% of range]", "recovered strain, NRMSE")
    rows = []
    for e in result.errors:
        recovered = "-" if e.strain_nrmse is None else f"{e.strain_nrmse:.3f}"
        rows.append((e.record, e.stretch, str(e.samples), f"{e.e1:.3f}", f"{e.nrmse:.3f}", recovered))
    return TableText(head, rows, caption)


def own_table(result: Identified) -> TableText:
    """Return what the compensator recovers of its own model's resistance, and what range that has over many cycles."""
    head = ("record", "without noise", "with its noise", "over the stated deviation", "range of 100 cycles [1]")
    rows = [
        (*(e.record, f"{e.clean:.3g}", f"{e.noisy:.3g}"), "-" if e.stated is None else f"{e.stated:.2g}", f"{size:.2f}")
        for e, size in zip(result.own, result.cycled, strict=True)
    ]
    return TableText(head, rows, "Strain recovered from what the sensor's own model gives, NRMSE [% of range]")


def standing_table(result: Identified) -> TableText:
    """Return the errors of the sensor beside those of its rivals."""
    caption = "NRMSE [% of range] on the test stretch; in brackets 90 % confidence from blocks of it"
    rows = [(each.record, each.model, _interval(each.forward), _interval(each.strain)) for each in result.standings]
    return TableText(("record", "model", "output", "recovered strain"), rows, caption)


def _interval(numbers: tuple[float, float, float] | None) -> str:
    return "-" if numbers is None else f"{numbers[0]:.2f} ({numbers[1]:.2f} to {numbers[2]:.2f})"


def trial_table(result: Identified, most: int) -> TableText:
    """Return what an automatic choice tried, of each stage the best ones."""
    caption = (
        "Error: NRMSE [% of range] on the later part of the training stretch; finalists are judged at two cuts of it. "
        "Extension, earlier relaxation, ridge, knots and residual network are options of gossamer identify --help. A filter "
        "that trusts its models less allows for outliers and for strain that changes its speed more."
    )
    rows: list[tuple[str, ...]] = []
    for stage in dict.fromkeys(trial.stage for trial in result.trials):
        here = [trial for trial in result.trials if trial.stage == stage]
        known = sorted((t for t in here if math.isfinite(t.error)), key=lambda t: (not t.final, t.error))[:most]
        rows += [(t.stage, t.what, f"{t.error:.2f}", "yes" if t.final else "no", f"{t.seconds:.1f}") for t in known]
        failed = sum(not math.isfinite(trial.error) for trial in here)
        for count, what in ((len(here) - failed - len(known), "not shown"), (failed, "that failed")):
            if count:
                rows.append((stage, f"{count} more {what}", "", "", ""))
    return TableText(("choice of", "tried", "error", "finalist", "time [s]"), rows, caption)


def assessment_tables(judged: tuple[Judged, ...], stretch: str) -> list[TableText]:
    """Return the errors of a sensor on other records, and the scales where they were fitted."""
    fitted = judged[0].scales is not None
    first = "fitted scales and the cubic know" if fitted else "the cubic knows; the sensor knows nothing of these records"
    head = ("record", "stretch", "samples", "resistance", "by a cubic", "recovered by", "strain", "by a cubic")
    errors: list[tuple[str, ...]] = []
    for each in judged:
        for name, rows in each.stretches().items():
            left = (each.record.name, name, str(int(rows.sum())), f"{each.forward(rows):.2f}")
            cubic = f"{each.forward(rows, each.cubic):.2f}"
            for k, (kind, found) in enumerate(each.recovered.items()):
                ratio = each.deviation_ratio(rows, kind)
                right = (kind, f"{each.strain(rows, found.strain):.2f}", f"{each.strain(rows, each.cubic_strain):.2f}")
                errors.append(((*left, cubic) if k == 0 else ("",) * 5) + (*right, "-" if ratio is None else f"{ratio:.2f}"))
    caption = f"Errors: NRMSE in % of range. The first stretch ({stretch}) of a record is what {first}."
    made = [TableText((*head, "stated / true deviation"), errors, caption)]
    if fitted:
        numbers = [
            (each.record.name, (own.gain[0], own.last_gain, own.offset[0], own.last_offset))
            for each in judged
            if (own := each.scales) is not None
        ]
        scales = [(name, *(f"{number:.4g}" for number in four)) for name, four in numbers]
        names = ("record", "gain, first", "relaxed", "offset, first", "relaxed")
        in_ohm = " in ohm" * all(each.record.unit == "ohm" for each in judged)
        made.append(TableText(names, scales, f"Scales of each record{in_ohm}."))
    return made


def relaxation_table(relaxation: Sequence[RelaxationTerm]) -> TableText:
    """Return the relaxation terms."""
    head = ("driven by", "amplitude A [1]", "time tau [s]", "exponent c [1]", "exponentials")
    rows = [
        (driven_by(each), *(f"{x:.4g}" for x in (each.amplitude, time_of(each), each.exponent)), str(len(each.decay_rates)))
        for each in relaxation
    ]
    return TableText(head, rows, "Relaxation, terms A exp(-(t / tau)^c)")


def parameter_table(known: Sequence[Parameter]) -> TableText:
    """Return the fitted parameters with their standard deviations."""
    rows = []
    for p in known:
        deviation = f"{p.deviation:.2g}" if math.isfinite(p.deviation) else "-"
        rows.append((p.name, f"{p.value:.5g}", deviation, "yes" if p.determined else "no"))
    return TableText(("parameter", "value", "standard deviation", "determined by the data"), rows, "Fitted parameters")


def preisach_facts(fit: PreisachFit) -> list[tuple[str, str]]:
    """Return what a sensor of the Preisach models consists of."""
    artifact, rise = fit.artifact, f"where the output has risen by {fit.resistance_change:.5g}"
    noise = "not measured" if artifact.noise is None else f"{artifact.noise:.3g} of its range"
    beside = ", a direct inverse beside it" * bool(artifact.inverse)
    return [
        ("Model", f"modified Preisach, {fit.settings.density}, {artifact.n_lines} lines"),
        ("Full scale", f"{100.0 * fit.full_scale:.4g} % strain, {rise}"),
        ("At rest", f"{fit.rest_resistance:.6g}"),
        ("Compensator", f"{artifact.compensator or 'inverse'}{beside}"),
        ("Network that corrects the output", "none" if artifact.residual is None else "yes"),
        ("White noise of the output", noise),
    ]


def fractional_facts(artifact: FractionalArtifact) -> list[tuple[str, str]]:
    """Return what a fractional sensor consists of."""
    return [
        ("Model", f"fractional-{artifact.model}, {len(artifact.terms)} terms, {len(artifact.fading)} fading"),
        ("Full scale", f"{100.0 * artifact.full_scale_strain:.4g} % strain"),
        ("Change at an output of one", f"{artifact.resistance_change:.5g}"),
        ("At rest", f"{artifact.rest_resistance:.6g}"),
        ("Memory", f"{artifact.shortest:.4g} to {artifact.longest:.4g} s"),
        ("Compensator", "none: a fractional model has no inverse"),
    ]
