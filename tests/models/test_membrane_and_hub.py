"""A free hub carries the membrane: momentum, angular momentum and energy of both, by the scheme that couples them."""

import numpy as np
import pytest
from flight import get, matrix, put
from gossamer_models import Stepper
from gossamer_models.hub import hub_model
from gossamer_models.membrane import MembraneParams, membrane_model, square_structure
from oracles.membrane import energy_function, equations

H = 3e-4
RELEASE = 0.02  # [s], until then gas of 1 kPa is between hub and membrane


def reaction(membrane):
    return np.concatenate([get(membrane, "force"), get(membrane, "torque")])


def fly(mass, inertia, seconds, *, extrapolation, order=1, place=(0.5, 0.1, 0.2), normal=(0.3, 0.0, 1.0), h=H):
    """Let go of the membrane on a free hub; returns totals, one row per step, and the membrane's own peaks."""
    membrane = Stepper(
        membrane_model(square_structure(4, order), frame=True),
        mass_damping=0.0,
        pressure_amplitude=0.0,
        enclosed_pressure=1.0,
    )
    hub = Stepper(hub_model(), mass=mass, extrapolation=extrapolation)
    put(membrane, "mount_position", place)
    put(membrane, "mount_normal", normal)
    put(hub, "inertia", (*inertia, 0.0, 0.0, 0.0))
    membrane.initialize()
    hub.set("attached_mass", membrane.get("held_mass"))
    put(hub, "attached_first_moment", get(membrane, "held_first_moment"))
    put(hub, "attached_inertia", get(membrane, "held_inertia", 6))
    hub.initialize()
    params, mesh = MembraneParams(), equations(4, order)
    strain_energy, node_mass = energy_function(mesh.mesh, params), mesh.node_mass(params)
    rows = []
    for k in range(round(seconds / h)):
        membrane.set("pressure", 1000.0 if k * h < RELEASE else 0.0)
        last = reaction(membrane)
        put(hub, "force", last[:3])
        put(hub, "torque", last[3:])
        hub.step(h)
        for name, of in (("frame_acceleration", "acceleration"), ("angular_velocity",) * 2, ("angular_acceleration",) * 2):
            put(membrane, name, get(hub, of))
        membrane.step(h)
        R, O, V = matrix(get(hub, "attitude", 4)), get(hub, "position"), get(hub, "velocity")
        p, S, m = R @ get(membrane, "momentum"), R @ get(membrane, "moving_first_moment"), membrane.get("moving_mass")
        P, own = m * V + p, np.cross(S, V) + R @ get(membrane, "angular_momentum")
        owed = h * (reaction(membrane) - extrapolation * last)
        j, k_ = R @ owed[:3], R @ owed[3:]
        q, s = membrane.x[: mesh.n_q], membrane.x[mesh.n_q : 2 * mesh.n_q]
        energy = strain_energy(q) + node_mass @ s**2 / 2.0 + m * V @ V / 2.0 + V @ p + hub.get("kinetic_energy")
        L = get(hub, "angular_momentum") + own + np.cross(O, P) + k_ + np.cross(O, j)
        rows.append([*(get(hub, "momentum") + P + j), *L, energy, np.linalg.norm(P), np.linalg.norm(own)])
    rows, released = np.array(rows), round(RELEASE / h) + 2
    peak_P, peak_L = rows[:, 7:].max(axis=0)
    change = [np.linalg.norm(rows[:, i : i + 3] - rows[0, i : i + 3], axis=1).max() for i in (0, 3)]
    energy = rows[released:, 6] - strain_energy(np.zeros(mesh.n_q))
    return change[0] / peak_P, change[1] / peak_L, energy / energy[0]


@pytest.mark.parametrize(("mass", "inertia"), [(120.0, (90.0, 80.0, 60.0)), (6.0, (0.5, 0.5, 0.8))])
def test_momentum_and_energy_are_kept_at_a_heavy_and_at_a_light_hub(mass, inertia):
    """Asked: momentum and angular momentum to 1e-4 of the membrane's peak, energy within 1 %, 1 s of 3e-4 s."""
    dP, dL, energy = fly(mass, inertia, 1.0, extrapolation=1.0)
    assert dP < 1e-4
    assert dL < 1e-4
    assert np.abs(energy - 1.0).max() < 0.01


def test_without_extrapolation_a_light_hub_gains_energy():
    """What the extrapolation is for: 2.2 times the energy after 1 s was measured, at another place of the membrane."""
    *_, energy = fly(6.0, (0.5, 0.5, 0.8), 0.3, extrapolation=0.0)
    assert energy[-1] > 1.3


def test_elements_of_order_4_gain_more_energy_at_a_light_hub_and_an_eighth_with_half_the_step():
    """On a lever of 0.5 m, where the hub moves like 3.9 of the membrane's mass, which runs warn of; 1.0129 and 1.0015."""
    at = {"place": (0.5, 0.0, 0.0), "normal": (0.0, 0.0, 1.0), "order": 4, "extrapolation": 1.0}
    whole, half = (fly(6.0, (0.5, 0.5, 0.8), 1.0, h=h, **at)[2][-1] - 1.0 for h in (H, H / 2.0))
    assert whole == pytest.approx(0.0129, rel=0.1)
    assert whole / half == pytest.approx(8.0, rel=0.25)
