"""The watch on board beside the watch on the ground, on the same records, and alone.

From the folder ``docs``::

    python -m studies.on_board [RECORDS [SEED]]    a line for each of some worlds of studies.watch, damaged and healthy
    python -m studies.on_board drift [WINDOWS]     alarms where nothing happens but that the clock is off
    python -m studies.on_board count [STREAMS]     alarms of normal noise, whose sums over a window are drawn at once
    python -m studies.on_board finer [SETUP]       damage of three zones of a setup that ships, computed with finer elements

Records are of the bilinear square. They last 40 of its first periods; damage begins in the 29th. The watch on board begins
when the response has settled, after twelve.
"""

from __future__ import annotations

import sys

import casadi as ca
import numpy as np
from gossamer_models.membrane import square_structure
from gossamer_models.twin import MembraneForward, Watch
from gossamer_models.twin.forward import finer_of
from gossamer_models.twin.on_board import LAGS, LEARNING, StoredWindows, watch_model
from gossamer_models.twin.settled import StoredResponses, stored_responses
from gossamer_models.twin.simulation import Place, SensedForward
from gossamer_models.variables import pack, unpack
from numpy.typing import NDArray
from scipy.special import chdtri

from .structures import shipped
from .twin import BILINEAR
from .watch import HEALTHY, THESIS, WORLDS

Array = NDArray[np.float64]
SETTLES, BEFORE, ALL = 12, 28, 40  # first periods
NAMES = ("step", "load", "gains")
GROUND = 169  # samples of a window on the ground
DRIFTS = (0.0, 2e-5, 1e-4)  # of the clock
CHUNK = 2100  # samples that are watched at once: of all those of a long record the states alone are gigabytes
WINDOWS = 1000  # that are counted of each stream
FINER, DEPTH = 5e-4, 0.2  # noise, and damage, of records of a finer mesh
LOADS = (1.03, 0.97, 1.0)  # of each of them, over that of the setup


def on_board(stored: StoredResponses, strain: Array, noise: float) -> tuple[int | None, Array]:
    """Return the first sample with an alarm, if there is one, and what the watch says then, or at the end."""
    model = watch_model(stored, noise)
    inputs = np.vstack([strain, np.zeros(strain.shape[1])])
    p = np.ones(1)
    x = model.init(inputs[:, 0], p)[0]
    said = np.zeros((0, 0))
    for begin in range(1, strain.shape[1], CHUNK):
        part = inputs[:, begin : begin + CHUNK]
        states, y = model.step.mapaccum(part.shape[1])(x, part, np.tile(p[:, None], part.shape[1]), stored.step)
        said = np.array(y)
        alarms = np.flatnonzero(said[0] > 0.5)
        if alarms.size:
            return begin + int(alarms[0]), said[:, alarms[0]]
        x = states[:, -1]
    return None, said[:, -1]


