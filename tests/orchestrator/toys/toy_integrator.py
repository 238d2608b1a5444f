"""y' = u, forward Euler with u held over the step; refuses steps longer than limit, and all steps after until."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status


class ToyIntegrator(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.limit, self.until, self.steps = 0.0, 0.0, 1e9, 1e9, 0.0
        for name in ("limit", "until"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("steps", causality=Fmi2Causality.local))

    def do_step(self, current_time, step_size):
        if step_size > self.limit or current_time > self.until:
            self.log(f"100 %% refused: a step of {step_size:g} s from {current_time:g} s", Fmi2Status.discard)
            return False
        self.y += step_size * self.u
        self.steps += 1
        return True
