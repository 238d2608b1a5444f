"""Doubts about a fit of the modified Preisach model: what the data do not determine, what was assumed, and what to do."""

from collections import Counter

import numpy as np
from gossamer_files.options import option

from ...arrays import Matrix, Rows, Vector
from ...fitting.errors import Parameter, alike, covariance, rest_doubt
from ...fitting.records import Record
from .preisach import PreisachFit

DETERMINED = 0.5  # share of a parameter's information that must come from the data
HOLD_RATE = 0.02  # of the fastest strain rate: slower is a hold
LEAST_HOLD = 0.05  # of the training stretch
RESTED = 0.1  # of the range of resistance that counts as another resistance at rest
APART = 1.1  # ratio of the errors of two starts from which they are in different minima
RELAXING = 0.3  # share of the squared error from which earlier relaxation is worth a fit
DECAYS = 20.0, 1.0  # steps and spans: times of the decays that are looked for
BLOCKS = {
    "b_mu": "weights of the density mu",
    "m_mu": "wave numbers of mu",
    "n_mu": "wave numbers of mu",
    "b_eta": "weights of eta",
    "m_eta": "wave numbers of eta",
    "n_eta": "wave numbers of eta",
    "eta": "eta",
    "b_elastic": "weights of the elastic part",
    "log_tau": "relaxation times",
    "c": "exponents of relaxation",
    "y0": "resistance at rest",
}  # what they are, by name
FIXED_BY = {"log_tau": "tau", "c": "exponents", "y0": "rest_resistance"}  # options


def determination(fit: PreisachFit) -> tuple[Matrix, Matrix]:
    """Return covariance and resolution of the parameters, shape (n, n), zero for those at a bound; see ``covariance``."""
    n = fit.x.size
    lower, upper = fit.solver.problem.lower, fit.solver.problem.upper
    slack = 1e-7 * np.maximum(1.0, np.abs(fit.x))
    free = (fit.x > lower + slack) & (fit.x < upper - slack)
    data, preferred = (part[:, free] for part in fit.solver.slopes(fit.x))
    count = sum(int(rows.sum()) for rows in fit.train)
    variance = 2.0 * fit.solutions[0].cost / max(count - int(free.sum()), 1)
    C, R = np.zeros((n, n)), np.zeros((n, n))
    C[np.ix_(free, free)], R[np.ix_(free, free)] = covariance(data, preferred, variance)
    return C, R


def parameters(fit: PreisachFit) -> tuple[tuple[Parameter, ...], Matrix]:
    """Return the parameters and their covariance, shape (n, n); parameters with a fixed value count as determined."""
    C, R = determination(fit)
    deviations = np.sqrt(np.maximum(np.diag(C), 0.0))
    fitted = fit.solver.problem.lower < fit.solver.problem.upper
    determined = ~fitted | (np.diag(R) >= DETERMINED)
    return tuple(
        Parameter(name=name, value=float(value), deviation=float(deviation), determined=bool(known))
        for name, value, deviation, known in zip(fit.names, fit.x, deviations, determined, strict=True)
    ), C


