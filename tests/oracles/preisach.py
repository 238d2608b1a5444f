"""Other implementations of the sensor's law, and small sensors to compare them on."""

import numpy as np
from gossamer_models import Stepper, simulate
from gossamer_models.sensor import RelaxationTerm, SensorArtifact

UNIT = {"rest_resistance": 0.0, "full_scale_resistance_change": 1.0, "full_scale_strain": 1.0}


def term(amplitude=0.1, power=0, decay_rates=(0.1, 1.0, 10.0), weights=(0.3, 0.4, 0.3)):
    return RelaxationTerm(amplitude=amplitude, power=power, rate=1.0, exponent=1.0, decay_rates=decay_rates, weights=weights)


def artifact(n_lines=8, eta=1.0, relaxation=(), seed=1, spring=0.3):
    """Random positive weights; eta is a number or a function of the column of the table."""
    rng = np.random.default_rng(seed)
    mu = np.triu(rng.uniform(0.02, 1.0, (n_lines, n_lines)))
    mu[0] += spring
    mu *= n_lines / mu.sum()
    nu = mu * (eta if np.isscalar(eta) else eta(np.arange(n_lines) / n_lines)[None, :])
    return SensorArtifact(mu=tuple(map(tuple, mu)), nu=tuple(map(tuple, nu)), relaxation=tuple(relaxation))


def spring():
    """A sensor without memory: output equals strain."""
    mu = np.zeros((2, 2))
    mu[0] = 1.0
    return SensorArtifact(mu=tuple(map(tuple, mu)), nu=tuple(map(tuple, mu)))


def start(model, **parameters):
    stepper = Stepper(model, **{**UNIT, **parameters})
    stepper.initialize()
    return stepper


def drive(stepper, inputs, h=0.1):
    """Feed a row of inputs; return the first output after each."""
    u, y = (next(v.name for v in stepper.model.variables if v.causality == c) for c in ("input", "output"))
    values, steps = np.broadcast_arrays(np.asarray(inputs, float), h)
    return simulate(stepper, steps, {u: values}, [y])[y]


class RelayLattice:
    """The definition: single operators with two switching values each, `per_bin` of them in every bin of every line."""

    def __init__(self, artifact, per_bin, rest=0.0):
        mu, nu = artifact.tables()
        n = artifact.n_lines
        i, k = np.triu_indices(n)
        place = (np.arange(per_bin) + 0.5) / per_bin
        self.alpha = ((k[:, None] + place) / n).ravel()
        self.beta = self.alpha - np.repeat(i / n, per_bin)
        self.mu, self.nu = (np.repeat(t[i, k], per_bin) / (n * per_bin) for t in (mu, nu))
        self.on = self.alpha < rest
        self.f = self.mu[self.on].sum()

    def move(self, s):
        rises, falls = ~self.on & (s >= self.alpha), self.on & (s <= self.beta)
        self.f += self.mu[rises].sum() - self.nu[falls].sum()
        self.on = (self.on | rises) & ~falls
        return self.f


class EverettStack:
    """Two surfaces and the turning points that are still remembered; accumulating output, Eqs. (5.3) and (5.4)."""

    def __init__(self, artifact, rest=0.0):
        n = artifact.n_lines
        self.width = np.arange(n) / n
        self.lattice = np.arange(n + 1) / n
        self.sums = [np.hstack([np.zeros((n, 1)), np.cumsum(t, axis=1) / n]) for t in artifact.tables()]
        self.turns, self.rising, self.s = [0.0], True, rest
        self.f = self.surface(True, 0.0, rest)

    def surface(self, rising, base, s):
        """Integral over the triangle of operators that switch between a turning point and s."""
        low, high = (base, s) if rising else (s, base)
        total = 0.0
        for width, sums in zip(self.width, self.sums[0 if rising else 1], strict=True):
            if high > low + width:
                top, bottom = np.interp([high, low + width], self.lattice, sums)
                total += top - bottom
        return total if rising else -total

    def move(self, s):
        if s == self.s:
            return self.f
        rising = s > self.s
        if rising != self.rising:
            self.turns.append(self.s)
            self.rising = rising
        while True:
            base = self.turns[-1]
            limit = self.turns[-2] if len(self.turns) > 1 else None
            passed = limit is not None and (s >= limit if rising else s <= limit)
            end = limit if passed else s
            self.f += self.surface(rising, base, end) - self.surface(rising, base, self.s)
            self.s = end
            if not passed:
                return self.f
            del self.turns[-2:]
            if not self.turns:
                self.turns, self.rising = [0.0], True
                return self.f
