"""The watch on board beside the watch on the ground, on the same records.

``python -m studies.on_board [RECORDS]`` from the folder ``docs`` prints a line for each of some worlds of ``studies.watch``,
damaged and healthy; ``python -m studies.on_board count [STREAMS]`` counts alarms of normal noise alone, whose sums over a
window are drawn at once. Records are of the bilinear square. They last 48 of its first periods; damage begins in the 37th.
The watch on board begins when the response has settled, after twelve, and goes on in windows of half a period of the load.
"""

from __future__ import annotations

import sys

import casadi as ca
import numpy as np
from gossamer_models.membrane import square_structure
from gossamer_models.twin import MembraneForward, Watch
from gossamer_models.twin.on_board import LAGS, LEARNING, StoredWindows, stored_responses, watch_model
from gossamer_models.variables import pack, unpack
from numpy.typing import NDArray

from .twin import BILINEAR
from .watch import HEALTHY, WORLDS

Array = NDArray[np.float64]
SETTLES, BEFORE, ALL = 12, 36, 48  # first periods
NAMES = ("step", "load", "gains")
WINDOWS = 1000  # that are counted of each stream
GROUND = 169  # samples of a window on the ground


def board_alarms(strain: Array, noise: float, first: int) -> tuple[list[int], int]:
    """Return the first sample with an alarm, if there is one, and how many windows are whole."""
    stored = stored_responses(square_structure(*BILINEAR), exact_mesh=True)
    model = watch_model(stored, noise)
    p = np.array([first * stored.step, 0.0])
    x = model.init(strain[:, first - 1], p)[0]
    rest = strain[:, first:]
    _, y = model.step.mapaccum(rest.shape[1])(x, rest, np.tile(p[:, None], rest.shape[1]), stored.step)
    alarms = np.flatnonzero(np.array(y)[0] > 0.5)
    return [first + int(k) for k in alarms[:1]], rest.shape[1] * stored.windows // stored.healthy.shape[1]


def compare(name: str, count: int) -> str:
    """Watch records of a world twice; return its line."""
    world, healthy = WORLDS[name.removeprefix(HEALTHY)], name.startswith(HEALTHY)
    random, structure = np.random.default_rng(5), square_structure(*BILINEAR)
    forward, h = MembraneForward(structure), stored_responses(structure, exact_mesh=True).step
    n = GROUND * ALL
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
        found, whole = board_alarms(strain, world.noise, SETTLES * GROUND)
        watch = Watch(world.noise, structure, step=h, exact_mesh=True)
        ground = [(i + 1) * GROUND for i, part in enumerate(np.split(strain, ALL, 1)) if watch.advance(part).alarm]
        windows["board"] += round(whole * min(1.0, (onset - SETTLES * GROUND) / (n - SETTLES * GROUND)))
        windows["ground"] += onset // GROUND
        for who, alarms in (("board", found), ("ground", ground)):
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


def count_alarms(streams: int) -> str:
    """Count windows that raise an alarm of their own while nothing changes, with nuisances drawn from their priors."""
    stored = stored_responses(square_structure(*BILINEAR), exact_mesh=True)
    windows = StoredWindows(stored, np.full(len(stored.healthy), 1e-3), 1e-5)
    like = windows.start()
    x, g, kind = ca.MX.sym("x", pack(like).numel()), ca.MX.sym("g", windows.q + windows.z), ca.MX.sym("kind")
    judge = ca.Function("judge", [x, g, kind], [pack(windows.judge(unpack(like, x), g, ca.MX(0.0), kind))])
    judge = judge.map(streams)
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
    bound = (alarms + 1.92 + 1.96 * np.sqrt(alarms + 0.96)) / total if alarms else 3.0 / total
    return f"{alarms} alarms in {total} windows: at most {bound:.1e} (95 %); largest score {largest:.2f} of the threshold"


def main() -> None:
    """Print the lines."""
    if sys.argv[1:2] == ["count"]:
        print(count_alarms(int(sys.argv[2]) if len(sys.argv) > 2 else 1000))
        return
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    for name in [*NAMES, *(HEALTHY + name for name in NAMES)]:
        print(f"{name:16} {compare(name, count)}", flush=True)


if __name__ == "__main__":
    main()
