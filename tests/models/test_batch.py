"""The batch kernel gives each case what ``Stepper`` gives it.

The peer of every number is ``Stepper``, which runs one case in CasADi's virtual machine.
"""

import logging
import os
import pickle
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from gossamer_models import GossamerError, InputError, ParameterError, StateError, StepModel, Stepper, compiler
from gossamer_models.batch import Batch
from gossamer_models.batch import batch as batch_module
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.sensor import sensor_model
from gossamer_models.variables import input_, local, output, parameter
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.shells import SHELLS, shell

pytest.importorskip("ziglang", reason="the batch kernel needs the compiler ziglang")
H = 3e-4
CASES = 11  # one full block of lanes, one with three used


def toy(*, table: bool = False) -> StepModel:
    """A leaky integrator with every kind of operation that the models use; not a number beyond x = 1."""

    def step(x, u, p, h):
        a = x[0] + h * (u.push - p.rate * x[0])
        wide = ca.logic_and(ca.fabs(a) > 0.3, ca.logic_not(a == 0.5))
        bend = ca.if_else(ca.logic_or(wide, u.push <= -2.0), ca.sin(a) + ca.exp(-a), ca.fmax(a, 0.1) ** 3)
        b = x[1] + h * (bend - ca.sign(x[1]) * ca.floor(10.0 * a) / 10.0 + ca.tanh(a) * ca.fmin(x[1], 1.0))
        if table:
            b = b + h * ca.MX(ca.DM([1.0, 3.0, 2.0, 5.0]))[ca.floor(ca.fmin(ca.fabs(4.0 * a), 3.0))]
        return ca.vertcat(a, b), results(a, b, p)

    def results(a, b, p):
        return {"root": ca.sqrt(1.0 - a**2), "level": b, "max_step": p.patience / (1.0 + 4.0 * a**2)}

    def init(u, p):
        return ca.vertcat(0.0 * p.rate, p.rate / 10.0), results(ca.MX(0.0), p.rate / 10.0, p)

    return StepModel.written(
        name="toy",
        description="A leaky integrator",
        variables=(
            parameter("rate", "1/s", "Rate", 1.0, 0.0, 10.0),
            parameter("patience", "s", "Largest step at rest", 0.05, 0.0, 10.0),
            input_("push", "1/s", "Push", 0.0, -1e6, 1e6),
            output("root", "1", "Root"),
            local("level", "1", "Level"),
            local("max_step", "s", "Largest step"),
        ),
        init=init,
        step=step,
        step_limit="max_step",
    )


TOY, TABLE = toy(), toy(table=True)


def one_by_one(model, results, steps, h, start, inputs, cases):
    """Run each case in a Stepper; results, shape (cases, results, steps), not a number from a failure on."""
    found = np.full((cases, len(results), steps), np.nan)
    for case in range(cases):
        stepper = Stepper(model)
        for name, values in start.items():
            of_case = np.broadcast_to(values, (cases, *np.shape(values)[1:]) if np.ndim(values) else (cases,))[case]
            names = [name] if name in model.names else [n for n in model.names if n.startswith(f"{name}[")]
            for each, value in zip(names, np.atleast_1d(of_case), strict=True):
                stepper.set(each, value)
        try:
            stepper.initialize()
            for k in range(steps):
                for name, values in inputs.items():
                    stepper.set(name, np.broadcast_to(values, (cases, steps))[case, k])
                stepper.step(h)
                found[case, :, k] = [stepper.get(name) for name in results]
        except (GossamerError, ZeroDivisionError, ValueError):
            continue
    return found


def agree(found, expected, tolerance=5e-15):
    """Compare with the largest value of each result; what is not a number is so in both."""
    assert (np.isnan(found) == np.isnan(expected)).all()
    scale = np.nanmax(np.abs(expected), axis=(0, 2), keepdims=True)
    assert np.nanmax(np.abs(found - expected) / np.where(scale == 0.0, 1.0, scale)) <= tolerance


def random_walk(rng, steps, size):
    return np.abs(np.cumsum(rng.normal(0.0, size, (CASES, steps)), axis=1))


