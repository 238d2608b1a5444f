"""Laws of the membrane's material, against their energies and closed forms."""

import re
import textwrap
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ParameterError, Stepper
from gossamer_models.membrane import (
    Edge,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from gossamer_models.membrane.law import LAWS, hencky, matrix, neo_hookean, relaxed, st_venant_kirchhoff, torn
from gossamer_models.membrane.setup import LEFT
from gossamer_models.twin import MembraneForward
from hypothesis import given
from hypothesis import strategies as st
from oracles.meshes import meshed, rectangle
from scipy.optimize import minimize_scalar

ROOT = Path(__file__).parents[2]

E, NU = 1e7, 0.33
D = E / (1.0 - NU**2)
strains = st.floats(-0.3, 0.8)
angles = st.floats(0.0, np.pi)


def stress(law, e):
    return np.array(law(np.asarray(e, dtype=object), D, NU), dtype=float)


def strained(e1, e2, angle):
    """Return twice the Green-Lagrange strain with given principal values, and the directions of those."""
    n = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return n @ np.diag([e1, e2]) @ n.T, n


def energy(e):
    """Hencky's energy, from the logarithm of the right Cauchy-Green tensor."""
    h = np.log(np.linalg.eigvalsh(np.eye(2) + e)) / 2.0
    return D / 2.0 * (h @ h + 2.0 * NU * h[0] * h[1])


def rubber(e):
    """Blatz and Ko's energy, the least of all thicknesses."""
    mu, beta = E / (2.0 * (1.0 + NU)), NU / (1.0 - 2.0 * NU)
    C = np.eye(2) + e
    across = minimize_scalar(
        lambda k: k + (np.linalg.det(C) * k) ** -beta / beta, bounds=(0.1, 4.0), method="bounded", options={"xatol": 1e-10}
    )
    return mu / 2.0 * (np.trace(C) - 3.0 + across.fun - 1.0 / beta)


@pytest.mark.parametrize(("law", "energy"), [(hencky, energy), (neo_hookean, rubber)])
@given(e1=strains, e2=strains, angle=angles)
def test_the_stress_of_a_law_is_the_derivative_of_its_energy(law, energy, e1, e2, angle):
    e, _ = strained(e1, e2, angle)
    step = 1e-5 if law is hencky else 1e-4
    change = np.empty((2, 2))
    for a, b in np.ndindex(2, 2):
        de = np.zeros((2, 2))
        de[a, b] += step
        de[b, a] += step
        change[a, b] = (energy(e + de / 2.0) - energy(e - de / 2.0)) / step
    assert stress(law, e) == pytest.approx(change, abs=(1e-7 if law is hencky else 1e-6) * E)


@given(st.floats(0.01, 3.0), angles)
def test_a_strip_that_contracts_freely_carries_the_uniaxial_stress_of_rubber(e1, angle):
    """The lateral stretch is that along to the power of minus nu."""
    square = 1.0 + e1
    e, n = strained(e1, square**-NU - 1.0, angle)
    along = E / (2.0 * (1.0 + NU)) * (1.0 - square ** -(1.0 + NU))
    assert n.T @ stress(neo_hookean, e) @ n == pytest.approx(np.diag([along, 0.0]), abs=1e-9 * E)


@given(st.floats(0.01, 0.8), angles)
def test_a_strip_that_contracts_freely_carries_the_uniaxial_stress_of_henckys_law(e1, angle):
    h = np.log(1.0 + e1) / 2.0
    e, n = strained(e1, np.exp(-2.0 * NU * h) - 1.0, angle)
    assert n.T @ stress(hencky, e) @ n == pytest.approx(np.diag([E * h / (1.0 + e1), 0.0]), abs=1e-9 * E)


@given(st.floats(-0.3, 0.8), st.floats(0.0, 1.0), angles)
def test_a_relaxed_membrane_that_is_taut_is_the_unrelaxed_one_to_the_bit(e1, share, angle):
    e1 = abs(e1) + 0.01
    e, _ = strained(e1, -NU * e1 + 1e-9 + share * (1.0 + NU) * e1, angle)
    assert np.array_equal(stress(relaxed, e), stress(st_venant_kirchhoff, e))


@given(st.floats(0.01, 0.8), st.floats(0.01, 0.3), angles)
def test_a_wrinkled_membrane_is_in_uniaxial_tension_along_its_wrinkles(e1, beyond, angle):
    e, n = strained(e1, -NU * e1 - beyond, angle)
    assert n.T @ stress(relaxed, e) @ n == pytest.approx(np.diag([E * e1 / 2.0, 0.0]), abs=1e-9 * E)


@given(st.floats(-0.4, -0.001), st.floats(-0.4, -0.001), angles)
def test_a_slack_membrane_carries_nothing(e1, e2, angle):
    assert stress(relaxed, strained(e1, e2, angle)[0]) == pytest.approx(np.zeros((2, 2)), abs=1e-9 * E)


@pytest.mark.parametrize("law", [law.stress for law in LAWS.values()])
def test_every_law_is_hookes_at_small_tension(law):
    e, _ = strained(2e-6, 1e-6, 0.3)
    assert stress(law, e) == pytest.approx(stress(st_venant_kirchhoff, e), rel=1e-5)


@pytest.mark.parametrize("law", [law.stress for law in LAWS.values()])
def test_the_tangent_of_every_law_is_that_of_hooke_where_both_principal_strains_are_equal(law):
    e = ca.SX.sym("e", 3)
    S = law(matrix([[e[0], e[2]], [e[2], e[1]]]), D, NU)
    tangent = ca.Function("tangent", [e], [ca.jacobian(ca.vertcat(S[0, 0], S[1, 1], S[0, 1]), e)])
    hooke = D / 2.0 * np.array([[1.0, NU, 0.0], [NU, 1.0, 0.0], [0.0, 0.0, 1.0 - NU]])
    assert np.asarray(tangent([1e-7, 1e-7, 0.0])) == pytest.approx(hooke, abs=1e-6 * D)


def test_the_prestressed_membrane_finds_its_equilibrium_with_every_law_and_softens_by_henckys():
    deflections = {}
    for law in LAWS:
        stepper = Stepper(membrane_model(square_structure(4, 2, law)))
        stepper.set("damage[6]", 0.4)
        stepper.initialize()
        for _ in range(100):
            stepper.step(3e-4)
        deflections[law] = stepper.get("deflection")
    assert deflections["relaxed"] == deflections["st_venant_kirchhoff"]  # taut all the time
    assert deflections["hencky"] > 1.02 * deflections["relaxed"]


def test_an_unknown_law_is_refused_by_name():
    with pytest.raises(ParameterError, match=r"no law .neo-hookean.*hencky"):
        membrane_model(square_structure(4, 2, "neo-hookean"))


@pytest.mark.parametrize(
    ("page", "begin", "end", "quote"),
    [
        ("docs/setup.md", "Law of the material: ", ". |", "`"),
        ("docs/campaigns.md", "Law of the material: ", ". |", "`"),
        ("fmus/membrane/README.md", "`--law` takes, the first by default: ", ".\n  The shipped", "`"),
        ("orchestrator/gossamer/fmus.py", "Law of the membrane's material, the first by default: ", ".\n    setup\n", ""),
    ],
)
def test_pages_and_help_list_the_laws_of_the_registry(page, begin, end, quote, rewrite_goldens):
    """One registry, ``LAWS``: a law is a row there, and 'make goldens' writes the list that stands elsewhere."""
    path = ROOT / page
    text = path.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    indent = " " * (len(before) - len(before.rstrip(" ")))
    listed = ", ".join(f"{quote}{name}{quote} ({law.text})" for name, law in LAWS.items())
    if not before.endswith("| "):  # a row of a table is one line
        filled = textwrap.fill(begin + listed, 122 - len(indent), break_on_hyphens=False)
        listed = filled.replace("\n", f"\n{indent}").removeprefix(begin)
    wanted = before + begin + listed + end + rest.partition(end)[2]
    if rewrite_goldens:
        path.write_text(wanted, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == wanted, "run 'make goldens'"


def test_no_constant_of_the_square_is_left_outside_its_setup():
    """Number, names and places of zones and sensors are those of a structure."""
    words = re.compile(r"\b(N_ZONES|SENSOR_POINTS|N_SENSORS|ZONES_PER_SIDE|GRID_STEPS)\b")
    for folder in ("models", "fmus", "orchestrator"):
        for file in (ROOT / folder).rglob("*.py"):
            found = words.search(file.read_text(encoding="utf-8"))
            assert found is None or file.name == "square.py", f"{file.relative_to(ROOT)}: {found}"


@given(e1=strains, e2=strains, angle=angles, along=st.floats(0.05, 1.0), across=st.floats(0.05, 1.0))
def test_a_tear_in_one_direction_divides_the_strain_that_a_stress_causes_along_itself(e1, e2, angle, along, across):
    e, _ = strained(e1, e2, angle)
    S = np.array(torn(np.asarray(st_venant_kirchhoff(e, D, NU), dtype=object), along, across, NU), dtype=float)
    compliance = np.array([[1.0 / along, -NU], [-NU, 1.0 / across]]) / E
    assert np.diag(e) / 2.0 == pytest.approx(compliance @ np.diag(S), abs=1e-12)
    assert S[0, 1] == S[1, 0] == pytest.approx(stress(st_venant_kirchhoff, e)[0, 1])


def pulled(direction, model=Stepper, **given):
    """Strain along a pull of 20 N/m, and across it, of a flat strip that is free to contract."""
    points = {"left": lambda x, y, z: x == 0.0, "all": lambda x, y, z: x > -1.0, "corner": lambda x, y, z: x + y == 0.0}
    mesh = meshed([rectangle(1.0, 0.5)], 2, points=points, edges={"right": lambda x, y, z: x == 1.0})
    held = (("left", "x"), ("corner", "xy"), ("all", "z"))
    setup = Setup(
        regions=(Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=1e-4, direction=direction),),
        supports=tuple(Support(group=group, fixed=fixed) for group, fixed in held),
        edges=(Edge(group="right", tension=20.0),),
        sensors=tuple(Sensor(point=(0.5, 0.25, 0.0), direction=axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))),
        zones=(Zone(),), directional=True,
    )  # fmt: skip
    structure = make_structure(setup, surface_mesh(mesh, 1))
    if model is MembraneForward:
        return model(structure, given).begin(np.zeros(1), {})[1]
    stepper = Stepper(membrane_model(structure), **given)
    stepper.initialize()
    return np.array([stepper.get("strain[1]"), stepper.get("strain[2]")])


@pytest.mark.parametrize(("direction", "lost", "kept"), [((1.0, 0.0, 0.0), *LEFT), ((0.0, 1.0, 0.0), *LEFT[::-1])])
def test_a_strip_torn_along_its_pull_is_as_soft_as_its_modulus_and_one_torn_across_is_not(direction, lost, kept):
    whole = pulled(direction)
    assert pulled(direction, **{f"{kept}[1]": 0.5}) == pytest.approx(whole, rel=1e-6)
    torn_along = pulled(direction, **{f"{lost}[1]": 0.5})
    assert torn_along[0] == pytest.approx(pulled(direction, **{"youngs_modulus[1]": 5e6})[0], rel=1e-5)
    assert torn_along[1] == pytest.approx(whole[1], rel=0.05)  # what it contracts by is that of the same stress
    assert pulled(direction, MembraneForward, **{f"{lost}[1]": 0.5}) == pytest.approx(torn_along, rel=1e-9)
