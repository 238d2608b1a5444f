"""A spacecraft in Basilisk carries a monitored membrane: slew and thruster shake it, and it shakes the spacecraft.

The membrane, four sensors, four compensators and the detector are one FMU. Basilisk steps it after the spacecraft, and the
force of the membrane acts on the spacecraft in the next step.

    pip install "bsk>=2.12,<3"
    gossamer build --native && gossamer container docs/examples/ex01_sail.toml
    python docs/examples/ex01_basilisk.py out/ex01_sail.fmu
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from Basilisk.simulation import extForceTorque, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros
from gossamer_orchestrator.hosts.basilisk import FramedMembrane
from scipy.spatial.transform import Rotation

STEP = 3e-4  # [s]
STEPS = 844  # two periods of the membrane's load, the detector's window
MASS = 120.0  # [kg]
INERTIA = [90.0, 80.0, 60.0]  # [kg m2]
SLEW = [0.0, 20.0, 0.0]  # [N m], until half of the time, then the opposite
THRUST = [0.0, 0.0, 40.0]  # [N], in the last quarter of the time
XYZ = (1, 2, 3)


@dataclass
class Flight:
    """What happened, one row per step.

    Attributes
    ----------
    damage : list of float
        Estimated damage of the 16 zones [1].
    rate : ndarray, shape (steps, 3)
        Angular velocity of the spacecraft [rad/s], in body axes.
    deflection : ndarray, shape (steps,)
        That of the centre of the membrane [m].
    momentum, angular_momentum : ndarray, shape (steps, 3)
        Of both and what is on its way between them [kg m/s, kg m2/s], in inertial axes, less what thruster
        and slew have given.
    peaks : tuple of float
        Largest momentum [kg m/s] and angular momentum [kg m2/s] of the membrane alone.
    """

    damage: list[float]
    rate: np.ndarray
    deflection: np.ndarray
    momentum: np.ndarray
    angular_momentum: np.ndarray
    peaks: tuple[float, float]


def totals(vehicle: spacecraft.Spacecraft, sail: FramedMembrane) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return momentum and angular momentum of spacecraft and membrane, and those of the membrane alone."""
    state, hub = vehicle.scStateOutMsg.read(), vehicle.hub
    R, w, V, O = (
        Rotation.from_mrp(state.sigma_BN).as_matrix(),
        *map(np.array, (state.omega_BN_B, state.v_BN_N, state.r_BN_N)),
    )
    c = np.ravel(hub.r_BcB_B)
    P = hub.mHub * (V + R @ np.cross(w, c))
    L = R @ np.array(hub.IHubPntBc_B) @ w + np.cross(O + R @ c, P)
    mass, *rest = sail.read(
        "membrane.moving_mass",
        *(f"membrane.{of}[{k}]" for of in ("moving_first_moment", "momentum", "angular_momentum") for k in XYZ),
    )
    S, p, spin = np.reshape(rest, (3, 3)) @ R.T
    own_P, own_L = mass * V + p, np.cross(S, V) + spin
    owed = sail.owed
    L_whole = L + own_L + np.cross(O, own_P) + owed[3:] + np.cross(O, owed[:3])
    return P + own_P + owed[:3], L_whole, np.linalg.norm(own_P), np.linalg.norm(own_L)


def main(path: str) -> Flight:
    """Fly for one window of the detector."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("dynamics")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(STEP)))

    vehicle = spacecraft.Spacecraft()
    vehicle.hub.mHub, vehicle.hub.IHubPntBc_B = MASS, np.diag(INERTIA).tolist()
    thrusters = extForceTorque.ExtForceTorque()
    vehicle.addDynamicEffector(thrusters)
    sail = FramedMembrane(Path(path), vehicle, component="membrane")
    sail.add_to(simulation, "task")
    simulation.InitializeSimulation()

    rows, given = [], np.zeros(6)
    for k in range(STEPS):
        slew = SLEW if k < STEPS // 2 else [-x for x in SLEW]
        thrust = THRUST if k >= 3 * STEPS // 4 else [0.0, 0.0, 0.0]
        thrusters.extTorquePntB_B, thrusters.extForce_B = slew, thrust
        before = vehicle.scStateOutMsg.read()
        simulation.ConfigureStopTime(macros.sec2nano(STEP) * (k + 1))
        simulation.ExecuteSimulation()
        after = vehicle.scStateOutMsg.read()
        R, O = (
            (f(before) + f(after)) / 2.0
            for f in (lambda s: Rotation.from_mrp(s.sigma_BN).as_matrix(), lambda s: np.array(s.r_BN_N))
        )
        given[:3] += STEP * R @ thrust
        given[3:] += STEP * (R @ slew + np.cross(O, R @ thrust))
        P, L, *own = totals(vehicle, sail)
        rows.append([*after.omega_BN_B, *sail.read("membrane.deflection"), *(P - given[:3]), *(L - given[3:]), *own])
    damage = sail.read(*(f"detector.damage[{i}]" for i in range(1, 17))).tolist()
    sail.close()
    table = np.array(rows)
    return Flight(damage, table[:, :3], table[:, 3], table[:, 4:7], table[:, 7:10], tuple(table[:, 10:].max(axis=0)))


if __name__ == "__main__":
    flight = main(sys.argv[1])
    for name, rows, peak in zip(
        ("momentum", "angular momentum"), (flight.momentum, flight.angular_momentum), flight.peaks, strict=True
    ):
        change = np.linalg.norm(rows - rows[0], axis=1).max() / peak
        print(f"{name}: changes by {change:.1e} of the membrane's peak, {peak:.3g}")
    print(f"deflection up to {abs(flight.deflection).max():.3f} m; rates up to {abs(flight.rate).max(axis=0)} rad/s")
    print(f"zone 1: {100 * flight.damage[0]:.2f} % damage; largest elsewhere: {100 * max(flight.damage[1:]):.2f} %")
