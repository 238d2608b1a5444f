"""Reduced membranes: exact at rest and over a step, near the full membrane in motion, refused where they are none."""

import numpy as np
import pytest
from flight import get, put
from gossamer_models import ParameterError, Stepper
from gossamer_models.hub import hub_model
from gossamer_models.membrane import (
    Equilibrium,
    Linearised,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    reaches,
    reduce_membrane,
    reduced_model,
    square_structure,
    surface_mesh,
)
from oracles.meshes import meshed, rectangle, rim
from scipy.linalg import expm

FILM = {"youngs_modulus": 1e7, "poisson_ratio": 0.3, "density": 1000.0, "thickness": 1e-3}
GAUGES = (Sensor(point=(0.3, 0.4, 0.0), direction=(1.0, 0.0, 0.0)), Sensor(point=(0.5, 0.5, 0.0), direction=(0.0, 1.0, 0.0)))


RIM = (Support(group="rim"),)


def sheet(supports=RIM):
    setup = Setup(
        regions=(Region(**FILM, prestress=(1e5, 1e5, 0.0)),), supports=supports, zones=(Zone(parts=3),), sensors=GAUGES
    )
    return make_structure(setup, surface_mesh(meshed([rectangle(1.0, 1.0)], 6, points=rim(1.0)), 1))


@pytest.fixture(scope="module")
def bulged():
    """A sheet that pressure has bulged, reduced to three modes."""
    return reduce_membrane(Linearised(sheet(), {"pressure": 60.0}).modes(3), [25])


@pytest.fixture(scope="module")
def square():
    return reduce_membrane(Linearised(square_structure()).modes(20))


def outputs(stepper, reduced):
    return np.array([stepper.get(v.name) for v in reduced.outputs[: reduced.n_y]])


def test_three_modes_are_exact_at_rest_to_first_order_in_every_input(bulged):
    structure = sheet()
    equilibrium = Equilibrium(structure, membrane_model(structure))
    names = ["pressure", "base_acceleration", "damage"]
    wanted = equilibrium.derivatives(equilibrium.solve({"pressure": 60.0}), names)
    matrices = bulged.matrices()
    static = matrices["D"] - matrices["C"] @ np.linalg.solve(matrices["A"], matrices["B"])
    inputs = [v.name for v in bulged.inputs]
    columns = [0, *(inputs.index(f"{name}[{k}]") for name in ("frame_acceleration", "damage") for k in (1, 2, 3))]
    np.testing.assert_allclose(static[:2, columns], wanted.strain[0].T, rtol=2e-5, atol=1e-12)
    np.testing.assert_allclose(static[2:5, columns], wanted.displacement[0, :, 24].T, rtol=2e-5, atol=1e-12)


def test_force_at_rest_is_the_load_and_the_weight_of_what_moves(bulged):
    matrices, inputs = bulged.matrices(), [v.name for v in bulged.inputs]
    static = (matrices["D"] - matrices["C"] @ np.linalg.solve(matrices["A"], matrices["B"]))[-6:]
    assert static[2, 0] == pytest.approx(1.0, rel=2e-3)  # 1 Pa on 1 m2, all of it upward but at the bulged rim
    k = inputs.index("frame_acceleration[1]")
    np.testing.assert_allclose(static[:3, k], -bulged.modes.moving[:3, 0], atol=2e-3)


@pytest.mark.parametrize("damping", [0.0, 3.0, 60.0, 400.0])
def test_a_step_of_any_length_is_the_exponential_of_the_matrix(bulged, damping):
    """From none to far beyond critical."""
    model = Stepper(reduced_model(bulged), mass_damping=damping)
    model.initialize()
    A, B, C, D = (bulged.matrices()[name] for name in "ABCD")
    A = A.copy()
    A[3:, 3:] = -damping * np.eye(3)
    u, x = np.zeros(B.shape[1]), np.zeros(6)
    for h, pressure in ((1e-3, 60.3), (0.05, 59.9), (2.0, 60.1), (1e-4, 60.1)):
        model.set("pressure", pressure)
        model.step(h)
        u[0] = pressure - 60.0
        F = expm(h * np.block([[A, (B @ u)[:, None]], [np.zeros((1, 7))]]))
        x = F[:6, :6] @ x + F[:6, 6]
        y = bulged.start + np.append(C[:-6] @ x + D[:-6] @ u, np.zeros(12))
        np.testing.assert_allclose(outputs(model, bulged)[2:], y[2 : bulged.n_y], rtol=1e-9, atol=1e-13)


