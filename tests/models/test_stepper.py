"""The base that every model stands on: the table, the stepper and what they refuse."""

import json
import math
import tracemalloc
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from gossamer_models import (
    ArtifactError,
    ConvergenceError,
    InputError,
    ParameterError,
    StateError,
    StepModel,
    Stepper,
    Variable,
)
from gossamer_models.batch import Batch
from gossamer_models.variables import input_, local, output, pack, parameter, select, unpack
from hypothesis import given
from hypothesis import strategies as st

LAG_VARIABLES = (
    parameter("tau", "s", "Time constant", 0.5, 1e-3),
    parameter("largest", "s", "Largest step", 0.1, 1e-6),
    input_("u", "m", "Input", 1.0, -10.0, 10.0),
    output("x", "m", "State"),
    local("ln", "1", "Logarithm of the state"),
)


@dataclass(frozen=True)
class Pair:
    column: ca.MX
    matrix: ca.MX


@dataclass(frozen=True)
class Nested:
    number: ca.MX
    pair: Pair


def lag_model(largest_step: bool = False) -> StepModel:
    """A first-order lag x' = (u - x)/tau, exact for held input; ``ln`` of the state, so that a state below zero fails."""

    def step(x, u, p, h):
        x_next = u.u + (x - u.u) * ca.exp(-h / p.tau)
        return x_next, {"x": x_next, "ln": ca.log(x_next)}

    return StepModel.written(
        name="lag",
        description="First-order lag",
        variables=LAG_VARIABLES,
        init=lambda u, p: (ca.MX(1.0), {"x": 1.0, "ln": 0.0}),
        step=step,
        step_limit="largest" if largest_step else None,
        advice="Keep the state positive.",
    )


@pytest.fixture
def lag():
    stepper = Stepper(lag_model(), tau=0.25)
    stepper.initialize()
    return stepper


def test_a_step_follows_the_exact_solution(lag):
    lag.set("u", 2.0)
    lag.step(0.3)
    assert lag.get("x") == pytest.approx(2.0 - math.exp(-0.3 / 0.25), rel=1e-15)


def test_a_long_step_is_divided_at_the_limit():
    stepper = Stepper(lag_model(largest_step=True), tau=0.25)
    stepper.initialize()
    stepper.set("u", 2.0)
    stepper.step(1.0)
    assert stepper.get("x") == pytest.approx(2.0 - math.exp(-1.0 / 0.25), rel=1e-14)


def test_a_step_of_too_many_parts_is_refused():
    stepper = Stepper(lag_model(largest_step=True))
    stepper.initialize()
    before = stepper.state
    for h in (1e9, 1.7e308):
        with pytest.raises(InputError, match=r"internal steps.*shorter communication steps"):
            stepper.step(h)
    assert stepper.state == before


@given(steps=st.lists(st.floats(1e-3, 1.0), min_size=1, max_size=5), later=st.floats(1e-3, 1.0))
def test_going_back_repeats_the_same_bits(steps, later):
    stepper = Stepper(lag_model())
    stepper.initialize()
    for h in steps:
        stepper.step(h)
    saved = stepper.state
    stepper.step(later)
    first = stepper.state
    other = Stepper(lag_model())
    other.state = saved
    other.step(later)
    assert other.state == first


@pytest.mark.parametrize(
    ("name", "value", "part"),
    [("u", math.nan, "'u'.*nan m"), ("u", math.inf, "'u'.*inf m"), ("u", 11.0, "'u'.*11 m.*-10 to 10")],
)
def test_a_bad_input_is_named_and_leaves_the_state(lag, name, value, part):
    before = lag.get("x")
    lag.set(name, value)
    with pytest.raises(InputError, match=part):
        lag.step(0.1)
    assert lag.get("x") == before
    lag.set(name, 1.0)
    lag.step(0.1)


@pytest.mark.parametrize("h", [0.0, -1.0, math.nan, math.inf, None, "0.1"])
def test_a_step_must_be_a_positive_time(lag, h):
    with pytest.raises(InputError, match="must be a positive time"):
        lag.step(h)


def test_a_result_that_is_not_finite_is_refused_with_advice(lag):
    lag.set("u", -9.0)
    before = lag.state
    with pytest.raises(ConvergenceError, match=r"not finite. Keep the state positive"):
        lag.step(5.0)
    assert lag.state == before


