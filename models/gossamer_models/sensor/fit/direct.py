"""Fit of a direct inverse: its operators span what the training stretch shows, its networks are trained on it."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from gossamer_files.options import option

from ...arrays import Matrix, Rows
from ...errors import DataError, require
from ...fitting.records import FITTED, Record, cut, until_the_end_of_training, without_delay
from ..artifact import DirectInverse, SmallNetwork
from ..direct import OUTSIDE, DirectLaw
from .networks import memory
from .networks import train as train_network

WIDTHS = tuple(np.geomspace(0.01, 0.5, 9).tolist())  # of plays [1]
LOW_PASSES, SLOWEST = 6, 0.05  # how many, and the longest time, of the longest training stretch
AHEAD = (1, 2, 3, 4, 6, 8, 11, 15, 20, 24)  # samples after a strain that tell it
NETWORKS, STEPS, DECAY = 3, 300, 1e-4
CLOSER = (0.9, 0.5)  # of the shortest and of the usual step of a record: samples that are closer are left out
MOST_SAMPLES = 3000  # to train on
INSIDE = 0.95  # of the errors on later parts are within 1.96 deviations
FLOOR = 0.5  # of the root mean square error there
LEAST = 1e-4  # [1] of a floor
FEWEST = 10  # samples by which a deviation is calibrated
GROWTH = (1.4, 2.0)  # least and largest growth of errors from these later parts to what lies further ahead


def fit_direct(
    records: Sequence[Record],
    train: Sequence[Rows],
    full_scale: float,
    *,
    delay: int = 0,
    seed: int = 0,
    calibrated: bool = True,
) -> DirectInverse:
    """Fit a direct inverse to records of resistance and strain.

    Parameters
    ----------
    records : sequence of Record
        The records.
    train : sequence of ndarray of bool, shape (m,)
        Samples of each record to train on.
    full_scale : float
        Strain [1] at the end of the range.
    delay : int
        By how many samples the strain may be delayed, one of ``AHEAD`` or 0.
    seed : int
        Of the first weights.
    calibrated : bool
        Whether to state a deviation too, by what inverses that are fitted to the first 60 and 80 % of the training samples
        make of the others.

    Returns
    -------
    DirectInverse
        Its range is in the units of the records [ohm].

    Raises
    ------
    DataError
        The resistance is constant, or there are fewer samples than the delay.
    """
    records, train = until_the_end_of_training(records, train)
    inverse = _trained(records, train, full_scale, delay, seed)
    if not calibrated:
        return inverse
    parts = []
    for share in FITTED:
        early, late = cut(train, share)
        found = _trained(records, early, full_scale, delay, seed)
        told = [recovered(found, each) - np.outer(each.strain / full_scale, (1.0, 0.0, 0.0)) for each in records]
        parts.append(np.vstack([each[rows] for each, rows in zip(told, late, strict=True)]))
    parts = [part[np.isfinite(part[:, 0])] for part in parts]
    require(min(map(len, parts)) >= FEWEST, too_few(delay), DataError)
    sizes = [float(np.sqrt(np.mean(part[:, 0] ** 2))) for part in parts]
    error, scatter, outside = np.vstack(parts).T
    floor = max(FLOOR * float(np.sqrt(np.mean(error**2))), LEAST)
    over = float(np.quantile(np.abs(error) / np.sqrt(scatter**2 + floor**2 + (OUTSIDE * outside) ** 2), INSIDE)) / 1.96
    growth = float(np.clip(sizes[0] / max(sizes[-1], LEAST), *GROWTH))
    return replace(inverse, factor=growth * over, floor=floor)


def recovered(inverse: DirectInverse, record: Record) -> Matrix:
    """Return normalised strain, scatter and distance beyond training, shape (m, 3) [1], see ``DirectLaw.earlier``.

    The range of the inverse is in the units of the record. The delay is taken back: the last rows are not a number.
    """
    law = DirectLaw(inverse)
    *features, delay = _memory(law, record).T
    x = ca.MX.sym("x", len(features))
    told = [each.full()[0] for each in ca.Function("read", [x], [*law.earlier(x)])(np.array(features))]
    return np.column_stack([without_delay(record.time, delay, each) for each in told])


def too_few(delay: int) -> str:
    """Say that a training stretch is too short for a delay [samples]."""
    few = f"the training stretch has too few samples for a strain that is {delay} samples late"
    return f"{few}. Name a longer one ({option('train')})."


def _memory(law: DirectLaw, record: Record) -> Matrix:
    """Return the features of a direct inverse and its delay [s] at the samples of a record, shape (m, F + 1)."""
    return memory(law, record.resistance, record.time, lambda state: ca.vertcat(law.features(state), state.delay))


def _trained(records: Sequence[Record], train: Sequence[Rows], full_scale: float, delay: int, seed: int) -> DirectInverse:
    """Fit the inverse, without a deviation."""
    used = list(zip(records, train, strict=True))
    resistances = np.concatenate([record.resistance[rows] for record, rows in used])
    low, high = float(resistances.min()), float(resistances.max())
    require(low < high, "the resistance is constant where it is fitted, so no strain can be told from it.", DataError)
    step = min(float(np.median(np.diff(record.time))) for record, _ in used)
    shortest = min(float(np.min(np.diff(record.time))) for record, _ in used)
    longest = max(float(np.ptp(record.time[rows])) for record, rows in used)
    times = np.geomspace(step, max(SLOWEST * longest, 2.0 * step), LOW_PASSES)
    ahead = tuple(k for k in AHEAD if k <= delay)
    law = DirectLaw(
        DirectInverse(
            lowest=low,
            highest=high,
            widths=WIDTHS,
            times=tuple(times.tolist()),
            ahead=ahead,
            step=max(CLOSER[0] * shortest, CLOSER[1] * step) if ahead else 0.0,
        )
    )
    features = [_memory(law, record) for record, _ in used]
    n = 1 + len(WIDTHS) + LOW_PASSES
    every = max(1, sum(int(rows.sum()) for _, rows in used) // MOST_SAMPLES)

    def networks(columns: slice, late: int) -> tuple[SmallNetwork, ...]:
        """Train on the strain as late as the memory is, by so many samples, or on the present one."""
        meant = [record.time - (each[:, -1] if late else 0.0) for (record, _), each in zip(used, features, strict=True)]
        strains = [np.interp(t, r.time, r.strain) / full_scale - 0.5 for t, (r, _) in zip(meant, used, strict=True)]
        some = [
            rows & rows[np.searchsorted(r.time, t)] & (np.arange(rows.size) >= late)
            for t, (r, rows) in zip(meant, used, strict=True)
        ]
        require(any(each.any() for each in some), too_few(late), DataError)
        seen, some = [each[:, columns] for each in features], [_every(each, every) for each in some]
        return tuple(train_network(seen, strains, some, STEPS, decay=DECAY, seed=seed + k) for k in range(NETWORKS))

    later = networks(slice(n, -1), ahead[-1]) if ahead else ()
    return replace(law.inverse, networks=networks(slice(n), 0), later=later)


def _every(rows: Rows, every: int) -> Rows:
    """Return every so many of some samples."""
    found = np.zeros_like(rows)
    found[np.flatnonzero(rows)[::every]] = True
    return found
