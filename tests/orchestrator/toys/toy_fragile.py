"""Raise an exception after some time, as a stranger's FMU may."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class ToyFragile(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.until, self.y = 0.5, 0.0
        self.register_variable(Real("until", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        if current_time >= self.until:
            raise ZeroDivisionError("100 %s of it broke")
        self.y = current_time + step_size
        return True
