"""A spacecraft in Basilisk carries the membrane, and its motion shakes the chain: one FMU, made by ``gossamer container``.

Symbols, all in body axes: ``B`` origin of the body frame, ``r`` from B to the membrane [m], ``n`` the membrane's normal,
``w`` angular velocity [1/s]. The frame of the membrane accelerates along its normal by

    base_acceleration = n . (a_B + w' x r + w x (w x r))

with ``a_B`` the acceleration of B by forces other than gravity, which pulls at frame and membrane alike.

    pip install bsk fmpy
    gossamer build --native && gossamer container damaged
    python docs/examples/ex01_basilisk.py out/damaged.fmu
"""

import sys

import fmpy
import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import extForceTorque, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros
from fmpy import fmi2

STEP = 3e-4  # [s]
STEPS = 844  # two periods of the membrane's load, the detector's window
MASS = 120.0  # [kg]
INERTIA = [90.0, 0.0, 0.0, 0.0, 80.0, 0.0, 0.0, 0.0, 60.0]  # [kg m2]
THRUST = [0.0, 0.0, 1.0]  # [N]
MOMENT = [0.0, 0.2, 0.0]  # [N m]
PLACE = np.array([1.5, 0.0, 0.0])  # r [m]
NORMAL = np.array([0.0, 0.0, 1.0])  # n


class Monitoring(sysModel.SysModel):
    """Step the monitoring chain with the motion of the spacecraft.

    Parameters
    ----------
    path : str
        The container FMU.
    """

    def __init__(self, path: str) -> None:
        super().__init__()
        self.ModelTag = "monitoring"
        self.states = messaging.SCStatesMsgReader()
        description = fmpy.read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="monitoring",
        )
        self.fmu.instantiate()
        self.accelerations: list[float] = []

    def Reset(self, nanoseconds: int) -> None:
        """Initialize the FMU."""
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.start = nanoseconds

    def UpdateState(self, nanoseconds: int) -> None:
        """Step the FMU to the present time; Basilisk calls it every ``STEP``, the first time at the start."""
        if nanoseconds == self.start:
            return
        state = self.states()
        w, w_dot = np.array(state.omega_BN_B), np.array(state.omegaDot_BN_B)
        a_B = np.array(state.nonConservativeAccelpntB_B)
        a = NORMAL @ (a_B + np.cross(w_dot, PLACE) + np.cross(w, np.cross(w, PLACE)))
        self.accelerations.append(float(a))
        self.fmu.setReal([self.references["membrane.base_acceleration"]], [a])
        self.fmu.doStep((nanoseconds - self.start) * macros.NANO2SEC - STEP, STEP)

    def damage(self) -> list[float]:
        """Return the estimated damage of the 16 zones [1]."""
        return self.fmu.getReal([self.references[f"detector.damage[{i}]"] for i in range(1, 17)])


def main(path: str) -> tuple[list[float], list[float]]:
    """Fly for one window of the detector; return the damage it sees and the accelerations it felt."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("dynamics")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(STEP)))

    vehicle = spacecraft.Spacecraft()
    vehicle.hub.mHub, vehicle.hub.IHubPntBc_B = MASS, np.reshape(INERTIA, (3, 3)).tolist()
    thruster = extForceTorque.ExtForceTorque()
    thruster.extForce_B, thruster.extTorquePntB_B = THRUST, MOMENT
    vehicle.addDynamicEffector(thruster)
    monitoring = Monitoring(path)
    monitoring.states.subscribeTo(vehicle.scStateOutMsg)
    for model in (vehicle, thruster, monitoring):  # in this order at every step
        simulation.AddModelToTask("task", model)

    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(STEP) * STEPS)
    simulation.ExecuteSimulation()
    return monitoring.damage(), monitoring.accelerations


if __name__ == "__main__":
    damage, accelerations = main(sys.argv[1])
    print(f"{len(accelerations)} steps, base acceleration {accelerations[-1]:.4g} m/s2")
    print(f"zone 1: {100 * damage[0]:.2f} % damage; largest elsewhere: {100 * max(damage[1:]):.2f} %")
