"""``gossamer build membrane --setup``: mistakes with their lines, shipped membranes, every key documented."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gossamer.descriptions import load_structure
from gossamer_models import Stepper
from gossamer_models.membrane import (
    Beam,
    Cable,
    Edge,
    Fault,
    Gas,
    Load,
    Paraboloid,
    PointMass,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    membrane_model,
    read_mesh,
)
from gossamer_models.membrane.setup import Built, KnownNumbers
from gossamer_orchestrator.errors import ScenarioError
from gossamer_orchestrator.scenario.source import shipped_scenarios

meshio = pytest.importorskip("meshio", reason="reading mesh files needs the extra 'mesh'")

DOCS = Path(__file__).parents[3] / "docs" / "setup.md"
RIGHT = """mesh = "square.msh"

[[regions]]
youngs_modulus = 1e7
poisson_ratio = 0.33
density = 1100.0
thickness = 1e-3

[[zones]]
group = "film"

[[supports]]
group = "rim"

[[sensors]]
point = [0.5, 0.25, 0.0]
direction = [0.0, 1.0, 0.0]
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with the mesh of a square, 2 x 2, in gmsh's format."""
    points = np.array([[x, y, 0.0] for y in (0.0, 0.5, 1.0) for x in (0.0, 0.5, 1.0)])
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    lines = np.array([[0, 1], [1, 2], [2, 5], [5, 8], [8, 7], [7, 6], [6, 3], [3, 0]])
    tags = [np.full(4, 1), np.full(8, 1)]  # the same number of another dimension
    meshio.Mesh(
        points,
        [("quad", quads), ("line", lines)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"film": np.array([1, 2]), "rim": np.array([1, 1])},
    ).write(tmp_path / "square.msh", file_format="gmsh22")
    return tmp_path


def load(folder, text):
    path = folder / "s.toml"
    path.write_text(text)
    return load_structure(path)


def test_a_setup_and_its_mesh_are_read(folder):
    structure = load(folder, RIGHT)
    assert structure.mesh.n_faces == 4
    assert structure.free.reshape(-1, 3)[:, 0].sum() == 1
    assert structure.zone.tolist() == [0]


