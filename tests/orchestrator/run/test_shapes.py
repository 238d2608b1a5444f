"""The shapes of a membrane on a mesh are recorded from the state of its FMU."""

import ctypes
import json
import logging
import zipfile

import casadi as ca
import numpy as np
import pytest
import xarray as xr
from building import build_fmu
from gossamer_models import StepModel, Stepper
from gossamer_models.membrane import Load
from gossamer_models.variables import input_, output
from gossamer_orchestrator import FmuFile, Simulation, load_scenario, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.fmi.clocks import start_instance
from gossamer_orchestrator.fmi.shape import read_shape
from gossamer_orchestrator.results.shapes import SHAPES, UNFINISHED_SHAPES, load_shapes
from gossamer_orchestrator.run import stream
from gossamer_orchestrator.run.recorder import ShapeRecorder
from gossamer_orchestrator.run.runner import Messages
from sails import sail, sail_model

RUN = """
step = 1e-3
stop = 0.01
[components.sail]
fmu = "membrane"
inputs = { pressure = 20.0, pull = 0.5, "temperature[*]" = 0.0, "base_acceleration[*]" = 0.0, "damage[1]" = 0.2 }
[[events]]
time = 0.005
component = "sail"
set = { pull = 1.0, "temperature[1]" = -50.0 }
[record]
frames = FRAMES
variables = ["sail.*"]
"""


@pytest.fixture(scope="module")
def sails(tmp_path_factory):
    """Folder of a membrane that also exposes its nodes."""
    folder = tmp_path_factory.mktemp("sails")
    build_fmu(sail_model(expose=True), folder)
    return folder


def scenario(frames=5, **changes):
    text = RUN.replace("FRAMES", str(frames))
    for old, new in changes.items():
        text = text.replace(old, new)
    return parse_scenario(text, name="sail.toml")


def test_recorded_shapes_are_those_of_the_exposed_nodes(sails, tmp_path):
    data = run_scenario(scenario(), sails, tmp_path)
    history = load_shapes(tmp_path)["sail"]
    assert history.time == pytest.approx([0.0, 0.002, 0.005, 0.008, 0.01], abs=1e-15)
    exposed = data["sail.node"].sel(time=history.time, method="nearest").to_numpy().reshape(5, -1, 3)
    assert history.places - history.surface.nodes == pytest.approx(exposed, abs=1e-15)
    assert np.abs(exposed[-1] - exposed[2]).max() > 1e-4
    nu, S = 0.3, np.array([2e4, 1e4, 5e3])
    still = [(S[0] - nu * S[1]) / 1e7, (S[1] - nu * S[0]) / 1e7, (1 + nu) * S[2] / 1e7]
    assert history.eigenstrain[0] == pytest.approx(np.array([still, [0.0, 0.0, 0.0]]), abs=1e-15)
    assert history.eigenstrain[-1, 0] == pytest.approx(np.add(still, [5e-3, 5e-3, 0.0]), abs=1e-15)
    with xr.open_dataset(tmp_path / SHAPES, engine="scipy") as file:
        assert file["sail.shape"].dims == ("time", "sail_node", "axis")
    assert not (tmp_path / UNFINISHED_SHAPES).exists()


def test_an_orbit_of_lights_eclipse_and_temperatures_from_a_file_moves_the_membrane(tmp_path):
    """As the model does with the same histories; what is drawn knows the temperature of the zone, too."""
    lights = (
        Load(name="sun", kind="light", start=5.0, reflectivity=0.8, diffuse=0.1, direction=(0.0, 0.6, 0.8)),
        Load(name="albedo", kind="light", groups=("right",), direction=(0.0, 0.0, -1.0)),
    )
    model = sail_model(loads=lights)
    build_fmu(model, tmp_path)
    rows = range(11)
    histories = {
        "sun": [5.0 + k for k in rows],
        "sun_eclipse": [min(0.25 * k, 1.0) for k in rows],
        "sun_direction[1]": [0.1 * k for k in rows],
        "albedo": [2.0 - 0.1 * k for k in rows],
        "temperature[1]": [-3.0 * k for k in rows],
        "zone_temperature[1]": [2.0 * k for k in rows],
    }
    table = np.column_stack([1e-3 * np.arange(11), *histories.values()])
    np.savetxt(tmp_path / "orbit.csv", table, delimiter=",", header=",".join(["time", *histories]), comments="")
    feeds = "".join(f'[[inputs]]\nto = "sail.{name}"\nfile = "orbit.csv"\ncolumn = "{name}"\n' for name in histories)
    rest = 'pull = 0.5, "base_acceleration[*]" = 0.0, "damage[1]" = 0.2, "temperature[2]" = 0.0, "sun_direction[2]" = 0.6'
    sail = f'fmu = "membrane"\ninputs = {{ {rest}, "sun_direction[3]" = 0.8, "albedo_direction[*]" = -1.0 }}\n'
    (tmp_path / "orbit.toml").write_text(f"step = 1e-3\nstop = 0.01\n[components.sail]\n{sail}{feeds}")
    data = run_scenario(load_scenario(tmp_path / "orbit.toml"), tmp_path, tmp_path / "out")

    alone = Stepper(model)
    for name, value in {"pull": 0.5, "damage[1]": 0.2, "albedo_direction[1]": -1.0, "albedo_direction[2]": -1.0}.items():
        alone.set(name, value)
    for k in rows:
        for name, values in histories.items():
            alone.set(name, values[k])
        if k == 0:
            alone.initialize()
        else:
            assert data["sail.strain"].to_numpy()[k].item() == pytest.approx(alone.get("strain[1]"), abs=1e-15)
        alone.step(1e-3)
    found = load_shapes(tmp_path / "out")["sail"].eigenstrain
    assert found[-1] - found[0] == pytest.approx(np.array([[9e-4, 9e-4, 0.0], [0.0, 0.0, 0.0]]), abs=1e-15)