def membrane_case(rng):
    model = membrane_model(square_structure(4))
    start = {
        "damage": rng.uniform(0.0, 0.5, (CASES, 16)) * (rng.random((CASES, 16)) < 0.3),
        "mass_damping": rng.uniform(0.0, 5.0, CASES),
    }
    pressure = np.cumsum(rng.normal(0.0, 50.0, (CASES, 60)), axis=1)
    return model, ["strain[1]", "strain[4]", "deflection"], start, {"pressure": pressure}


def sensor_case(rng):
    start = {"rest_strain": rng.uniform(0, 0.02, CASES)}
    return sensor_model(), ["resistance"], start, {"strain": random_walk(rng, 80, 0.003)}


def compensator_case(method):
    def case(rng):
        strain = random_walk(rng, 80, 0.003)
        sensor = Batch(sensor_model(), ["resistance"], ["strain"])
        resistance = sensor.run(80, H, inputs={"strain": strain}).results[:, 0]
        noisy = resistance * (1.0 + 1e-4 * rng.normal(size=resistance.shape))
        return compensator_model(method=method), ["strain", "saturated"], {}, {"resistance": noisy}

    return case


def toy_case(model):
    def case(rng):
        start = {"rate": rng.uniform(0.0, 3.0, CASES), "patience": rng.uniform(0.001, 0.2, CASES)}
        return model, ["root", "level"], start, {"push": rng.normal(0.0, 6.0, (CASES, 60))}

    return case


@pytest.mark.parametrize(
    ("make", "h"),
    [
        pytest.param(membrane_case, H, id="membrane"),
        pytest.param(membrane_case, 3e-3, id="membrane, long steps"),
        pytest.param(sensor_case, H, id="sensor"),
        pytest.param(compensator_case("inverse"), H, id="exact inverse"),
        pytest.param(compensator_case("estimator"), H, id="estimator"),
        pytest.param(toy_case(TOY), 0.05, id="toy"),
        pytest.param(toy_case(TABLE), 0.05, id="toy with a table"),
    ],
)
def test_each_case_is_what_stepper_gives(make, h):
    model, results, start, inputs = make(np.random.default_rng(7))
    steps = next(iter(inputs.values())).shape[1]
    batch = Batch(model, results, list(inputs))
    assert batch.compiled
    run = batch.run(steps, h, start, inputs)
    expected = one_by_one(model, results, steps, h, start, inputs, CASES)
    agree(run.results, expected)
    assert (run.failed == np.isnan(expected[:, 0, -1])).all()


@settings(max_examples=30, deadline=None)
@given(
    rates=st.lists(st.floats(0.0, 10.0), min_size=1, max_size=19),
    push=st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=6),
    patience=st.floats(1e-6, 1.0),
    workers=st.integers(1, 3),
)
def test_a_case_depends_neither_on_its_neighbours_nor_on_workers(rates, push, patience, workers):
    batch = Batch(TOY, ["level"], ["push"])
    start = {"rate": rates, "patience": patience}
    together = batch.run(len(push), 0.05, start, {"push": push}, workers=workers)
    for case, rate in enumerate(rates):
        alone = batch.run(len(push), 0.05, {"rate": rate, "patience": patience}, {"push": push})
        np.testing.assert_array_equal(together.results[case], alone.results[0])
        np.testing.assert_array_equal(together.state.x[case], alone.state.x[0])


def test_a_saved_state_goes_on_bit_by_bit():
    model, results, start, inputs = membrane_case(np.random.default_rng(3))
    batch = Batch(model, results, list(inputs))
    whole = batch.run(60, H, start, inputs)
    first = batch.run(23, H, start, {k: v[:, :23] for k, v in inputs.items()})
    saved = first.state.x.copy()
    second = batch.run(37, H, {}, {k: v[:, 23:] for k, v in inputs.items()}, state=first.state)
    np.testing.assert_array_equal(np.concatenate([first.results, second.results], axis=2), whole.results)
    np.testing.assert_array_equal(second.initial, first.results[:, :, -1])
    np.testing.assert_array_equal(second.state.x, whole.state.x)
    np.testing.assert_array_equal(first.state.x, saved)  # a state can be used again


