"""A scenario of two state spaces of FMI 3.0, whose arrays a test connects."""

from __future__ import annotations


def state_spaces(inputs: str, *, more: str = "", stop: float = 0.1) -> str:
    """Return the scenario with inputs of the second component and more parameters of the first, without connections."""
    return f"""
step = 0.1
stop = {stop}
[components.a]
fmu = "StateSpace3"
parameters = {{ D = [[0, 0, 0], [0, 0, 0], [0, 0, 0]], x0 = [1, 2, 3]{more} }}
inputs = {{ u = [0, 0, 0] }}
[components.b]
fmu = "StateSpace3"
parameters = {{ "A[*]" = 0, "B[*]" = 0, "C[*]" = 0, x0 = [0, 0, 0] }}
inputs = {{ {inputs} }}
"""
