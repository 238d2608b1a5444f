"""The table of the hub's variables."""

from __future__ import annotations

from ..variables import array, input_, local, output, parameter

_INERTIA, _QUATERNION = ("xx", "yy", "zz", "xy", "xz", "yz"), ("scalar", "x", "y", "z")
_BODY, _INERTIAL = "in body axes", "in inertial axes"
_BEGINS = "when the run begins"
VARIABLES = (
    parameter("mass", "kg", "Mass of the hub", 120.0, 1e-6, 1e9),
    *array(parameter, "centre_of_mass", "m", f"Centre of mass of the hub from its origin, {_BODY}", 0.0, 1e4),
    *array(
        parameter,
        "inertia",
        "kg m2",
        f"Inertia of the hub about its centre of mass, {_BODY}",
        (90.0, 80.0, 60.0, 0.0, 0.0, 0.0),
        1e12,
        parts=_INERTIA,
    ),
    *array(parameter, "initial_position", "m", f"Position of the hub's origin {_BEGINS}, {_INERTIAL}", 0.0, 1e12),
    *array(parameter, "initial_velocity", "m/s", f"Velocity of the hub's origin {_BEGINS}, {_INERTIAL}", 0.0, 1e6),
    *array(
        parameter,
        "initial_attitude",
        "1",
        f"Quaternion from body to inertial axes {_BEGINS}, of any length",
        (1.0, 0.0, 0.0, 0.0),
        1e3,
        parts=_QUATERNION,
    ),
    *array(parameter, "initial_angular_velocity", "rad/s", f"Angular velocity {_BEGINS}, {_BODY}", 0.0, 1e3),
    *array(parameter, "initial_wheel_momentum", "kg m2/s", f"Angular momentum of the wheels {_BEGINS}, {_BODY}", 0.0, 1e9),
    parameter(
        "extrapolation",
        "1",
        "1 if force and torque of the appendage are those of the last step, 0 if they are those of the present one",
        1.0,
        0.0,
        1.0,
    ),
    *array(input_, "force", "N", f"Force of the appendage, mean over its step, {_BODY}", 0.0, 1e9),
    *array(
        input_, "torque", "N m", f"Torque of the appendage about the hub's origin, mean over its step, {_BODY}", 0.0, 1e9
    ),
    *array(input_, "thruster_force", "N", f"Force of the thrusters, {_BODY}", 0.0, 1e9),
    *array(input_, "thruster_torque", "N m", f"Torque of the thrusters about the hub's origin, {_BODY}", 0.0, 1e9),
    *array(
        input_,
        "wheel_torque",
        "N m",
        f"Torque of the motors on the wheels, the opposite of that on the hub, {_BODY}",
        0.0,
        1e9,
    ),
    input_("attached_mass", "kg", "Mass of the appendage's part that is fixed to the hub; constant", 0.0, 0.0, 1e9),
    *array(input_, "attached_first_moment", "kg m", f"Its mass times place from the hub's origin, {_BODY}", 0.0, 1e9),
    *array(input_, "attached_inertia", "kg m2", f"Its inertia about the hub's origin, {_BODY}", 0.0, 1e9, parts=_INERTIA),
    *array(
        output,
        "acceleration",
        "m/s2",
        "Acceleration of the hub's origin, mean over the step, in the body axes half way",
        nominal=1.0,
    ),
    *array(output, "angular_acceleration", "rad/s2", f"Angular acceleration, mean over the step, {_BODY}", nominal=1.0),
    *array(output, "angular_velocity", "rad/s", f"Angular velocity, {_BODY}"),
    *array(output, "attitude", "1", "Quaternion from body to inertial axes", parts=_QUATERNION),
    *array(output, "position", "m", f"Position of the hub's origin, {_INERTIAL}"),
    *array(output, "velocity", "m/s", f"Velocity of the hub's origin, {_INERTIAL}"),
    *array(output, "wheel_momentum", "kg m2/s", f"Angular momentum of the wheels relative to the hub, {_BODY}"),
    *array(local, "momentum", "kg m/s", f"Momentum of the hub and what is attached, {_INERTIAL}"),
    *array(
        local,
        "angular_momentum",
        "kg m2/s",
        f"Angular momentum of the same about the inertial origin, wheels included, {_INERTIAL}",
    ),
    local("kinetic_energy", "J", "Kinetic energy of the same, the spin of the wheels left out"),
)