def test_a_constant_input_may_change_from_run_to_run():
    batch = Batch(TOY, ["level"])
    first = batch.run(5, 0.05, {"push": [0.1, 0.2]})
    second = batch.run(5, 0.05, {"push": [0.3, 0.4]}, state=first.state)
    both = Batch(TOY, ["level"], ["push"]).run(
        10, 0.05, {"push": [0.1, 0.2]}, {"push": np.repeat([[0.1, 0.3], [0.2, 0.4]], 5, axis=1)}
    )
    np.testing.assert_array_equal(np.concatenate([first.results, second.results], axis=2), both.results)


def test_every_so_many_steps_are_recorded():
    batch = Batch(TOY, ["root", "level"])
    all_steps, some = (batch.run(10, 0.05, {"push": 0.5}, every=every).results for every in (1, 3))
    np.testing.assert_array_equal(some, all_steps[:, :, 2::3])


def test_no_step_gives_the_initial_results_alone():
    run = Batch(TOY, ["level"]).run(0, 1.0, {"rate": [1.0, 2.0]})
    assert run.results.shape == (2, 1, 0)
    np.testing.assert_array_equal(run.initial, [[0.1], [0.2]])


def test_a_failed_case_does_not_disturb_the_others():
    push = np.zeros((CASES, 8))
    push[4, 5] = 1e4  # its root is no number from step 5 on
    batch = Batch(TOY, ["root", "level"], ["push"])
    run, calm = batch.run(8, 0.05, inputs={"push": push}), batch.run(8, 0.05, inputs={"push": 0.0 * push})
    assert np.flatnonzero(run.failed).tolist() == [4]
    assert np.isnan(run.results[4, :, 5:]).all()
    np.testing.assert_array_equal(run.results[4, :, :5], calm.results[4, :, :5])
    others = np.arange(CASES) != 4
    np.testing.assert_array_equal(run.results[others], calm.results[others])
    again = batch.run(8, 0.05, inputs={"push": 0.0 * push}, state=run.state)
    assert again.failed.tolist() == run.failed.tolist()


def test_too_many_internal_steps_are_a_failure_too():
    run = Batch(TOY, ["level"]).run(2, 1.0, {"patience": [0.5, 1e-9, 0.0]})
    assert run.failed.tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"start": {"rate": [1.0, np.nan]}}, ParameterError, "'rate' .* nan 1/s in case 1 "),
        ({"start": {"rate": [1.0, 1.0, 11.0]}}, ParameterError, "'rate' .* 11 1/s in case 2 .* from 0 to 10"),
        ({"start": {"rates": 1.0}}, InputError, "Did you mean 'rate'"),
        ({"start": {"rate": [1.0, 1.0], "patience": [1.0, 1.0, 1.0]}}, InputError, "same number of cases"),
        ({"start": {"rate": "fast"}}, InputError, "'rate' needs numbers"),
        ({"start": {"rate": [[1.0, 2.0]]}}, InputError, r"'rate' .* shape \(1, 2\)"),
        ({"inputs": {"push": [1.0, 2.0, np.inf, 1.0]}}, InputError, "'push' .* inf 1/s in case 0, step 2"),
        ({"inputs": {"push": [1.0, 2.0]}}, InputError, r"'push' .* shape \(2,\)"),
        ({"inputs": {}}, InputError, r"records of \['push'\]"),
        ({"h": 0.0}, InputError, "positive time"),
        ({"steps": -1}, InputError, "steps must be"),
        ({"every": 0}, InputError, "every must be"),
        ({"workers": 0}, InputError, "workers must be"),
    ],
)
def test_a_refusal_names_the_variable_and_the_case(arguments, error, words):
    batch = Batch(TOY, ["level"], ["push"])
    with pytest.raises(error, match=words):
        batch.run(**{"steps": 4, "h": 0.1, "inputs": {"push": np.zeros(4)}} | arguments)