def doubts(fit: PreisachFit, *, chosen: bool = False) -> tuple[str, ...]:
    """Return what a user should know of a fit and can do something about, one sentence each, each only where it is true.

    Parameters
    ----------
    fit : PreisachFit
        The fit.
    chosen : bool
        Whether its settings were chosen automatically: then what other settings would mend was tried, and cannot be set.
    """
    sentences = []
    if not chosen and not fit.solutions[0].converged:
        sentences.append(
            f"The fit was still improving after {fit.solutions[0].iterations} steps. Take more starts, or fewer modes or "
            "relaxations."
        )
    sentences.append(_least_rest(fit))
    reached = start_errors(fit)
    if not chosen and max(reached[: len(fit.solutions) // 2 + 1]) > APART * reached[0]:
        sentences.append(
            f"The {len(reached)} starts ended at {', '.join(f'{each:.3g}' for each in reached)} % of the fitted range: the "
            f"fit has local minima, and another may be better. Take more starts ({option('starts')}), or "
            "preisach-hats: it has fewer."
        )
    if fit.settings.earlier:
        sentences.append(
            "The errors include the relaxation from before a record began. FMUs start at rest and do not include it."
        )
    else:
        trained = [k for k, rows in enumerate(fit.train) if rows.any()]
        sentences += [sentence for k in trained for sentence in _at_start(fit, k, chosen=chosen)]
    held = [_held(record, rows) for record, rows in zip(fit.records, fit.train, strict=True) if rows.any()]
    if fit.settings.relaxations and fit.settings.eta[0] < fit.settings.eta[1] and max(held) < LEAST_HOLD:
        sentences.append(
            f"The strain is at rest for {100.0 * max(held):.1f} % of the training stretch: without holds, the data do "
            "not separate eta from slow relaxation. Add a hold to the record, or treat eta as an assumption."
        )
    if not chosen:
        sentences.append(_alike(fit))
    return tuple(filter(None, sentences))


def undetermined(fit: PreisachFit) -> str:
    """Return how many parameters of each block the data do not decide, but regularisation or a bound; for the provenance."""
    known, _ = parameters(fit)
    counts = Counter(p.name.split("[")[0] for p in known if not p.determined)
    return ", ".join(f"{counts[b.name]} of {b.size} {_words(b.name)}" for b in fit.blocks if counts[b.name]) or "nothing"


def _words(block: str) -> str:
    """Return what a block of parameters is, with its name; only amplitudes have names of their drives."""
    earlier = block[0] == "v" and block[1:].isdigit()
    words = BLOCKS.get(block, "amplitudes of earlier relaxation" if earlier else "amplitudes of relaxation")
    return f"{words} ({block})"


def start_errors(fit: PreisachFit) -> list[float]:
    """Return what every start ended at, the regularisation included, best first [% of the fitted range]."""
    count = sum(int(rows.sum()) for rows in fit.train)
    return [100.0 * float(np.sqrt(2.0 * each.cost / count)) for each in fit.solutions]


def _least_rest(fit: PreisachFit) -> str:
    place = fit.names.index("y0[1]")
    lower, upper = (bound[place] for bound in (fit.solver.problem.lower, fit.solver.problem.upper))
    if not np.isfinite(lower) or lower == upper or fit.x[place] > lower + 1e-7 * max(1.0, abs(lower)):
        return ""
    why = " The record does not separate it from what was still relaxing." if fit.settings.earlier else ""
    return (
        f"The fitted resistance at rest, {fit.rest_resistance:.4g}, is the least that is allowed, and a lower one would fit "
        f"better.{why} Give it ({option('rest_resistance')})."
    )


def _at_start(fit: PreisachFit, k: int, *, chosen: bool) -> tuple[str, ...]:
    """Say that a record began before the sensor was at rest, or unstrained with another resistance, where it is so."""
    record, rows = fit.records[k], fit.train[k]
    advice = f"Check it and its unit, or give it ({option('rest_resistance')})."
    doubted = rest_doubt(record, fit.rest_resistance, fit.full_scale, RESTED, advice)
    share = still_relaxing(record.time[rows], (fit.predicted[k] - record.resistance)[rows])
    if share <= RELAXING:
        return (doubted,)
    lower, upper = fit.solver.problem.lower, fit.solver.problem.upper
    given = lower[fit.names.index("y0[1]")] == upper[fit.names.index("y0[1]")]
    relaxing = (
        f"{record.name} was still relaxing when it began: decays from there explain {share:.0%} of the squared error of "
        f"the fitted stretch. Fit them too ({option('earlier', True)})."
    )
    return ("" if chosen else relaxing, doubted if given else "")


def still_relaxing(time: Vector, residual: Vector) -> float:
    """Return the share of the squares of a residual, about its mean, that decays from the first sample on explain [1]."""
    steps, span = np.diff(time), float(np.ptp(time))
    if span <= 0.0:
        return 0.0
    taus = np.geomspace(DECAYS[0] * float(np.median(steps)), DECAYS[1] * span, 6)
    columns = np.column_stack([np.ones(time.size), np.exp(-(time - time[0])[:, None] / taus)])
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    about = residual - residual.mean()
    total = float(about @ about)
    return 1.0 - float(left @ left) / total if total > 0.0 else 0.0


def _alike(fit: PreisachFit) -> str:
    """Say which fitted parameters that an option fixes the data do not separate from another."""
    _, covariances = parameters(fit)
    fixable = np.array([name.split("[")[0] in FIXED_BY for name in fit.names])
    masked = np.where(fixable[:, None] & fixable[None, :] | np.eye(fixable.size, dtype=bool), covariances, 0.0)
    options = sorted({option(FIXED_BY[name.split("[")[0]]) for name, each in zip(fit.names, fixable, strict=True) if each})
    return alike(fit.names, masked, f"Fix one of them ({' or '.join(options)}).")


def _held(record: Record, rows: Rows) -> float:
    """Return the share of the training time in which strain is constant."""
    steps = np.diff(record.time)
    rates = np.abs(np.diff(record.strain)) / steps
    inside = rows[1:]
    if not inside.any():
        return 0.0
    still = rates[inside] < HOLD_RATE * rates.max()
    return float(steps[inside][still].sum() / steps[inside].sum())
