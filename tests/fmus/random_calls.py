"""Drive an FMU with random calls beside its model: python random_calls.py KIND MODEL FMU FOLDER.

A call that the FMU accepts is made on the model too; a call that it refuses is not. So whatever comes, the FMU must
hold, to the bit, the numbers of a model that never saw the refused calls; and it must refuse what the model refuses,
and nothing else. Hypothesis prints the shortest sequence of calls that breaks this.
"""

import sys

import hypothesis.strategies as st
from fmi_instances import Fmi2, Fmi3
from fmpy.fmi1 import FMICallException
from fmu_host import model_of, same
from gossamer_models import GossamerError, Stepper
from hypothesis import HealthCheck, settings
from hypothesis.stateful import Bundle, RuleBasedStateMachine, consumes, rule, run_state_machine_as_test

ODD = [0.0, -0.0, 1.0, -1.0, 1e-310, -5e-324, 1e308, -1e308, float("nan"), float("inf"), float("-inf")]
STEPS = [1e-4, 3e-4, 1e-3, 2e-3]
ODD_STEPS = [0.0, -1e-3, 1e9, 1e-300, float("nan"), float("inf")]
EXAMPLES = 40
INSTANTIATED, INITIALIZING, RUNNING, TERMINATED = range(4)


class NotNowError(GossamerError):
    """A call that the standard does not allow now."""


class Shadow:
    """A model that is called like an FMU. Strict: as the standard says; else as pythonfmu, which keeps no modes."""

    def __init__(self, model, *, strict):
        self.stepper = Stepper(model)
        self.strict = strict
        self.mode = INSTANTIATED
        self.first_result = model.slices()[2].start

    def require(self, *modes):
        if self.strict and self.mode not in modes:
            raise NotNowError

    def start(self):
        self.require(INSTANTIATED)
        self.mode = INITIALIZING

    def leave(self):
        self.require(INITIALIZING)
        if not self.strict:
            self.mode = INSTANTIATED
        self.stepper.initialize()
        self.mode = RUNNING

    def terminate(self):
        self.require(RUNNING)
        if self.strict:
            self.mode = TERMINATED

    def reset(self):
        self.stepper.reset()
        self.mode = INSTANTIATED

    def set(self, places, values):
        self.require(INSTANTIATED, INITIALIZING, RUNNING)
        self.stepper.set_values(places, values)

    def get(self, places):
        if max(places) >= self.first_result:
            self.require(INITIALIZING, RUNNING, TERMINATED)
            if self.mode == INITIALIZING and not self.stepper.initialized:
                self.stepper.initialize()
                self.stepper.initialized = False
        return self.stepper.get_values(places)

    def step(self, h):
        self.require(RUNNING)
        self.stepper.step(h)

    def save(self):
        return self.stepper.state, self.mode

    def restore(self, saved):
        self.stepper.state = saved[0]
        if self.strict:
            self.mode = saved[1]