def test_unknown_results_and_inputs_are_refused():
    with pytest.raises(InputError, match="no result 'levl'"):
        Batch(TOY, ["levl"])
    with pytest.raises(InputError, match="no input 'rate'"):
        Batch(TOY, ["level"], ["rate"])


def test_a_saved_state_of_another_model_or_with_parameters_is_refused():
    batch = Batch(TOY, ["level"])
    state = batch.run(1, 0.1).state
    with pytest.raises(StateError, match="'rate' is fixed"):
        batch.run(1, 0.1, {"rate": 1.0}, state=state)
    with pytest.raises(StateError, match="another model"):
        Batch(TABLE, ["level"]).run(1, 0.1, state=state)


def test_without_a_compiler_the_numbers_are_the_same_and_the_log_says_so(monkeypatch, caplog):
    model, results, start, inputs = toy_case(TOY)(np.random.default_rng(5))
    compiled = Batch(model, results, list(inputs))
    monkeypatch.setattr(batch_module, "has_compiler", lambda: False)
    plain = Batch(model, results, list(inputs))
    assert not plain.compiled
    assert "ziglang is missing" in caplog.text
    runs = [b.run(60, 0.05, start, inputs) for b in (compiled, plain)]
    agree(runs[0].results, runs[1].results)
    assert runs[0].failed.tolist() == runs[1].failed.tolist()
    half = [b.run(20, 0.05, start, {"push": inputs["push"][:, :20]}) for b in (compiled, pickle.loads(pickle.dumps(plain)))]
    rest = [
        b.run(40, 0.05, {}, {"push": inputs["push"][:, 20:]}, state=h.state)
        for b, h in zip((compiled, plain), half, strict=True)
    ]
    agree(rest[0].results, rest[1].results)


def test_what_lanes_cannot_do_runs_one_by_one_and_the_log_says_why(caplog):
    x, u, p, h = (ca.MX.sym(name, n) for name, n in (("x", 1), ("u", 1), ("p", 0), ("h", 1)))
    branch = ca.Function.if_else("branch", *(ca.Function("f", [x], [c * x]) for c in (2.0, 3.0)))
    y = branch(u > 0.0, x)
    model = StepModel(
        name="branching",
        description="A branch between functions",
        variables=(input_("u", "1", "Input", 0.0), output("y", "1", "Result")),
        init=ca.Function("init", [u, p], [u + 1.0, u]),
        step=ca.Function("step", [x, u, p, h], [y, y]),
    )
    batch = Batch(model, ["y"], ["u"])
    found = batch.run(2, 1.0, inputs={"u": [[1.0, 1.0], [-1.0, 1.0]]}).results
    np.testing.assert_array_equal(found, [[[2.0, 4.0]], [[3.0, 6.0]]])
    assert batch.compiled or "one after the other" in caplog.text


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """A cache folder that is empty; that of the compiler stays."""
    monkeypatch.setattr(compiler, "_usual_folder", lambda: tmp_path)
    compiler.cache_folder.cache_clear()
    yield tmp_path
    compiler.cache_folder.cache_clear()