def judged(stored: StoredResponses, samples: int) -> int:
    """Return how many windows of some samples may raise an alarm."""
    n = stored.healthy.shape[1] // stored.windows
    return max(0, int(samples // n) - stored.windows - LEARNING)


def compare(stored: StoredResponses, name: str, count: int, seed: int) -> str:
    """Watch records of a world twice; return its line."""
    world, healthy = WORLDS[name.removeprefix(HEALTHY)], name.startswith(HEALTHY)
    random, structure = np.random.default_rng(seed), square_structure(*BILINEAR)
    forward, h = MembraneForward(structure), stored.step
    n, begin = GROUND * ALL, GROUND * SETTLES
    late: dict[str, list[float]] = {"board": [], "ground": []}
    false, windows = {"board": 0, "ground": 0}, {"board": 0, "ground": 0}
    for k in range(count):
        zone, depth = random.integers(structure.n_zones), 0.0 if healthy else world.depth[1]
        onset = n if healthy else round((BEFORE + random.uniform()) * GROUND)
        amplitude = forward.parameters["pressure_amplitude"] * (1.0 + world.load * (-1.0) ** k)
        state, _ = forward.begin(np.zeros(structure.n_zones), {"pressure_amplitude": amplitude})
        damage = np.zeros((1, n, structure.n_zones))
        damage[0, onset:, zone] = depth
        strain = forward.advance(state, damage, {}, h)[0][0]
        strain = strain * (1.0 + world.gain * random.standard_normal((len(strain), 1)))
        strain += world.noise * random.standard_normal(strain.shape)
        found, _ = on_board(stored, strain[:, begin - 1 :], world.noise)
        watch = Watch(world.noise, structure, step=h, exact_mesh=True)
        ground = [(i + 1) * GROUND for i, part in enumerate(np.split(strain, ALL, 1)) if watch.advance(part).alarm]
        windows["board"] += judged(stored, onset - begin)
        windows["ground"] += onset // GROUND
        for who, alarms in (("board", [] if found is None else [begin + found]), ("ground", ground)):
            false[who] += sum(at <= onset for at in alarms)
            late[who] += [1e3 * h * (at - onset) for at in alarms if at > onset][:1]
    line = ""
    for who in late:
        line += f"{who}: {false[who]} false alarms in {windows[who]} windows"
        if not healthy:
            delay = f"{np.median(late[who]):.0f} ms" if late[who] else "-"
            line += f", {count - len(late[who])} of {count} missed, delay {delay} (median)"
        line += "; "
    return line


def drifting(stored: StoredResponses, drift: float, noise: float, windows: int) -> str:
    """Watch healthy strain under a load that is 3 % off, whose clock runs fast; return its line."""
    N, random = stored.healthy.shape[1], np.random.default_rng(1)
    samples = (windows + stored.windows + LEARNING) * (N // stored.windows)
    waves = np.fft.rfft(stored.healthy + 0.3 * stored.lasting[0]) / N  # the prior's deviation of the load is 10 %
    waves[:, 1:] *= 2.0
    turns = 2j * np.pi * np.arange(waves.shape[1]) / N
    at = np.array_split((1.0 + drift) * np.arange(samples) + N / 3.0, windows)
    strain = np.hstack([(waves @ np.exp(turns[:, None] * part)).real for part in at])
    found, _ = on_board(stored, strain + noise * random.standard_normal(strain.shape), noise)
    said = "no alarm" if found is None else f"an alarm after {found * stored.step:.1f} s"
    return f"clock off by {1e6 * drift:g} ppm, noise {noise:g}: {said} in {windows} windows, {samples * stored.step:.0f} s"


def count_alarms(stored: StoredResponses, streams: int) -> str:
    """Count windows that raise an alarm of their own while nothing changes, with nuisances drawn from their priors."""
    windows = StoredWindows(stored, np.full(len(stored.healthy), 1e-3), 1e-5)
    like = windows.start()
    x, g, kind = ca.MX.sym("x", pack(like).numel()), ca.MX.sym("g", windows.q + windows.z), ca.MX.sym("kind")
    after = windows.judge(unpack(like, x), g, ca.MX(0.0), kind, ca.MX(0.0), ca.MX(1.0))
    judge = ca.Function("judge", [x, g, kind], [pack(after)]).map(streams)
    roots = []
    for e, V in map(np.linalg.eigh, windows.information):
        roots.append(V * np.sqrt(np.maximum(e, 0.0)))
    random = np.random.default_rng(1)
    p = random.standard_normal((windows.q, streams))
    state = np.tile(np.array(ca.evalf(pack(like))), streams)
    total, alarms, largest = 0, 0, 0.0
    at_alarm = pack(like).numel() - pack(like.said).numel()  # the state ends in what is said, which begins with it
    for k in range(WINDOWS):
        kind_now = k % windows.m
        root = roots[kind_now]
        sums = windows.information[kind_now][:, : windows.q] @ p + root @ random.standard_normal((len(root), streams))
        state = np.array(judge(state, sums, float(kind_now)))
        if k + 1 >= LEARNING + LAGS[-1]:
            total += streams
            alarms += int(state[at_alarm].sum())
            largest = max(largest, float(state[at_alarm + 1 : at_alarm + 1 + windows.z].max()))
        state[at_alarm] = 0.0
    bound = chdtri(2.0 * (alarms + 1), 0.05) / 2.0 / total
    return f"{alarms} alarms in {total} windows: at most {bound:.1e} (95 %); largest score {largest:.2f} of the threshold"


def on_finer_elements(name: str) -> list[str]:
    """Watch strain that finer elements than those of the stored responses have; return a line for each of some zones."""
    structure, random = shipped(name), np.random.default_rng(7)
    own, stored = MembraneForward(structure), stored_responses(structure)
    finer = finer_of(own)
    assert finer is not None
    h, N, zones = stored.step, stored.healthy.shape[1], len(stored.zones)
    n = N // stored.windows
    damaged = random.choice(zones, len(LOADS), replace=False)
    settles = round(28.0 / own.parameters["mass_damping"] / h) // N * N  # the start fades to 1e-6
    onset = (stored.windows + LEARNING + 20) * n  # samples after that
    sensed, given = SensedForward(finer), own.parameters["pressure_amplitude"] * np.array(LOADS)
    place = Place.joined([sensed.begin(np.zeros(zones), {"pressure_amplitude": load}, h) for load in given])
    parts = []
    for at in np.split(np.arange(settles + onset + 16 * n), np.arange(CHUNK, settles + onset + 16 * n, CHUNK)):
        damage = np.zeros((len(LOADS), at.size, zones))
        damage[np.arange(len(LOADS))[:, None], :, damaged[:, None]] = DEPTH * (at >= settles + onset)
        found, _, place = sensed.advance(place, damage, {}, h)
        parts.append(found)
    strain = np.concatenate(parts, axis=2)[:, :, settles:]
    lines = []
    for zone, load, each in zip(damaged, LOADS, strain, strict=True):
        alarm, said = on_board(stored, each + FINER * random.standard_normal(each.shape), FINER)
        likeliest, sees = stored.zones[said[1 : 1 + zones].argmax()], said[1 + zones]
        text = "no alarm" if alarm is None else f"an alarm after {1e3 * h * (alarm - onset):.0f} ms, likeliest {likeliest}"
        line = f"{name}, {stored.zones[zone]}, load {load:g} of the setup's: {text}; it sees {sees:.2f}"
        lines.append(f"{line}; a window is {1e3 * h * n:.0f} ms")
    return lines


def main() -> None:
    """Print the lines."""
    words = sys.argv[1:]
    if words[:1] == ["finer"]:
        print(*on_finer_elements([*words, "tube"][1]), sep="\n")
        return
    stored = stored_responses(square_structure(*BILINEAR), exact_mesh=True)
    if words[:1] == ["count"]:
        print(count_alarms(stored, int([*words, "1000"][1])))
    elif words[:1] == ["drift"]:
        for noise in (1e-3, THESIS):
            for drift in DRIFTS:
                print(drifting(stored, drift, noise, int([*words, "1000"][1])), flush=True)
    else:
        numbers = [int(word) for word in words]
        count, seed = [*numbers, *(8, 5)[len(numbers) :]]
        for name in [*NAMES, *(HEALTHY + name for name in NAMES)]:
            print(f"{name:16} {compare(stored, name, count, seed)}", flush=True)


if __name__ == "__main__":
    main()
