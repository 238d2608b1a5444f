"""Golden files: each FMU run on the inputs beside its README, compared with the outputs kept there.

They have the form of the FMI cross-check, which FMPy and fmusim read: a row of names first; inputs at the beginning of each
step, held over it; outputs at each communication point, the start included; times and step in a file of options.
"""

import math

import fmpy
import numpy as np
import pytest
from fmu_host import FMUS, excite
from gossamer_fmus.catalogue import fmu_folder

# Relative to the largest value of a column. The arithmetic is the same everywhere; the C library's exp and sin are not.
TOLERANCE = 1e-9
STEPS = 200
H = 3e-4


def strain_history():
    """Load with a 20 Hz ripple, hold, unload half way, hold [1]."""
    ramp = np.interp(np.arange(1, STEPS + 1), [0, 80, 110, 170, 200], [0.02, 0.30, 0.30, 0.12, 0.12])
    return ramp + 0.01 * np.sin(2 * math.pi * 20.0 * H * np.arange(1, STEPS + 1))


def inputs_of(name, golden):
    """Input columns by variable: a value for each step."""
    k = np.arange(1, STEPS + 1)
    if name == "membrane":
        return {"pressure": 2e3 * np.sin(0.02 * k), "base_acceleration": 5.0 * np.cos(0.1 * k), "damage[1]": 0.4 * (k > 100)}
    if name == "framed_membrane":
        return {
            "pressure": 2e3 * np.sin(0.02 * k),
            "frame_acceleration[1]": 2.0 * np.sin(0.05 * k),
            "frame_acceleration[3]": 5.0 * np.cos(0.1 * k),
            "angular_velocity[1]": 0.3 * np.sin(10.0 * H * k),
            "angular_acceleration[1]": 3.0 * np.cos(10.0 * H * k),
            "angular_velocity[3]": 0.5 + 0.0 * k,
            "damage[1]": 0.4 * (k > 100),
        }
    if name == "hub":
        membrane = golden("framed_membrane", "ref")
        pulls = {f"{of}[{i}]": membrane[f"{of}[{i}]"][:-1] for of in ("force", "torque") for i in (1, 2, 3)}
        return pulls | {
            "thruster_force[3]": 10.0 * (k > 150),
            "wheel_torque[2]": 0.5 * np.sign(100.5 - k),
            "attached_mass": np.full(STEPS, membrane["held_mass"][0]),
            "attached_first_moment[1]": np.full(STEPS, membrane["held_first_moment[1]"][0]),
            **{f"attached_inertia[{i}]": np.full(STEPS, membrane[f"held_inertia[{i}]"][0]) for i in (1, 2, 3)},
        }
    if name == "sensor":
        return {"strain": strain_history()}
    known = {"known": 1.0 * (k == 120), "known_strain": strain_history() * (k == 120)}
    if name in ("compensator", "filter"):
        return {"resistance": golden("sensor", "ref")["resistance"][1:]} | (known if name == "filter" else {})
    if name == "estimator":
        noise = 0.05 * np.random.default_rng(1).standard_normal(STEPS)
        return {"resistance": golden("sensor", "ref")["resistance"][1:] + noise} | known
    if name == "detector":
        return {f"strain[{i}]": golden("membrane", "ref")[f"strain[{i}]"][1:] for i in (1, 2, 3, 4)}
    rows = [excite(name, step) for step in k.tolist()]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


PARAMETERS = {
    "sensor": {"rest_strain": 0.02},
    "compensator": {"rest_strain": 0.02},
    "estimator": {"rest_strain": 0.02, "noise": 0.05},
    "filter": {"rest_strain": 0.02, "initial_gain_deviation": 0.01, "offset_per_day": 100.0},
    "detector": {"window_length": 96 * H, "repeat": 1.0},
    "framed_membrane": {"mount_position[1]": 0.5, "mount_normal[1]": 0.3, "enclosed_pressure": 1.0},
    "hub": {
        "mass": 6.0,
        "inertia[1]": 0.5,
        "inertia[2]": 0.5,
        "inertia[3]": 0.8,
        "centre_of_mass[3]": -0.1,
        "initial_angular_velocity[3]": 0.2,
    },
}
FOLDERS = {"estimator": "compensator", "filter": "compensator", "framed_membrane": "membrane"}