def test_the_strain_of_a_flat_film_is_that_of_the_full_membrane(square):
    """Across its plane it strains in second order only, which no linear model has."""
    full, reduced = Stepper(membrane_model(square_structure()), pressure_amplitude=0.0), Stepper(reduced_model(square))
    for each in (full, reduced):
        each.initialize()
    seen = []
    for k in range(200):
        for each in (full, reduced):
            each.set("pressure", 10.0 * np.sin(25.0 * (k + 1) * 1e-3) ** 2)
            each.step(1e-3)
        seen.append([[each.get(name) for name in ("strain[1]", "deflection")] for each in (full, reduced)])
    strain, deflection = np.moveaxis(np.array(seen), 2, 0)
    assert np.abs(strain[:, 1] - strain[:, 0]).max() < 0.01 * np.ptp(strain[:, 0])
    assert np.abs(deflection[:, 1] - deflection[:, 0]).max() < 0.01 * np.ptp(deflection[:, 0])


def test_damage_softens_modes_as_it_does_those_of_the_membrane(bulged):
    found = bulged.modes.sensitivities()
    diagonal = np.diagonal(bulged.softening, axis1=1, axis2=2).T
    alone = ~np.isnan(found.strain[:, 0, 0])
    np.testing.assert_allclose(
        (diagonal / (2.0 * bulged.modes.squares[:, None]))[alone], found.frequency[alone], rtol=1e-6, atol=1e-9
    )


def slewed(membrane, steps=400, h=1e-3):
    """Turn a hub about y with a membrane on it, whose force arrives a step late; return its rate and attitude."""
    hub = Stepper(hub_model(), mass=10.0)
    for k, value in enumerate((0.4, 0.4, 0.5), 1):
        hub.set(f"inertia[{k}]", value)
    put(membrane, "mount_position", [0.3, 0.1, 0.2])
    membrane.initialize()
    for name, size in (("mass", 0), ("first_moment", 3), ("inertia", 6)):
        for k in range(1, size + 1) if size else ("",):
            at = f"[{k}]" if size else ""
            hub.set(f"attached_{name}{at}", membrane.get(f"held_{name}{at}"))
    hub.initialize()
    seen = []
    for k in range(steps):
        hub.set("wheel_torque[2]", -0.02 if k < steps / 2 else 0.02)
        for name in ("force", "torque"):
            put(hub, name, get(membrane, name))
        hub.step(h)
        put(membrane, "frame_acceleration", get(hub, "acceleration"))
        for name in ("angular_velocity", "angular_acceleration"):
            put(membrane, name, get(hub, name))
        membrane.step(h)
        seen.append(np.append(get(hub, "angular_velocity"), get(hub, "attitude", 4)))
    return np.array(seen)


def test_a_small_slew_of_a_hub_is_that_with_the_full_membrane(square):
    quiet = {"pressure_amplitude": 0.0, "mass_damping": 2.0}
    full = slewed(Stepper(membrane_model(square_structure(), frame=True), **quiet))
    reduced = slewed(Stepper(reduced_model(square, frame=True), mass_damping=2.0))
    assert np.abs(full[:, 1]).max() > 1e-3
    for part in (slice(0, 3), slice(4, 7)):
        assert np.abs(reduced[:, part] - full[:, part]).max() < 0.01 * np.abs(full[:, part]).max()


def test_the_full_membrane_is_off_by_5_percent_where_it_is_said(square):
    load = next(each for each in reaches(square) if each.load.name == "pressure")
    structure = square_structure()
    equilibrium = Equilibrium(structure, membrane_model(structure))
    unit = equilibrium.solve({"pressure": 1e-3}).displacement[0, :, 2]
    for (pressure, size), flat in ((load.displacement, 1.0), (load.strain, 2.0)):
        found = equilibrium.solve({"pressure": pressure})
        if flat == 1.0:
            w = found.displacement[0, :, 2]
            assert np.abs(w - unit * pressure / 1e-3).max() == pytest.approx(0.05 * np.abs(w).max(), rel=0.05)
            assert np.abs(w).max() == pytest.approx(size, rel=0.02)
        else:
            assert np.abs(found.strain[0] - square.start[:4]).max() == pytest.approx(size, rel=0.05)


def test_what_cannot_be_reduced_is_refused_by_name():
    modes = Linearised(sheet()).modes(3)
    with pytest.raises(ParameterError, match="node 50 is none of the mesh, which has 1 to 49"):
        reduce_membrane(modes, [3, 50])
    afloat = sheet((Support(group="rim", fixed="z"), Support(group="rim", stiffness=100.0, fixed="xy")))
    with pytest.raises(ParameterError, match="the frame is held by nothing"):
        reduce_membrane(Linearised(afloat).modes(3))
    sagged = Linearised(sheet(), {"base_acceleration[3]": 9.81}).modes(3)
    with pytest.raises(ParameterError, match="frame that is not accelerated"):
        reduce_membrane(sagged)
