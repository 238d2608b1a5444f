"""The page of a placement of sensors: the smallest damage that is found, by zone and on the membrane, and its check."""

from __future__ import annotations

import numpy as np
from gossamer_models.placement import Placing
from gossamer_models.placement.check import MonteCarloCheck
from gossamer_models.placement.plots import damage_text, placement_charts, placements
from gossamer_models.twin.least_squares import MOST_DAMAGE
from gossamer_orchestrator.pages import Page, table
from gossamer_orchestrator.words import counted

from ..results import TableText, on_page


def placement_page(found: Placing, samples: int) -> Page:
    """Describe a placement; ``samples`` are those of a record of each sensor."""
    shown = placements(found)
    own, chosen = found.own, found.chosen
    worst = f"With {len(chosen.sensors)} chosen sensors the worst zone has a90 = {damage_text(chosen.a90.max())} damage"
    if own is not None:
        worst += f"; with the membrane's own {len(own.sensors)} it has {damage_text(own.a90.max())}"
    if own is not None and chosen.a90.max() >= own.a90.max():
        many = counted(len(chosen.sensors), "sensor")
        worst = f"No placement of {many} was found that is better than the membrane's own. {worst}"
    disagree = [name for name, p in shown if p.check is not None and not p.check.agrees]
    lost = {name: [z + 1 for z in np.flatnonzero(p.a90 >= MOST_DAMAGE)] for name, p in shown}
    more = ["a90 is the damage that is detected in 90 % of cases at 5 % false alarms."]
    more += [f"The {name} sensors do not find zones {', '.join(map(str, z))}." for name, z in lost.items() if z]
    more += [check_sentence(name, p.check) for name, p in shown if p.check is not None]
    more.append("The model is taken to be exact, so real sensors find less.")
    return Page(
        title="Placement of sensors",
        kind="invalid" if disagree else "none",
        sentence=f"{worst}.",
        more=more,
        charts=placement_charts(found),
        facts="\n".join((on_page(zone_table(found)), _sensors(found), _about(found, samples))),
        how="All zones, the load's amplitude, the damping and an offset of each sensor are unknown together.",
    )


def zone_table(found: Placing) -> TableText:
    """Return the smallest damage that is found, a row for each zone, and the worst."""
    shown = placements(found)
    checked = [(name, p.check) for name, p in shown if p.check is not None]
    head = [f"a90 [%], {len(p.sensors)} {name} sensors" for name, p in shown]
    head += [f"{name}: deviation, predicted and of {c.records} fits [%]" for name, c in checked]
    rows = [
        (
            str(k + 1),
            name,
            *(f"{100.0 * p.a90[k]:.2f}" for _, p in shown),
            *(f"{100.0 * c.predicted[k]:.2f}, {100.0 * c.observed[k]:.2f}" for _, c in checked),
        )
        for k, name in enumerate(found.structure.zone_names)
    ]
    rows.append(("worst", "", *(f"{100.0 * p.a90.max():.2f}" for _, p in shown), *("" for _ in checked)))
    caption = "Smallest damage that is found" + (", and deviation at 30 % damage" if checked else "")
    return TableText(("zone", "name", *head), rows, caption)


def check_sentence(name: str, check: MonteCarloCheck) -> str:
    """Say whether fits to simulated records err as predicted."""
    verdict = "agrees with" if check.agrees else "does NOT agree with"
    return (
        f"{check.records} fits with the {name} sensors: their mean square error over the predicted variance, "
        f"{check.spread:.3f}, {verdict} 1 ± {check.spread_error:.3f}; {100.0 * check.false_alarms:.1f} % false alarms (5), "
        f"a90 found in {100.0 * check.found:.1f} % (90)."
    )


def _sensors(found: Placing) -> str:
    rows = [
        (f"{name} {k + 1}", *(", ".join(f"{x:.4g}" for x in v) for v in (s.point, s.direction)), f"{s.gauge_length:g}")
        for name, p in placements(found)
        for k, s in enumerate(p.sensors)
    ]
    return table(("sensor", "point [m]", "direction", "length [m]"), rows, "Sensors")


def _about(found: Placing, samples: int) -> str:
    rows = [
        ("Candidates", found.candidates),
        ("Samples of a record", samples),
        ("Deviation of the noise of a sample [1]", f"{found.noise:.4g}"),
        ("Simulated cases", found.simulations),
    ]
    return table((), rows, "The choice")
