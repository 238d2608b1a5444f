"""A membrane on a frame as a module of Basilisk: the spacecraft shakes it and feels it.

Needs Basilisk, ``pip install bsk``. Symbols, in body axes: ``a`` acceleration of the body's origin by
all forces but gravity [m/s2], ``w`` angular velocity [rad/s], ``w_dot`` angular acceleration [rad/s2]; ``W`` force [N]
and torque [N m] of the membrane; ``h`` step [s].
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import extForceTorque, linearSpringMassDamper
from Basilisk.utilities import macros
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..errors import FmuError, SimulationError
from ..fmi.clocks import start_instance
from ..fmi.file import FmuFile
from ..mounts import HELD, MOVING, of_point, too_light, with_edge
from .debt import Array, Debt, turn

logger = logging.getLogger(__name__)

_MOTION = [f"{name}[{k}]" for name in ("frame_acceleration", "angular_velocity", "angular_acceleration") for k in (1, 2, 3)]
_REACTION = [f"{name}[{k}]" for name in ("force", "torque") for k in (1, 2, 3)]
IDENTITY = np.eye(3)
_LONGEST = 1e9  # [s], end of the run that the FMU is given: Basilisk decides when it ends


def add_reduced(path: Path, vehicle: Any, place: ArrayLike = (0.0, 0.0, 0.0), axes: ArrayLike = IDENTITY) -> list[Any]:  # noqa: ANN401
    """Put a reduced membrane on a spacecraft, as masses on springs: a linear effector of Basilisk for each mode.

    Parameters
    ----------
    path : Path
        ``reduced.npz`` of ``gossamer reduce``.
    vehicle : Basilisk.simulation.spacecraft.Spacecraft
        What carries it. What the modes leave of the membrane's mass is added to its hub, so set the hub's mass before; the
        mass of what the supports hold is not in it.
    place : array_like, shape (3,)
        The membrane's own origin, in body axes [m].
    axes : array_like, shape (3, 3)
        Turns vectors from the membrane's axes to those of the body.

    Raises
    ------
    SimulationError
        The hub is too light: without what the modes take of it nothing with a mass and an inertia is left.

    Returns
    -------
    list of Basilisk.simulation.linearSpringMassDamper.LinearSpringMassDamper
        Add them to the task of the vehicle.
    """
    with np.load(path, allow_pickle=False) as file:
        whole, springs = file["M"][:6, :6], [file[f"spring_{name}"] for name in ("mass", "place", "direction")]
        rates = file["spring_stiffness"], file["spring_damping"]
    A, at, (mass, places, directions) = np.asarray(axes, dtype=float), np.asarray(place, dtype=float), springs
    s = whole[[5, 3, 4], [1, 2, 0]]  # first moment: rows are about axes, columns along them
    rest = whole[0, 0] - mass.sum()
    first = A @ (s - mass @ places)
    J = A @ (whole[3:, 3:] - sum(m * of_point(r) for m, r in zip(mass, places, strict=True))) @ A.T
    J = J + rest * of_point(at) + 2.0 * (at @ first) * np.eye(3) - np.outer(at, first) - np.outer(first, at)
    six = [J[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    hub, numbers = vehicle.hub, np.array([rest, *(first + rest * at), *six])
    left, _, inertia = with_edge(hub.mHub, np.ravel(hub.r_BcB_B), np.array(hub.IHubPntBc_B), numbers)
    if not (left > 0.0 and np.linalg.eigvalsh(inertia).min() > 0.0):
        inertias = ", ".join(f"{each:.3g}" for each in np.linalg.eigvalsh(inertia))
        msg = (
            f"the {len(mass)} modes of {path} move {mass.sum():.3g} kg, each along its own line, where the membrane has "
            f"{whole[0, 0]:.3g} kg. They leave the hub {left:.3g} kg, and {inertias} kg m2 about its axes. Reduce to fewer "
            "modes, or set the hub's mass and inertia, which must be larger, before."
        )
        raise SimulationError(msg, component="hub", time=0.0)
    _add_mass(hub, numbers)
    found = []
    for m, r, p, k, c in zip(mass, places, directions, *rates, strict=True):
        one = linearSpringMassDamper.LinearSpringMassDamper()
        one.massInit, one.k, one.c, one.rhoInit, one.rhoDotInit = float(m), float(k), float(c), 0.0, 0.0
        one.r_PB_B, one.pHat_B = (at + A @ r).tolist(), (A @ p).tolist()
        vehicle.addStateEffector(one)
        found.append(one)
    return found


def _add_mass(hub: Any, numbers: Array) -> None:  # noqa: ANN401
    """Add what is fixed to a hub: mass, first moment and inertia about its origin, as of ``HELD``."""
    mass, centre, J = with_edge(hub.mHub, np.ravel(hub.r_BcB_B), np.array(hub.IHubPntBc_B), numbers)
    hub.mHub, hub.r_BcB_B, hub.IHubPntBc_B = mass, centre.reshape(3, 1).tolist(), J.tolist()


class FramedMembrane(sysModel.SysModel):  # type: ignore[misc, unused-ignore]  # Basilisk has no types
    """Any FMU with the interface of ``framed_membrane`` on a spacecraft.

    Parameters
    ----------
    path : Path
        The FMU, also a container of it and others.
    vehicle : Basilisk.simulation.spacecraft.Spacecraft
        What carries it. The mass of the membrane's edge is added to its hub, so set the hub's mass before.
    parameters : mapping of str to float
        Parameters and inputs of the FMU that differ from their start values.
    component : str
        Name of the membrane within a container; its variables are then ``component.force[1]`` and so on.

    Raises
    ------
    FmuError
        The FMU cannot be started, or is no membrane on a frame.

    Notes
    -----
    ``add_to`` puts three modules into a task, in the order that the coupling needs: force, spacecraft, membrane. The
    membrane's force arrives one step late and is extrapolated, see ``Debt``.
    """

    def __init__(
        self,
        path: Path,
        vehicle: Any,  # noqa: ANN401
        parameters: Mapping[str, float] | None = None,
        component: str = "",
    ) -> None:
        super().__init__()
        self.ModelTag = component or "membrane"
        self._vehicle, self._prefix = vehicle, f"{component}." if component else ""
        self._file = FmuFile(Path(path), validate=False)
        missing = [
            name for name in (*_MOTION, *_REACTION, *HELD, *MOVING) if self._prefix + name not in self._file.variables
        ]
        if missing:
            msg = (
                f"{path} is no membrane on a frame: it has no variable {self._prefix + missing[0]!r}. Build "
                "framed_membrane; of a container, name the membrane with component= and record all of its variables."
            )
            raise FmuError(msg)
        self._instance = start_instance(self._file, self.ModelTag)
        self._motion, self._reaction = self._port(_MOTION), self._port(_REACTION)
        self._instance.set_start(dict(parameters or {}))
        self._instance.enter_initialization(_LONGEST)
        self._motion.values[3:6] = np.ravel(vehicle.hub.omega_BN_BInit)
        self._instance.write(self._motion)
        self._instance.exit_initialization()
        self._add_edge()
        self.force = extForceTorque.ExtForceTorque()
        self.states = messaging.SCStatesMsgReader()
        vehicle.addDynamicEffector(self.force)
        self.states.subscribeTo(vehicle.scStateOutMsg)

    def add_to(self, simulation: Any, task: str) -> None:  # noqa: ANN401
        """Add force, spacecraft and membrane to a task; the rate of the task is the communication step."""
        for module in (self.force, self._vehicle, self):
            simulation.AddModelToTask(task, module)

    def Reset(self, nanoseconds: int) -> None:
        """Apply the force of the membrane at rest; Basilisk calls it once, before the run."""
        self._time = nanoseconds
        self._instance.read(self._reaction)
        self._debt = Debt(self._reaction.values)
        self._apply(self._reaction.values)

    def UpdateState(self, nanoseconds: int) -> None:
        """Step the FMU to the present time with the motion of the spacecraft, and set the force of the next step."""
        h = (nanoseconds - self._time) * macros.NANO2SEC
        if h == 0.0:
            return
        state = self.states()
        a, w, w_dot = (np.array(x) for x in (state.nonConservativeAccelpntB_B, state.omega_BN_B, state.omegaDot_BN_B))
        back = h / 2.0 * w - h**2 / 6.0 * w_dot  # to the mean axes over the step: Basilisk gives a in those at its end
        self._motion.values[:] = np.concatenate([turn(back) @ a, w, w_dot])
        self._instance.write(self._motion)
        begin = self._time * macros.NANO2SEC
        if not self._instance.step(ctypes.c_double(begin), ctypes.c_double(h)):
            msg = f"{self.ModelTag} refused the step from t = {begin:g} s. Use a shorter step of the task."
            raise SimulationError(msg, component=self.ModelTag, time=begin)
        self._time = nanoseconds
        self._instance.read(self._reaction)
        R = Rotation.from_mrp(state.sigma_BN).as_matrix()
        self._apply(self._debt.applied(R, w, w_dot, self._reaction.values, h))

    @property
    def owed(self) -> Array:
        """Impulse [N s] and angular impulse [N m s] on the way to the spacecraft, in inertial axes, shape (6,)."""
        return self._debt.owed

    def read(self, *names: str) -> Array:
        """Read variables of the FMU by their full names."""
        port = self._instance.port(list(names))
        self._instance.read(port)
        return port.values

    def write(self, values: Mapping[str, float]) -> None:
        """Set inputs of the FMU by their full names, from the next step on."""
        self._instance.write(self._instance.port(list(values)).put(list(values.values())))

    def close(self) -> None:
        """Free the FMU and remove its unpacked files."""
        self._instance.close()
        self._file.close()

    def _port(self, names: Sequence[str]) -> Any:  # noqa: ANN401
        return self._instance.port([self._prefix + name for name in names])

    def _apply(self, W: Array) -> None:
        self.force.extForce_B, self.force.extTorquePntB_B = W[:3].tolist(), W[3:].tolist()

    def _add_edge(self) -> None:
        """Add the mass of the membrane's edge to the hub; warn where that is too light."""
        port, hub = self._port([*HELD, *MOVING]), self._vehicle.hub
        self._instance.read(port)
        _add_mass(hub, port.values[:10])
        if light := too_light(hub.mHub, np.ravel(hub.r_BcB_B), np.array(hub.IHubPntBc_B), port.values):
            logger.warning("%s: %s. Or use the FMU hub in a group, as scenario light_hub does.", self.ModelTag, light)