MISTAKES = {
    "key": ("thickness", "thicknes", r"s.toml:3: .*thickness.* missing|s.toml:7: .*Did you mean 'thickness'"),
    "region": ("[[regions]]", "[[region]]", "region"),
    "number": ("thickness = 1e-3", "thickness = 5.0", r"s.toml:7: .*'thickness' is 5. Write a number from 1e-07 to 1"),
    "prior": ("thickness = 1e-3", "thickness = { value = 1e-3, deviation = 0.05 }", r"s.toml:7: .*value alone.*'priors'"),
    "list": ("direction = [0.0, 1.0, 0.0]", "direction = 1.0", r"s.toml:17: .*a list in brackets, for instance \[1, 2, 3\]"),
    "text": ("density = 1100.0", 'density = "heavy"', "s.toml:6: "),
    "zone": ('group = "film"', 'group = "fim"', r"s.toml:10: .*no group 'fim' of faces. Did you mean 'film'"),
    "support": ('group = "rim"', 'group = "rum"', r"s.toml:13: .*no group 'rum' of nodes. Did you mean 'rim'"),
    "loose": ('group = "rim"', 'group = "rim"\nfixed = "xy"', r"s.toml:12: .*free to move (along|about)"),
    "sensor": ("point = [0.5, 0.25, 0.0]", "point = [1.5, 0.25, 0.0]", r"s.toml:16: sensor 1 .* by 0.5 m"),
    "vector": ("point = [0.5, 0.25, 0.0]", "point = [0.5, 0.25]", r"s.toml:16: .*three numbers"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_with_its_line(folder, name):
    old, new, text = MISTAKES[name]
    assert old in RIGHT
    with pytest.raises(ScenarioError, match=text):
        load(folder, RIGHT.replace(old, new, 1))


RIGGED = """
[[cables]]
name = "rope"
path = [[0.5, 0.5, 0.0], [0.5, 0.5, 1.0]]
youngs_modulus = 1e9
area = 1e-6
density = 1500.0
tension = 5.0

[[masses]]
group = "rope_end"
mass = 0.1
"""


def test_a_cable_and_a_mass_are_read_and_their_mistakes_are_named_with_their_lines(folder):
    held = RIGHT.replace('group = "rim"', 'group = "rim"\n\n[[supports]]\ngroup = "rope_end"')
    structure = load(folder, held + RIGGED)
    assert structure.mass.sum() == pytest.approx(1.1 + 0.1 + 1500.0 * 1e-6 / (1.0 + 5.0 / 1e3))
    for old, new, text in (
        ("tension = 5.0", "tension = -5.0", r"s.toml:28: 'tension' is -5 N, and a cable carries tension alone"),
        ('name = "rope"', 'name = "rim"', r"s.toml:\d+: .*has a group 'rim', and the line 'rim' makes one of that name"),
        ("[0.5, 0.5, 0.0]", '"tip"', r"s.toml:24: .*no group 'tip' of nodes"),
        ('"rope_end"\nmass', '"rope_ent"\nmass', r"s.toml:31: .*no group 'rope_ent' of nodes. Did you mean 'rope_end'"),
    ):
        with pytest.raises(ScenarioError, match=text):
            load(folder, held + RIGGED.replace(old, new))


def test_numbers_in_a_wrong_unit_are_warned_of_with_their_line(folder, caplog):
    load(folder, RIGHT)
    assert caplog.messages == []
    load(folder, RIGHT.replace("1e7", "3.0").replace("1100.0", "0.5").replace("1e-3", "0.2"))
    assert caplog.messages == [
        "s.toml:4: 'youngs_modulus' is 3 Pa; that of a membrane is 1000 to 1e+13 Pa. Is it in another unit?",
        "s.toml:6: 'density' is 0.5 kg/m3; that of a membrane is 1 to 30000 kg/m3. Is it in another unit?",
        "s.toml:7: 'thickness' is 0.2 m; that of a membrane is 1e-08 to 0.1 m. Is it in another unit?",
    ]


def test_all_mistakes_on_the_mesh_are_named_at_once(folder):
    text = RIGHT.replace('"film"', '"fim"').replace('"rim"', '"rum"')
    with pytest.raises(ScenarioError) as refused:
        load(folder, text)
    assert str(refused.value).count("has no group") == 2


def test_the_command_builds_a_shipped_membrane_and_refuses_an_unknown_one(tmp_path):
    def call(*arguments):
        return invoke([str(a) for a in arguments])

    result = call("build", "membrane", "--setup", "reflector", "--out", tmp_path)
    assert (result.exit_code, result.stdout) == (0, f"{tmp_path / 'membrane.fmu'}\n"), result.stderr
    assert "in place of" not in result.stderr
    square = call("build", "membrane", "--out", tmp_path)
    assert "membrane.fmu is now 'Square membrane" in square.stderr
    assert "in place of 'Inflated parabolic reflector" in square.stderr
    assert "in place of" not in call("build", "membrane", "--out", tmp_path).stderr
    result = call("build", "membrane", "--setup", "reflecter", "--out", tmp_path)
    assert result.exit_code == 1
    assert "Did you mean 'reflector'" in result.stderr
    result = call("build", "membrane", "--mesh", "a.msh", "--out", tmp_path)
    assert result.exit_code == 1
    assert "needs a setup" in result.stderr


@pytest.mark.parametrize("name", ["drum", "reflector", "sail", "tube"])
def test_every_shipped_membrane_starts_in_equilibrium_and_stays_there(name):
    path = shipped_scenarios("membrane")[name]
    assert path.with_suffix(".msh").stat().st_size < 100_000
    model = Stepper(membrane_model(load_structure(path)))
    model.warn = lambda text: None
    model.set("pressure_amplitude", 0.0)
    model.initialize()
    before = model.get("strain[1]")
    for _ in range(3):
        model.step(1e-3)
    assert model.get("strain[1]") == pytest.approx(before, rel=1e-6)
    assert 1e-4 < model.get("largest_strain") < 0.05


def test_all_membranes_ship():
    assert sorted(shipped_scenarios("membrane")) == ["drum", "reflector", "sail", "tube"]


def test_every_key_is_documented_with_its_default():
    page = DOCS.read_text()
    rows = re.findall(r"^\| (`[a-z_`, ]+`) \| (.*?) \|", page, re.MULTILINE)
    known = {key: default for keys, default in rows for key in re.findall(r"`([a-z_]+)`", keys)}
    tables = {"regions": Region, "zones": Zone, "supports": Support, "edges": Edge, "loads": Load, "sensors": Sensor}
    tables |= {"faults": Fault, "surfaces": Paraboloid, "cables": Cable, "beams": Beam, "masses": PointMass}
    single = {"gas": Gas, "calibration": KnownNumbers, "built": Built}
    for name, table in {**tables, **single}.items():
        assert f"`[[{name}]]`" in page or f"`[{name}]`" in page
        assert [field.name for field in fields(table) if field.name not in known] == []
    top = [field for field in fields(Setup) if field.name not in {*tables, *single}]
    assert [field.name for field in top if field.name not in known] == []
    for field in [*top, *fields(Support), *fields(Sensor), *fields(Gas), *fields(Fault), *fields(Paraboloid)]:
        if isinstance(field.default, bool) or field.default is MISSING or field.default in ("", (), None):
            continue
        shown = known[field.name].strip('`"')
        if isinstance(field.default, tuple):
            assert shown == str([int(x) for x in field.default])
        elif isinstance(field.default, str):
            assert shown == field.default
        else:
            assert float(shown) == field.default


def test_the_script_of_the_meshes_makes_all_that_ship(tmp_path):
    """Other versions of gmsh make other elements, of the same groups and extent."""
    try:
        import gmsh  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"gmsh and its X libraries are needed: {error}")
    spec = importlib.util.spec_from_file_location("make_meshes", DOCS.parent / "examples" / "make_meshes.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for shape in (script.sail, script.drum, script.reflector, script.tube):
        made = read_mesh(script.make(shape, tmp_path))
        ships = read_mesh(shipped_scenarios("membrane")[shape.__name__].with_suffix(".msh"))
        assert (set(made.faces), set(made.edges)) == (set(ships.faces), set(ships.edges))
        assert np.ptp(made.nodes, axis=0) == pytest.approx(np.ptp(ships.nodes, axis=0), abs=1e-6)
