"""The membrane against exact numbers and three other programs."""

from pathlib import Path

import numpy as np
import pytest
from gossamer_models import ConvergenceError, ParameterError
from gossamer_models.membrane import MembraneParams
from gossamer_models.membrane.square import SENSORS, stretch
from oracles.membrane import equations as equations_of
from oracles.modal import natural_frequencies
from oracles.statics import integrate_implicit, static_deflection
from oracles.strain_measures import deformation_gradients, green_lagrange_strain, logarithmic_strain, nominal_strain

REFERENCE = Path(__file__).parents[2].parent / "shared" / "reference" / "membrane"
UNDAMPED = MembraneParams(mass_damping=0.0)
POINTS = dict(zip(("x200_y200", "x400_y200", "x200_y400", "x400_y400"), SENSORS, strict=True))
ZONE_1 = np.array([0.4] + 15 * [0.0])


@pytest.fixture(scope="module")
def equations():
    return {n: equations_of(n) for n in (8, 16, 32)}


def centre(equations):
    return 3 * equations.mesh.centre + 2


def errors(equations, name, damage, steps, **method):
    """Relative L2 errors of deflection and of both strain columns at four points."""
    path = REFERENCE / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"no reference history {path.name}: the shared reference folder is absent")
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
    data = dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1, max_rows=steps + 1).T, strict=True))
    history = integrate_implicit(equations, UNDAMPED, steps, h=3e-4, damage=damage, **method)
    np.testing.assert_allclose(data["t_s"], history.time, atol=1e-9)
    computed = {"w_center_m": history.q[:, centre(equations)]}
    for label, point in POINTS.items():
        F = deformation_gradients(equations, history.q, point)
        computed[f"eyy_green_lagrange_{label}"] = green_lagrange_strain(F)
        computed[f"eyy_log_{label}"] = logarithmic_strain(F)
    return {key: np.linalg.norm(v - data[key]) / np.linalg.norm(data[key]) for key, v in computed.items()}


@pytest.mark.parametrize(("case", "damage"), [("undamaged", 0.0), ("zone1_40", ZONE_1)])
def test_newmark_histories_are_those_of_kratos(equations, case, damage):
    """Measured 1.4e-9 or less over 0.3 s."""
    found = errors(equations[8], f"kratos_8x8_newmark_lumped_{case}", damage, 1000)
    assert len(found) == 9
    assert max(found.values()) < 1e-6, found


@pytest.mark.parametrize(("case", "damage"), [("undamaged", 0.0), ("zone1_40", ZONE_1)])
def test_hht_histories_are_close_to_those_of_calculix(equations, case, damage):
    """Measured 1.5e-3 or less over 0.1 s; what is left is the other program's."""
    name = f"calculix_8x8_hht_consistent_{case}"
    found = errors(equations[8], name, damage, 333, alpha=-0.05, mass="consistent")
    assert len(found) == 9
    assert max(found.values()) < 5e-3, found


def test_the_first_frequency_converges_to_the_exact_one_with_second_order(equations):
    """A stretched membrane: f = sqrt(2)/(2 L) sqrt(S/rho), S = E/(1-nu) (lambda^2-1)/2, in reference lengths."""
    S = 1e7 / (1.0 - 0.33) * (stretch(UNDAMPED) ** 2 - 1.0) / 2.0
    exact = np.sqrt(2.0) / (2.0 * 0.588) * np.sqrt(S / 1100.0)
    assert exact == pytest.approx(20.113, abs=5e-4)
    lumped, consistent = (
        [natural_frequencies(e, UNDAMPED, count=1, mass=mass)[0] for e in equations.values()]
        for mass in ("lumped", "consistent")
    )
    assert lumped[0] == pytest.approx(19.729, abs=5e-4)
    assert consistent[0] == pytest.approx(20.243, abs=5e-4)
    for found in (lumped, consistent):
        error = np.abs(np.array(found) - exact)
        rates = np.log2(error[:-1] / error[1:])
        assert rates == pytest.approx(2.0, abs=0.05)


def test_a_slack_membrane_has_frequencies_of_zero():
    slack = MembraneParams(edge_displacement=0.0)
    lowest = natural_frequencies(equations_of(4), slack, count=3)
    np.testing.assert_allclose(lowest, 0.0, atol=1e-2)
    with pytest.raises(ParameterError, match="count is 99"):
        natural_frequencies(equations_of(4), slack, count=99)


@pytest.mark.parametrize(("pressure", "deflection"), [(1e3, 0.050053), (1e4, 0.139506)])
def test_the_static_deflection_converges_to_that_of_another_program(equations, pressure, deflection):
    """The reference is a 64 x 64 mesh; second-order convergence takes 8, 16, 32 there."""
    w = [static_deflection(e, UNDAMPED, pressure)[centre(e)] for e in equations.values()]
    assert np.log2((w[0] - w[1]) / (w[1] - w[2])) == pytest.approx(2.0, abs=0.1)
    assert w[2] - (w[1] - w[2]) / 4.0 == pytest.approx(deflection, abs=1.5e-6)


def test_strain_measures_are_those_of_a_stretched_and_turned_line():
    """For a stretch along y the three measures are functions of it, whatever the rotation."""
    stretch = np.array([0.8, 1.0, 1.3])
    F = np.zeros((3, 3, 2))
    F[:, 0, 0] = 1.1
    F[:, 1, 1], F[:, 2, 1] = 0.6 * stretch, 0.8 * stretch
    np.testing.assert_allclose(nominal_strain(F), stretch - 1.0, atol=1e-15)
    np.testing.assert_allclose(green_lagrange_strain(F), (stretch**2 - 1.0) / 2.0, atol=1e-15)
    np.testing.assert_allclose(logarithmic_strain(F), np.log(stretch), atol=1e-15)


def test_a_static_problem_without_a_solution_nearby_says_so(equations):
    params = MembraneParams(edge_displacement=0.0)
    with pytest.raises(ConvergenceError, match="Raise the prestress"):
        static_deflection(equations[8], params, pressure=1e9, load_steps=1)


@pytest.mark.parametrize("wrong", [{"alpha": 0.1}, {"h": 0.0}, {"steps": 0}, {"alpha": float("nan")}])
def test_an_implicit_method_that_has_no_meaning_is_refused(equations, wrong):
    with pytest.raises(ParameterError, match="alpha"):
        integrate_implicit(equations[8], UNDAMPED, **{"steps": 1, **wrong})
