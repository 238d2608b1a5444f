"""Cost of a case and step in the batch kernel beside ``Stepper`` in the same run, and the time of 10,000 cases.

Of membranes of other shapes, the step of eight cases beside that without loops over elements, and the equilibrium of a
damaged case beside relaxation.
"""

import time
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from gossamer.descriptions import load_structure
from gossamer_models.batch import Batch
from gossamer_models.batch.batch import OneByOne
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane import Equilibrium, membrane_model, square_structure
from gossamer_models.sensor import sensor_model
from oracles.shells import SHELLS, shell

H = 3e-4
SETUPS = Path(__file__).parents[2] / "orchestrator" / "membranes"
STRAINS = [f"strain[{k}]" for k in range(1, 5)]
MODELS = {
    "membrane, bilinear 8 x 8": (lambda: membrane_model(square_structure(8, 1)), STRAINS, None),
    "membrane": (lambda: membrane_model(), STRAINS, None),
    "sensor": (sensor_model, ["resistance"], ("strain", 0.02, 0.01)),
    "exact inverse": (compensator_model, ["strain"], ("resistance", 20.0, 1.0)),
    "estimator": (lambda: compensator_model(method="estimator"), ["strain"], ("resistance", 20.0, 1.0)),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_case_and_step(name, measured):
    make, results, signal = MODELS[name]
    model = make() if measured or signal else membrane_model(square_structure(4, 1))
    begin = time.perf_counter()
    batch = Batch(model, results, [signal[0]] if signal else [])
    made = time.perf_counter() - begin
    rng = np.random.default_rng(0)

    def cost(cases, steps):
        """Seconds of processor time to initialize a case, and per case and step."""
        start, inputs = {}, {}
        if signal:
            quantity, mean, amplitude = signal
            wave = mean + amplitude * np.sin(np.linspace(0.0, 9.0, steps)) * rng.uniform(0.5, 1.0, (cases, 1))
            inputs = {quantity: wave}
        else:
            start = {"damage": rng.uniform(0.0, 0.5, (cases, 16)) * (rng.random((cases, 16)) < 0.2)}
        moments = [time.process_time()]
        batch.run(0, H, start, {q: w[:, :0] for q, w in inputs.items()})
        moments.append(time.process_time())
        batch.run(steps, H, start, inputs)
        moments.append(time.process_time())
        first, both = np.diff(moments)
        return first / cases, (both - first) / cases / steps

    init, step = min(cost(64, 500) if measured else cost(8, 5) for _ in range(3))
    batch._engine = OneByOne(model, batch._recorded)
    _, peer = cost(2, 100) if measured else cost(2, 5)
    campaign = 1e4 * (init + 1000 * step) / 2
    print(f"\n{name}: kernel ready in {made:.1f} s; {1e6 * step:.2f} us per case and step of {H:g} s, ", end="")
    print(f"{peer / step:.0f} times as fast as Stepper; {1e3 * init:.2f} ms to initialize a case; ", end="")
    print(f"10,000 cases of 0.3 s on two cores: {campaign:.0f} s")


@pytest.mark.parametrize("name", ["sail", "tube", "reflector"])
def test_a_membrane_of_another_shape(name, measured):
    """Reach: step of eight cases 130, 215, 85 us on a quiet machine, compiled in 4 s; 0.03 s for an equilibrium."""
    structure = load_structure(SETUPS / f"{name}.toml") if measured else shell(SHELLS[0])
    model, rng = membrane_model(structure), np.random.default_rng(0)
    damage = rng.uniform(0.0, 0.5, (8, structure.n_zones)) * (rng.random((8, structure.n_zones)) < 0.3)
    strains = model.elements("strain")
    begin = time.perf_counter()
    looped = Batch(model, strains)
    made = time.perf_counter() - begin
    state = looped.run(0, 1.0, {"damage": damage}).state
    steps = 400 if measured else 2

    def step(batch):
        begin = time.process_time()
        batch.run(steps, 0.9 * state.values[0, -1], state=replace(state, model=batch._identity))
        return (time.process_time() - begin) / steps

    best = min(step(looped) for _ in range(10 if measured else 1))
    peer = Batch(replace(model, compiled=None, init=_nothing(model), at_rest=None), strains)
    expanded = min(step(peer) for _ in range(10)) if measured else step(peer)
    equilibrium = Equilibrium(structure, model)
    equilibrium.solve({"damage": 0.0 * damage})
    begin = time.process_time()
    found = equilibrium.solve({"damage": damage})
    newton = (time.process_time() - begin) / 8
    begin = time.process_time()
    model.init(found.u[0], found.p[0])
    relaxation = time.process_time() - begin
    print(f"\n{name}: kernel ready in {made:.1f} s; {1e6 * best:.0f} us per step of eight cases, ", end="")
    print(
        f"{expanded / best:.1f} times as fast as without loops over elements; {1e3 * newton:.0f} ms for the equilibrium ",
        end="",
    )
    print(f"of a damaged case, {relaxation / newton:.0f} times as fast as relaxation")


def _nothing(model):
    """Return an ``init`` without relaxation, whose many steps are too much code for lanes."""
    u, p = model.init.mx_in()
    return ca.Function("init", [u, p], [ca.MX.zeros(model.init.nnz_out(i)) for i in range(2)])
