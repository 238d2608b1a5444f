"""Cost of a case and step in the batch kernel beside ``Stepper`` in the same run, and the time of 10,000 cases."""

import time

import numpy as np
import pytest
from gossamer_models.batch import Batch
from gossamer_models.batch.batch import OneByOne
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.sensor import sensor_model

H = 3e-4
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
