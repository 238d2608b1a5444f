"""End a window every five steps, as a detector does: the damage changes there and nowhere else."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class ToyDetector(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.steps, self.damage, self.now = 0.0, 0.0, 0.0
        for name in ("steps", "damage", "now"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.steps, self.now = self.steps + 1, current_time + step_size
        if self.steps % 5 == 0:
            self.damage += 0.1
        return True