def test_calls_out_of_order_are_refused():
    stepper = Stepper(lag_model())
    with pytest.raises(StateError, match="initialized before it can step"):
        stepper.step(0.1)
    stepper.initialize()
    with pytest.raises(StateError, match="initialized already"):
        stepper.initialize()
    with pytest.raises(StateError, match="'tau' is fixed"):
        stepper.set("tau", 1.0)
    stepper.reset()
    stepper.set("tau", 1.0)
    stepper.initialize()


def test_names_and_kinds_are_checked(lag):
    with pytest.raises(InputError, match=r"no variable 'taw'. Did you mean 'tau'"):
        lag.set("taw", 1.0)
    with pytest.raises(InputError, match="'x' is a result"):
        lag.set("x", 1.0)
    with pytest.raises(InputError, match="'u' needs a number \\[m\\], not 'two'"):
        lag.set("u", "two")
    for index in (99, -1, 1.5, "u"):
        with pytest.raises(InputError, match="no variable number"):
            lag.get_values([index])
    with pytest.raises(InputError, match="one value per table index"):
        lag.set_values([2], [])
    with pytest.raises(InputError, match="'u' needs a number"):
        lag.set("u", 10**400)
    with pytest.raises(ParameterError, match=r"'tau'.*finite number from 0.001"):
        Stepper(lag_model(), tau=-1.0).initialize()


@pytest.mark.parametrize("cut", [0, 7, 30, -1])
def test_a_truncated_state_is_refused(lag, cut):
    with pytest.raises(StateError, match="no saved state of model 'lag'"):
        lag.state = lag.state[:cut]
    with pytest.raises(StateError, match="no saved state of model 'lag'"):
        lag.state = None


@given(place=st.integers(0, 1000), bit=st.integers(0, 7))
def test_a_damaged_state_is_refused_whichever_bit_flips(place, bit):
    stepper = Stepper(lag_model())
    stepper.initialize()
    good = stepper.state
    bad = bytearray(good)
    bad[place % len(bad)] ^= 1 << bit
    with pytest.raises(StateError):
        stepper.state = bytes(bad)
    assert stepper.state == good


def test_a_model_survives_its_files(tmp_path):
    model = lag_model()
    model.save(tmp_path)
    loaded = StepModel.load(tmp_path)
    assert (loaded.digest, loaded.variables) == (model.digest, model.variables)
    a, b = Stepper(model), Stepper(loaded)
    for stepper in (a, b):
        stepper.initialize()
        stepper.step(0.2)
    assert a.state == b.state


@pytest.mark.parametrize("name", ["model.json", "init.casadi", "step.casadi"])
def test_truncated_files_are_refused(tmp_path, name):
    lag_model().save(tmp_path)
    path = tmp_path / name
    path.write_text(path.read_text()[:40])
    with pytest.raises(ArtifactError, match="Build it again"):
        StepModel.load(tmp_path)


@pytest.mark.parametrize("name", ["model.json", "init.casadi", "step.casadi"])
@pytest.mark.parametrize("place", [10, 200, -20])
def test_damaged_files_are_refused(tmp_path, name, place):
    lag_model().save(tmp_path)
    content = bytearray((tmp_path / name).read_bytes())
    content[place] ^= 0x80
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ArtifactError):
        StepModel.load(tmp_path)


def test_files_of_another_version_are_refused(tmp_path):
    lag_model().save(tmp_path)
    card = json.loads((tmp_path / "model.json").read_text()) | {"version": 99}
    (tmp_path / "model.json").write_text(json.dumps(card))
    with pytest.raises(ArtifactError, match=r"version 99, this program reads .* version 1"):
        StepModel.load(tmp_path)


def test_a_table_that_does_not_fit_the_functions_is_refused():
    model = lag_model()
    with pytest.raises(ParameterError, match="but its table requires"):
        StepModel(name="short", description="", variables=model.variables[:-1], init=model.init, step=model.step)
    with pytest.raises(ParameterError, match="needs a start value"):
        Variable(name="k", causality="parameter", unit="1", description="")


def test_results_that_are_not_those_of_the_table_are_refused():
    for results in ({"x": 1.0}, {"x": ca.MX.ones(2), "ln": 0.0}, {"x": 1.0, "ln": 0.0, "more": 0.0}):
        with pytest.raises(ParameterError, match="the step returns"):
            StepModel.written(
                name="lag",
                description="",
                variables=LAG_VARIABLES,
                init=lambda u, p, results=results: (ca.MX(1.0), results),
                step=lambda x, u, p, h, results=results: (x, results),
            )


