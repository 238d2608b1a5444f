"""Hostile use of all kinds of FMU: random calls in a process of their own, and a thousand instances at once."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmi_instances import Fmi2, Fmi3
from fmu_host import FMUS
from gossamer_models import Stepper

KINDS = ("python", "native", "native FMI 3")


@pytest.mark.parametrize("name", FMUS)
@pytest.mark.parametrize("kind", KINDS)
def test_random_calls_leave_the_fmu_as_its_model(built, unzipped_once, kind, name):
    path = built(kind)[name]
    script = Path(__file__).with_name("random_calls.py")
    command = [sys.executable, str(script), kind, name, str(path), str(unzipped_once(path))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


@pytest.mark.parametrize("kind", ["python", "native FMI 3"])
def test_a_thousand_instances_at_once_do_not_share_anything(built, unzipped_once, models, kind):
    """Every one with an input of its own."""
    path, model = built(kind)["sensor"], models["sensor"]
    _, inputs, results = model.slices()
    fmus = [(Fmi2 if kind == "python" else Fmi3)(model, path, unzipped_once(path)) for _ in range(1000)]
    place = next(reference for reference, group in fmus[0].groups.items() if group.start == inputs.start)
    result = next(reference for reference, group in fmus[0].groups.items() if group.start == results.start)
    for call in ("start", "leave"):
        for fmu in fmus:
            getattr(fmu, call)()
    for k, fmu in enumerate(fmus):
        fmu.set([place], [1e-4 * k])
        fmu.step(3e-4)
    for k in range(0, 1000, 37):
        alone = Stepper(model)
        alone.initialize()
        alone.set(model.names[inputs.start], 1e-4 * k)
        alone.step(3e-4)
        found = fmus[k].get([result])
        assert np.array_equal(found, alone.get_values(range(results.start, results.start + len(found))))
    for fmu in fmus:
        fmu.slave.freeInstance()