def place(name, kind):
    return fmu_folder(FOLDERS.get(name, name)) / f"{name}_{kind}.csv"


def read(name, kind):
    return np.genfromtxt(place(name, kind), delimiter=",", names=True, deletechars="")


def write(name, kind, columns):
    lines = [",".join(columns)]
    lines += [",".join(repr(float(value)) for value in row) for row in np.column_stack(list(columns.values()))]
    place(name, kind).write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.parametrize("name", FMUS)
def test_the_fmu_gives_its_golden_outputs(instance, name, rewrite_goldens):
    times = H * np.arange(STEPS + 1)
    if rewrite_goldens:
        write(name, "in", {"time": times[:-1]} | inputs_of(name, read))
        options = f"StartTime, 0.0\nStopTime, {float(times[-1])!r}\nStepSize, {H!r}\nRelTol, 0.0\n"
        place(name, "ref").with_suffix(".opt").write_text(options, encoding="utf-8")
    given = read(name, "in")
    fmu = instance(name)
    fmu.initialize(**PARAMETERS.get(name, {}), **{key: float(given[0][key]) for key in given.dtype.names[1:]})
    outputs = fmu.names("output")
    rows = [fmu.get(*outputs)]
    for row in given:
        for key in given.dtype.names[1:]:
            fmu.set(key, float(row[key]))
        assert fmu.step(H) == 0, fmu.messages
        rows.append(fmu.get(*outputs))
    found = dict(zip(outputs, np.array(rows).T, strict=True))
    if rewrite_goldens:
        write(name, "ref", {"time": times} | found)
    assert_golden(name, found)


def assert_golden(name, found):
    golden = read(name, "ref")
    for output in golden.dtype.names[1:]:
        scale = max(np.abs(golden[output]).max(), 1e-12)
        assert np.abs(found[output] - golden[output]).max() <= TOLERANCE * scale, output


@pytest.mark.parametrize("name", FMUS)
def test_fmpy_reads_the_golden_files_as_they_are(fmus, name):
    options = dict(line.split(", ") for line in place(name, "ref").with_suffix(".opt").read_text().splitlines())
    found = fmpy.simulate_fmu(
        str(fmus[name]),
        start_values=PARAMETERS.get(name, {}),
        input=read(name, "in"),
        output=[output for output in read(name, "ref").dtype.names if output != "time"],
        start_time=float(options["StartTime"]),
        stop_time=float(options["StopTime"]),
        output_interval=float(options["StepSize"]),
    )
    assert_golden(name, found)


def test_the_compensator_gives_the_golden_strain_back():
    """Its golden output is the sensor's golden input, to 1e-9 of full scale."""
    assert read("compensator", "ref")["strain"][1:] == pytest.approx(strain_history(), abs=1e-9 * 0.5)


def test_the_estimator_gives_the_golden_strain_back_as_well_as_it_says():
    """24 samples late, within twice the deviation that it states nine times out of ten."""
    golden = read("estimator", "ref")
    error = np.abs(golden["strain"][25:] - strain_history()[:-24])
    assert np.mean(error < 2.0 * golden["strain_deviation"][25:]) > 0.9
    assert np.sqrt(np.mean(error**2)) < 1e-3


@pytest.mark.parametrize("name", FMUS)
def test_golden_columns_are_variables_of_the_fmu(fmus, name):
    known = {v.name for v in fmpy.read_model_description(str(fmus[name])).modelVariables} | {"time"}
    for kind in ("in", "ref"):
        assert set(read(name, kind).dtype.names) <= known
