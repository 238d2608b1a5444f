"""y = not u."""

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability


class ToyInverter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.y = False
        self.register_variable(
            Boolean("u", causality=Fmi2Causality.input, variability=Fmi2Variability.discrete, start=False)
        )
        self.register_variable(Boolean("y", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))

    def do_step(self, current_time, step_size):
        self.y = not self.u
        return True