def test_every_keeps_the_instants_among_those_of_the_results(sails, tmp_path):
    data = run_scenario(scenario(**{"frames = 5": "frames = 4\nevery = 3"}), sails, tmp_path)
    assert set(load_shapes(tmp_path)["sail"].time) <= set(data["time"].to_numpy())
    assert load_shapes(tmp_path)["sail"].time == pytest.approx([0.0, 0.003, 0.006, 0.01])


def test_without_frames_nothing_is_written_and_what_was_there_goes(sails, tmp_path):
    run_scenario(scenario(1), sails, tmp_path)
    assert load_shapes(tmp_path / "results.nc")["sail"].time == pytest.approx([0.01])
    run_scenario(scenario(0), sails, tmp_path)
    assert load_shapes(tmp_path) == {}
    assert [path.name for path in tmp_path.glob("*shapes*")] == []


class StopAt:
    """Saves the state of a run at a communication point, and ends it."""

    def __init__(self, tick, path):
        self.tick, self.path = tick, path

    def begin(self, simulation):
        pass

    def sample(self, simulation):
        if simulation.tick == self.tick:
            stream.save_checkpoint(self.path, simulation, 0, stream.digests(simulation.plan))
            raise KeyboardInterrupt

    def end(self, simulation):
        pass


@pytest.mark.parametrize("tick", [4, 5])
def test_a_resumed_run_has_the_same_shapes_to_the_byte(sails, tmp_path, tick):
    """Also if it was killed at the instant of a shape, between the saving of its state and the shape."""
    plan = make_plan(scenario(), sails)
    for name in ("whole", "parts"):
        (tmp_path / name).mkdir()
    with Simulation(plan) as simulation:
        simulation.run([ShapeRecorder(plan, tmp_path / "whole")])
    plan, path = make_plan(scenario(), sails), tmp_path / "state.npz"
    with Simulation(plan) as simulation, pytest.raises(KeyboardInterrupt):
        simulation.run([StopAt(tick, path), ShapeRecorder(plan, tmp_path / "parts")])
    plan = make_plan(scenario(), sails)
    card, arrays = stream.load_checkpoint(path, plan)
    with Simulation(plan) as simulation:
        stream.restore_checkpoint(simulation, card, arrays)
        simulation.run([ShapeRecorder(plan, tmp_path / "parts")])
    whole, parts = ((tmp_path / name / UNFINISHED_SHAPES).read_bytes() for name in ("whole", "parts"))
    assert whole == parts


@pytest.mark.parametrize("native", [False, True])
def test_both_kinds_of_fmu_say_where_their_numbers_lie(tmp_path, native):
    if native:
        pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
    model = StepModel.written(
        name="three",
        description="Three sums",
        variables=(input_("rate", "1/s", "Rate", 2.0), output("sum", "1", "Sum of all")),
        init=lambda u, p: (_column(1.0 * u.rate), {"sum": 0.0 * u.rate}),
        step=lambda x, u, p, h: (x + h * u.rate, {"sum": x[0] + x[1] + x[2]}),
        resources=sail_model().resources,
    )
    (tmp_path / "README.md").write_text("# Three\n")
    file = FmuFile(build_fmu(model, tmp_path, tmp_path / "README.md", native=native))
    instance = start_instance(file, "three", 0.0)
    instance.enter_initialization(1.0)
    instance.exit_initialization()
    assert instance.step(ctypes.c_double(0.0), ctypes.c_double(0.25))
    state = instance.serialize()
    layout = json.loads((file.folder() / "resources/state.json").read_text())
    values = np.frombuffer(state, np.float64, layout["n_values"], layout["values"])
    x = np.frombuffer(state, np.float64, layout["n_x"], layout["x"])
    assert values.tolist() == [2.0, 12.0]
    assert x.tolist() == [2.5, 4.5, 6.5]
    instance.close()
    file.close()


def _column(rate):
    return ca.vertcat(rate, 2.0 * rate, 3.0 * rate)


def test_a_shape_that_does_not_fit_is_left_out_with_a_warning(sails, tmp_path, caplog):
    broken = tmp_path / "membrane.fmu"
    with zipfile.ZipFile(sails / "membrane.fmu") as old, zipfile.ZipFile(broken, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content.replace(b'"n_x": ', b'"n_x": 0, "was": ') if name.endswith("state.json") else content)
    file = FmuFile(broken)
    with caplog.at_level(logging.WARNING):
        assert read_shape(file) is None
    assert "its shape cannot be read, so none is recorded: its nodes do not fit the states" in caplog.text
    file.close()


def test_the_model_of_the_fmu_gives_the_same_shape(sails):
    """What the FMU of the file says is what the model says."""
    model = sail_model(expose=True)
    stepper = Stepper(model, pressure=20.0)
    stepper.initialize()
    file = FmuFile(sails / "membrane.fmu")
    shape = read_shape(file)
    places, _ = shape.read(stepper.state)
    exposed = np.array([stepper.get(f"node[{k + 1}]") for k in range(places.size)]).reshape(-1, 3)
    assert places == pytest.approx(sail().mesh.nodes + exposed, abs=1e-15)
    file.close()


def test_the_warnings_of_a_run_are_kept_and_those_of_an_earlier_one_go(sails, tmp_path):
    run_scenario(scenario(0), sails, tmp_path)
    (line,) = (tmp_path / "messages.txt").read_text(encoding="utf-8").splitlines()
    assert line.startswith("warning: component 'sail'")
    assert "'compressed_share' of model 'membrane'" in line
    with Messages() as messages:
        pass
    messages.save(tmp_path)
    assert not (tmp_path / "messages.txt").exists()
