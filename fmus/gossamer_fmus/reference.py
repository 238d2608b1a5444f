"""What an FMU carries to be checked by any host, as FMI-LS-REF has it [1]_: stimuli, results of its model, and a manifest.

Inputs swing by 1 % of their nominal values about their start values. They are given where a step begins and held over it;
outputs are given at every communication point. CSV files have a column for a variable; of FMI 3.0's arrays a cell holds all
elements.

References
----------
.. [1] Layered Standard References, Modelica Association Project FMI, https://github.com/modelica/fmi-ls-ref.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gossamer_models import GossamerError, StepModel, Variable
from gossamer_models.stepper import Stepper

from .description import Array, FmiVersion, arrays_of, scalars_of

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
_STEPS, _SIZE = 20, 3e-4  # [s], that of the default experiment
_MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref"
  fmi-ls:fmi-ls-version="1.0.0-alpha.1"
  fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">
  <Related type="application/xml" source="experiments.xml" role="experiment/smoke-test" description="Inputs that swing"/>
</fmiReferences>
"""
_EXPERIMENTS = f"""<?xml version="1.0" encoding="UTF-8"?>
<Experiments>
  <Experiment name="swing" description="Inputs that swing by 1 % of their nominal values" startTime="0"
    stopTime="{_STEPS * _SIZE:g}" stepSize="{_SIZE:g}">
    <Stimuli source="stimuli.csv" type="text/csv"/>
    <References source="results.csv" type="text/csv"/>
  </Experiment>
</Experiments>
"""


def references(model: StepModel, fmi: FmiVersion) -> dict[str, bytes]:
    """Return the files by path; none of a model that does not run with its start values."""
    stepper = Stepper(model)
    stepper.warn = lambda _: None
    inputs = [v for v in model.variables if v.causality == "input"]
    outputs = [v for v in model.variables if v.causality == "output"]
    given: list[list[float]] = []
    results: list[list[float]] = []
    try:
        for k in range(_STEPS + 1):
            if k:
                stepper.step(_SIZE)
                results.append([stepper.get(v.name) for v in outputs])
            given.append([_swing(v, math.sin(0.3 * k + i)) for i, v in enumerate(inputs)])
            for variable, value in zip(inputs, given[-1], strict=True):
                stepper.set(variable.name, value)
            if not k:
                stepper.initialize()
                results.append([stepper.get(v.name) for v in outputs])
    except GossamerError:
        return {}
    files = {"fmi-ls-manifest.xml": _MANIFEST, "experiments.xml": _EXPERIMENTS}
    for name, causality, rows in (("stimuli.csv", "input", given), ("results.csv", "output", results)):
        arrays = arrays_of(model) if fmi == 3 else scalars_of(model)
        files[name] = _table([each for each in arrays if each.members[0].causality == causality], rows)
    return {f"{FOLDER}/{name}": text.encode() for name, text in files.items()}


def _swing(variable: Variable, by: float) -> float:
    """Return a value near the start value of an input and in its range, for ``by`` from -1 to 1."""
    low, high = variable.limits
    start = variable.start or 0.0
    change = 0.01 * min(abs(variable.nominal or 1.0), high - low) * by
    return start + change if low <= start + change <= high else start - change


def _table(arrays: Sequence[Array], rows: Sequence[Sequence[float]]) -> str:
    """Write times and the values of some variables, which are listed one after another in each row."""
    lines = [",".join(["time", *(array.name for array in arrays)])]
    for k, row in enumerate(rows):
        values = iter(row)
        cells = [" ".join(f"{next(values):.12g}" for _ in array.members) for array in arrays]
        lines.append(",".join([f"{k * _SIZE:.9g}", *cells]))
    return "\n".join(lines) + "\n"
