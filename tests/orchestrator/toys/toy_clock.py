"""Report the times it is called with; the input feeds nothing through."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class ToyClock(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.begin, self.end, self.u, self.last_u = 0.0, 0.0, 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        for name in ("begin", "end", "last_u"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.begin, self.end, self.last_u = current_time, current_time + step_size, self.u
        return True