def test_a_damaged_library_is_compiled_again(own_cache, caplog):
    caplog.set_level(logging.INFO)
    expected = Batch(TOY, ["level"]).run(3, 0.1, {"push": 1.0}).results
    (file,) = own_cache.iterdir()
    whole = file.read_bytes()
    file.unlink()  # a library in use is not written into
    file.write_bytes(whole[: len(whole) // 2])
    np.testing.assert_array_equal(Batch(TOY, ["level"]).run(3, 0.1, {"push": 1.0}).results, expected)
    assert f"{file} is damaged" in caplog.text
    assert [each.read_bytes() for each in own_cache.iterdir()] == [whole]
    caplog.clear()
    Batch(TOY, ["level"])
    assert "compiling" not in caplog.text


def test_a_cache_folder_that_cannot_be_written_is_replaced_by_a_temporary_one(tmp_path, monkeypatch, caplog):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    compiler.cache_folder.cache_clear()
    folder = compiler.cache_folder()
    compiler.cache_folder.cache_clear()
    assert folder.is_dir()
    assert str(folder) in caplog.text


def test_another_process_needs_no_model(tmp_path):
    batch = Batch(TOY, ["level"])
    content = pickle.dumps(batch)
    assert len(content) < 10_000
    (tmp_path / "batch").write_bytes(content)
    program = (
        "import pickle, sys; batch = pickle.loads(open(sys.argv[1], 'rb').read()); "
        "print(batch.run(3, 0.1, {'push': [1.0, 2.0]}).results.tobytes().hex())"
    )
    command = [sys.executable, "-c", program, tmp_path / "batch"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == batch.run(3, 0.1, {"push": [1.0, 2.0]}).results.tobytes().hex()


@pytest.mark.skipif(os.name != "posix", reason="sends signals as POSIX has them")
def test_two_interrupts_leave_no_thread_that_writes_into_arrays_of_others(kills):
    """The memory of a run that was left would be given to what comes next, while C still fills it."""
    command = [sys.executable, Path(__file__).with_name("interrupted_twice.py"), str(2 * (kills or 3))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    interrupted, changed = map(int, done.stdout.split())
    assert interrupted > 0
    assert changed == 0


def test_a_kernel_that_is_gone_is_refused(own_cache):
    content = pickle.dumps(Batch(TOY, ["level"]))
    for file in own_cache.iterdir():
        file.unlink()
    with pytest.raises(StateError, match="Make the Batch on this machine"):
        pickle.loads(content)


@pytest.mark.parametrize("name", SHELLS)
def test_a_membrane_of_any_shape_runs_as_stepper_runs_it(name):
    """Loops over its elements in the lanes, from the equilibrium that Newton's method finds."""
    model = membrane_model(shell(name))
    rng = np.random.default_rng(3)
    start = {"damage": rng.uniform(0.0, 0.5, (3, 2)), "base_acceleration[3]": [0.0, 1.0, 2.0]}
    pressure = model.variables[model.names.index("pressure")].start * rng.uniform(1.0, 2.0, (3, 12))
    results = ["strain[1]", "largest_strain", "compressed_share"]
    batch = Batch(model, results, ["pressure"])
    assert batch.compiled
    h = 3.3 * float(batch.run(0, 1.0, start, {"pressure": pressure[:, :0]}).state.values[0, -1])
    run = batch.run(12, h, start, {"pressure": pressure})
    expected = one_by_one(model, results, 12, h, start, {"pressure": pressure}, 3)
    agree(run.results, expected, 1e-7)  # relaxation stops where rounding is met, Newton's method well below


def test_a_membrane_without_equilibrium_fails_alone():
    batch = Batch(membrane_model(shell("plate")), ["strain[1]"])
    run = batch.run(2, 1e-4, {"force": [0.0, -1e5]})
    assert run.failed.tolist() == [False, True]
    assert np.isnan(run.initial[1]).all()


def test_loops_are_run_or_refused_but_nothing_stands_in_for_them(monkeypatch):
    """With a compiler they are the same as the expression; without one, a model that has no other form is named."""
    square = square_structure(4, 1)
    looped = membrane_model(square, compiled=True)
    both = (Batch(model, ["deflection"]) for model in (membrane_model(square), looped))
    found = [batch.run(5, H, {"pressure": 9.0}).results for batch in both]
    np.testing.assert_array_equal(*found)
    x, d = (np.zeros(looped.tables.loops[0].stand_in.nnz_in(i)) for i in range(2))
    assert all(np.isnan(np.asarray(part)).all() for part in looped.tables.loops[0].stand_in(x, d))
    monkeypatch.setattr(batch_module, "has_compiler", lambda: False)
    assert not Batch(looped, ["deflection"]).compiled
    drum = membrane_model(shell("plate"), compiled=True)
    with pytest.raises(ParameterError, match="'membrane' has loops over tables"):
        Batch(drum, ["strain[1]"])
