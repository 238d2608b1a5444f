"""Why a record is not explained: the one unknown beside the damages that explains most of it."""

from __future__ import annotations

import numpy as np

from ..errors import ConvergenceError
from .least_squares import Point, descend
from .problem import RecordProblem
from .search import ROUGH, Fit, box
from .zone_sets import smallest

WORTH = 0.5  # of chi2, left at most by a reason that is named
TRIED = 3  # reasons that are fitted, those that promise most
STEPS = 8


def likely_reason(fit: Fit, wider: RecordProblem) -> str | None:
    """Say which nuisance that was not fitted, alone or of all sensors, explains most of what is left; None if none does.

    Parameters
    ----------
    fit : Fit
        That does not pass.
    wider : RecordProblem
        The same record with all nuisances that the structure and its load have.

    Notes
    -----
    The quadratic model of chi2 at the fit tells which of them promise most; these are fitted.
    """
    zones, names = wider.zones, wider.nuisances.names
    fitted = dict(zip(fit.problem.nuisances.names, fit.point.x[zones:].tolist(), strict=True))
    x = np.r_[fit.point.x[:zones], [fitted.get(name, 0.0) for name in names]]
    known = np.r_[np.ones(zones, dtype=bool), [name in fitted for name in names]]
    if known.all():
        return None
    try:
        point = wider.points(x[None])[0]
        model = wider.about(point, everything := np.ones(wider.size, dtype=bool), wider.derivatives(point, everything))
    except ConvergenceError:
        return None
    unknown = np.flatnonzero(~known).tolist()
    kinds = [names[k - zones].partition("[")[0] for k in unknown]
    together = [tuple(k for k, kind in zip(unknown, kinds, strict=True) if kind == one) for one in dict.fromkeys(kinds)]
    free = {some: known | np.isin(np.arange(wider.size), some) for some in [*((k,) for k in unknown), *together]}
    promised = {some: smallest(model, box(wider, x), each)[0] for some, each in free.items()}
    undamaged, found = np.where(np.arange(wider.size) < zones, 0.0, x), list[tuple[Point, tuple[int, ...]]]()
    for some in sorted(promised, key=lambda each: promised[each])[:TRIED]:
        for start in (x, undamaged):
            try:
                found.append((descend(wider, start, free[some], STEPS, enough=ROUGH).point, some))
            except ConvergenceError:
                continue
    if not found:
        return None
    best, some = min(found, key=lambda each: each[0].chi2)
    if best.chi2 > WORTH * point.chi2:
        return None
    reasons = wider.nuisances.told((names[k - zones] for k in some), best.x[zones:])
    kind = names[some[0] - zones].partition("[")[0]
    return (
        f"most likely {', '.join(reasons)}: with {kind} fitted too, chi2 per sample falls from "
        f"{point.chi2 / wider.values:.3g} to {best.chi2 / wider.values:.3g}"
    )
