"""What the residuals of a fit show that those of a right model do not."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from scipy.fft import dct
from scipy.special import chdtr, chdtrc, chdtri, ndtr

from ..arrays import Matrix, Vector
from .joint import JointProblem
from .problem import RecordProblem
from .record import LEAST_SAMPLES

CONFIDENCE = 0.999  # of the bound on chi2 per sample
NOISE_DOUBT = math.sqrt(2.0 * 3.4)  # of a variance from n differences of order 6, relative, times sqrt(n)
LOWEST = 3  # octaves of frequencies: the first has 2^3 values


def oddity(problem: RecordProblem | JointProblem, r: Vector, J: Matrix, A: Matrix) -> str:
    """Return what residuals show that those of a right model do not; empty if nothing.

    Parameters
    ----------
    problem : RecordProblem or JointProblem
        What was fitted.
    r, J : ndarray, shape (values,) and (values, n)
        Residuals, and derivatives by the unknowns that were kept.
    A : ndarray, shape (n, n)
        Their curvature.

    Notes
    -----
    Chi2 of each sensor, and of each quarter of its time, and the correlation of neighbouring samples; of all of them one
    record of a thousand is off by chance. Coloured noise explains much, so each octave of its frequencies has to have as
    much as it should, no more and no less, beside what the unknowns have taken; values on splines go from fast to slow.
    Octaves of which unknowns take little have no correlation between sensors, as errors of the model have: Fisher's
    transform of it is normal.
    """
    taken = J @ np.linalg.pinv(A, hermitian=True)
    found = [
        (chance, text + which)
        for part, values, which in problem.parts
        for chance, text in _oddities(part, r[values], J[values], taken[values])
    ]
    least = min(found, default=(1.0, ""))
    return least[1] if least[0] * len(found) < 1.0 - CONFIDENCE else ""


def _oddities(problem: RecordProblem, r: Vector, J: Matrix, taken: Matrix) -> list[tuple[float, str]]:
    """Return what residuals of one record show, with the chance that a right model does."""
    found = list[tuple[float, str]]()
    stated, coloured = problem.noise <= problem.record.least_noise, list[tuple[int, int, Vector]]()
    for k, values in enumerate(problem.of_sensors, 1):
        mine = r[values]
        wide = 1.0 + doubt_of_noise(problem, int(problem.record.present[k - 1].sum()))
        parts = [(mine, "")]
        if problem.in_time and mine.size >= LEAST_SAMPLES:
            parts += [(part, f" in quarter {q} of the time") for q, part in enumerate(np.array_split(mine, 4), 1)]
            follows = float(mine[1:] @ mine[:-1]) / max(float(mine @ mine), mine.size)  # less noise than stated is no fault
            text = f"what is left of sensor {k} is no white noise: neighbouring samples have a correlation of {follows:.2f}"
            found.append((float(ndtr(-follows * math.sqrt(mine.size))), text))
        for part, where in parts:
            chance = float(chdtrc(part.size, part @ part / wide)) if part.size else 1.0
            found.append((chance, f"the twin does not explain sensor {k}{where}"))
        if problem.record.follows[k - 1] and mine.size:
            both = [mine[:, None], J[values], taken[values]]
            spectra = [dct(each, norm="ortho", axis=0) if problem.in_time else each[::-1] for each in both]
            ends = 2 ** np.arange(LOWEST, max(LOWEST + 1, mine.size.bit_length() - 1))
            for q, (octave, of_J, of_taken) in enumerate(zip(*(np.split(each, ends) for each in spectra), strict=True), 1):
                freedom, square = max(len(octave) - float(np.sum(of_J * of_taken)), 1e-3), float(np.sum(octave**2))
                less = 1.0 if stated[k - 1] else float(chdtr(freedom, square * wide))  # what is stated may be too much
                chance = min(float(chdtrc(freedom, square / wide)), less)
                text = f"has {square / freedom:.2g} times its share in octave {q} of the frequencies"
                found.append((chance, f"what is left of sensor {k} is no noise of the first order: it {text}"))
                coloured += [(k, q, octave[:, 0])] if len(octave) >= LEAST_SAMPLES else []
    for (k, q, one), (other, same, another) in combinations(coloured, 2):
        if q == same and one.size == another.size:
            alike = float(one @ another / np.linalg.norm(one) / np.linalg.norm(another))
            chance = 2.0 * float(ndtr(-abs(math.atanh(alike)) * math.sqrt(one.size - 3.0)))
            text = f"in octave {q} of the frequencies they have a correlation of {alike:.2f}"
            found.append((chance, f"what is left of sensors {k} and {other} is no noise of theirs: {text}"))
    return found


def chi2_bound(problem: RecordProblem | JointProblem, damages: int = 0) -> float:
    """Return the bound on chi2 per sample of a right model whose damages were fitted; wider where the noise is estimated."""
    bound = float(chdtri(max(1, problem.values - damages), 1.0 - CONFIDENCE)) / problem.values
    doubt = sum(part.values * doubt_of_noise(part, int(part.record.present.sum())) for part, _, _ in problem.parts)
    return bound * (1.0 + doubt / max(1, problem.values))


def doubt_of_noise(problem: RecordProblem, samples: int) -> float:
    """Return how much larger the variance of noise that was estimated from some samples may be, as a share."""
    estimated = problem.record.noise is None or problem.record.follows.any()
    return 3.0 * NOISE_DOUBT / math.sqrt(samples) if estimated and samples else 0.0