def test_a_state_of_named_fields_is_one_column_field_by_field():
    x = ca.MX.sym("x", 10)
    like = Nested(0.0, Pair(ca.DM.zeros(3), ca.DM.zeros(3, 2)))
    split = unpack(like, x)
    run = ca.Function("run", [x], [split.number, split.pair.column, split.pair.matrix, pack(split)])
    number, column, matrix, packed = (np.array(part) for part in run(range(10)))
    assert number == 0.0
    assert column.ravel().tolist() == [1.0, 2.0, 3.0]
    assert matrix.tolist() == [[4.0, 7.0], [5.0, 8.0], [6.0, 9.0]]
    assert packed.ravel().tolist() == list(range(10))


@pytest.mark.parametrize("condition", [0, 1])
def test_one_of_two_states_is_chosen_in_every_field(condition):
    x = ca.MX.sym("x", 2)
    yes, no = Nested(1.0, Pair(x, 2.0 * x)), Nested(-1.0, Pair(-x, -2.0 * x))
    run = ca.Function("run", [x], [pack(select(condition, yes, no))])
    sign = 1.0 if condition else -1.0
    assert np.array(run([3.0, 4.0])).ravel().tolist() == [sign * value for value in (1.0, 3.0, 4.0, 6.0, 8.0)]


def test_values_and_state_are_seen_as_they_are_and_cannot_be_written(lag):
    values, x = lag.values, lag.x
    lag.set("u", 2.0)
    lag.step(0.3)
    assert values.tolist() == [lag.get(name) for name in lag.model.names]
    assert x.tolist() == [lag.get("x")]
    for view in (values, x):
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 1.0


def test_steps_leave_no_memory_behind(lag):
    """Traced allocations after 3000 steps against after 1000."""
    tracemalloc.start()
    sizes = []
    for _ in range(3):
        for _ in range(1000):
            lag.set("u", 1.5)
            lag.step(1e-3)
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert sizes[2] - sizes[0] < 1000  # bytes, over 2000 steps


def test_a_result_that_leaves_its_range_warns_once_and_after_a_reset_again(caplog):
    def step(x, u, p, h):
        return x + u.u * h, {"x": x + u.u * h, "y": -x}

    table = (
        input_("u", "m/s", "Rate", 1.0),
        output("x", "m", "State", maximum=2.0, advice="Slow down."),
        local("y", "1", "Other"),
    )

    def init(u, p):
        return ca.MX(0.0), {"x": 0.0, "y": 0.0}

    stepper = Stepper(StepModel.written(name="ramp", description="Ramp", variables=table, init=init, step=step))
    for _ in range(2):
        stepper.reset()
        stepper.initialize()
        for _ in range(4):
            stepper.step(1.0)
    text = "'x' of model 'ramp' is 3 m; the model is valid from -inf to 2. Slow down. The run goes on; this is logged once."
    assert [record.getMessage() for record in caplog.records] == [text, text]


def counting_model():
    """Counts the time since the run began and that since the communication point; no part is longer than 0.1 s."""
    return StepModel.written(
        name="counting",
        description="Two clocks",
        variables=(
            parameter("largest", "s", "Largest step", 0.1, 1e-6),
            output("total", "s", "Since the beginning"),
            output("since", "s", "Since the communication point"),
        ),
        init=lambda u, p: (ca.MX.zeros(2), {"total": 0.0, "since": 0.0}),
        step=lambda x, u, p, h: (x + h, {"total": x[0] + h, "since": x[1] + h}),
        step_limit="largest",
        restarted=1,
    )


def test_states_that_count_from_the_communication_point_begin_again_there_and_not_in_its_parts():
    stepper = Stepper(counting_model())
    stepper.initialize()
    for h, total in ((0.35, 0.35), (0.05, 0.4), (0.35, 0.75)):
        stepper.step(h)
        assert stepper.get_values([1, 2]) == pytest.approx([total, h], rel=1e-14)
    batch = Batch(counting_model(), ["total", "since"])
    assert batch.run(3, 0.35).results[0] == pytest.approx(np.array([[0.35, 0.7, 1.05], [0.35] * 3]), rel=1e-14)
