"""y = factor * u + offset[1] + offset[2], without memory."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class ToyGain(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.factor, self.u, self.y, self.offsets = 1.0, 0.0, 0.0, [0.0, 0.0]
        self.register_variable(Real("factor", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        for i in range(2):
            self.register_variable(
                Real(
                    f"offset[{i + 1}]",
                    causality=Fmi2Causality.input,
                    getter=lambda i=i: self.offsets[i],
                    setter=lambda value, i=i: self.offsets.__setitem__(i, value),
                )
            )
        self.register_variable(Real("y", causality=Fmi2Causality.output, description="what comes out"))

    def exit_initialization_mode(self):
        self.y = self.factor * self.u + sum(self.offsets)

    def do_step(self, current_time, step_size):
        self.exit_initialization_mode()
        return True
