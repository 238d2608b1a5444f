"""Warn in every step after some time, as a stranger's FMU may."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real
from pythonfmu.enums import Fmi2Status


class ToyWorried(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = current_time + step_size
        if current_time > 0.45:
            self.log(f"y is {self.y:g}, which worries me", Fmi2Status.warning)
        return True