def calls(kind, model, path, folder):
    """Return the machine that makes random calls to two instances of an FMU."""
    fmu = Fmi3 if kind == "native FMI 3" else Fmi2
    which = st.sampled_from([0, 0, 0, 1])
    first_result = model.slices()[2].start

    def good(place):
        variable = model.variables[place]
        low, high = (limit for limit in (variable.minimum, variable.maximum))
        start = variable.start or 0.0
        numbers = [start, start + 0.01 * (abs(start) or 0.1), start + 0.02 * (abs(start) or 0.1)]
        return st.sampled_from([x for x in numbers if (low is None or x >= low) and (high is None or x <= high)])

    class Calls(RuleBasedStateMachine):
        states = Bundle("states")

        def __init__(self):
            super().__init__()
            self.fmus = [fmu(model, path, folder) for _ in range(2)]
            self.shadows = [Shadow(model, strict=kind != "python") for _ in range(2)]

        def accepted(self, i, call, *args):
            """Make a call; tell whether it was accepted, which for pythonfmu means that nothing was logged."""
            self.fmus[i].messages.clear()
            try:
                self.result = call(*args)
            except FMICallException:
                assert self.fmus[i].messages, "refused without a message"
                return False
            return not self.fmus[i].messages

        def both(self, i, call, given, modelled):
            """Make a call to FMU and model; both must refuse it, or none."""
            taken = self.accepted(i, getattr(self.fmus[i], call), *given)
            wanted, error = None, None
            try:
                wanted = getattr(self.shadows[i], call)(*modelled)
            except GossamerError as refusal:
                error = refusal
            assert taken == (error is None), error or self.fmus[i].messages
            if call == "get" and taken:
                assert same(self.result, wanted, kind, model.name)

        @rule(i=which, call=st.sampled_from(["start", "start", "leave", "terminate", "reset"]))
        def change_mode(self, i, call):
            self.both(i, call, (), ())

        @rule(i=which)
        def begin_again(self, i):
            for call in ("reset", "start", "leave"):
                self.both(i, call, (), ())

        @rule(i=which, data=st.data(), odd=st.booleans())
        def set_some(self, i, data, odd):
            references = data.draw(st.lists(st.sampled_from(list(self.fmus[i].groups)), min_size=1, max_size=3))
            places = [place for reference in references for place in self.fmus[i].groups[reference]]
            values = [data.draw(st.sampled_from(ODD) if odd else good(place)) for place in places]
            self.both(i, "set", (references, values), (places, values))

        @rule(i=which)
        def set_all_right(self, i):
            for reference, group in self.fmus[i].groups.items():
                if group.start < first_result:
                    values = [float(model.variables[place].start) for place in group]
                    self.both(i, "set", ([reference], values), (group, values))

        @rule(i=which, references=st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=2))
        def use_unknown_references(self, i, references):
            if not set(references) <= {0, *self.fmus[i].groups}:
                assert not self.accepted(i, self.fmus[i].get, references)
                assert not self.accepted(i, self.fmus[i].set, references, [1.0] * len(references))
            assert not self.accepted(i, self.fmus[i].other_types)

        @rule(i=which)
        def get_all(self, i):
            groups = self.fmus[i].groups.items()
            shadow = self.shadows[i]
            has_results = shadow.strict or shadow.stepper.initialized or shadow.mode == INITIALIZING
            for results in (False, True) if has_results else (False,):
                chosen = [(reference, group) for reference, group in groups if (group.start >= first_result) == results]
                places = [place for _, group in chosen for place in group]
                self.both(i, "get", ([reference for reference, _ in chosen],), (places,))

        @rule(i=which, steps=st.lists(st.sampled_from(STEPS), min_size=1, max_size=4))
        def step(self, i, steps):
            for h in steps:
                self.both(i, "step", (h,), (h,))

        @rule(i=which, h=st.sampled_from(ODD_STEPS))
        def step_oddly(self, i, h):
            self.both(i, "step", (h,), (h,))

        @rule(i=which, steps=st.lists(st.sampled_from(STEPS), max_size=2))
        def go_and_come_back(self, i, steps):
            saved = self.save(i)
            self.step(i, steps)
            self.get_all(i)
            self.restore(i, saved)
            self.free(i, saved)

        @rule(target=states, i=which)
        def save(self, i):
            return self.fmus[i].save(), self.shadows[i].save()

        @rule(i=which, saved=states)
        def restore(self, i, saved):
            self.both(i, "restore", saved[:1], saved[1:])
            self.get_all(i)

        @rule(target=states, i=which, saved=states)
        def write_and_read(self, i, saved):
            return self.fmus[1 - i].read(self.fmus[i].write(saved[0])), saved[1]

        @rule(i=which, saved=consumes(states))
        def free(self, i, saved):
            self.fmus[i].free(saved[0])

        @rule(i=which, saved=states, data=st.data())
        def read_what_is_spoilt(self, i, saved, data):
            content = bytearray(self.fmus[i].write(saved[0]))
            place = data.draw(st.integers(0, len(content) - 1))
            match data.draw(st.sampled_from(["flip", "cut", "add", "another model"])):
                case "flip":
                    content[place] ^= 1 << data.draw(st.integers(0, 7))
                case "cut":
                    del content[place:]
                case "add":
                    content += b"\0"
                case "another model":
                    content[8:24] = bytes(16)

            def read_and_restore():
                state = self.fmus[i].read(bytes(content))
                try:
                    self.fmus[i].restore(state)
                finally:
                    self.fmus[i].free(state)

            assert not self.accepted(i, read_and_restore)

        def teardown(self):
            for i in range(2):
                self.get_all(i)
                self.fmus[i].slave.freeInstance()

    return Calls


if __name__ == "__main__":
    kind, name, path, folder = sys.argv[1:]
    run_state_machine_as_test(
        calls(kind, model_of(name), path, folder),
        settings=settings(
            max_examples=EXAMPLES // 8 if "membrane" in name else EXAMPLES,
            stateful_step_count=40,
            derandomize=True,
            database=None,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        ),
    )
