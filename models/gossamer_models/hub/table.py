"""The table of the hub's variables."""

from __future__ import annotations

from collections.abc import Sequence

from ..variables import Variable, array, input_, local, output, parameter

_AXES, _INERTIA, _QUATERNION = "xyz", ("xx", "yy", "zz", "xy", "xz", "yz"), ("scalar", "x", "y", "z")


def _given(
    name: str, unit: str, text: str, start: Sequence[float], limit: float, parts: Sequence[str] = _AXES
) -> tuple[Variable, ...]:
    """Make the rows of a parameter with its start values and a limit on both sides."""
    return tuple(
        parameter(f"{name}[{k}]", unit, f"{text}, {part}", value, -limit, limit)
        for k, (part, value) in enumerate(zip(parts, start, strict=True), 1)
    )


_ZERO = (0.0, 0.0, 0.0)
_FREE = {"start": 0.0, "minimum": -1e9, "maximum": 1e9}
VARIABLES = (
    parameter("mass", "kg", "Mass of the hub", 120.0, 1e-6, 1e9),
    *_given("centre_of_mass", "m", "Centre of mass of the hub from its origin, in body axes", _ZERO, 1e4),
    *_given(
        "inertia",
        "kg m2",
        "Inertia of the hub about its centre of mass, in body axes",
        (90.0, 80.0, 60.0, 0.0, 0.0, 0.0),
        1e12,
        _INERTIA,
    ),
    *_given("initial_position", "m", "Position of the hub's origin when the run begins, in inertial axes", _ZERO, 1e12),
    *_given(
        "initial_velocity", "m/s", "Velocity of the hub's origin when the run begins, in inertial axes", _ZERO, 1e6
    ),
    *_given(
        "initial_attitude",
        "1",
        "Quaternion from body to inertial axes when the run begins, of any length",
        (1.0, 0.0, 0.0, 0.0),
        1e3,
        _QUATERNION,
    ),
    *_given("initial_angular_velocity", "rad/s", "Angular velocity when the run begins, in body axes", _ZERO, 1e3),
    *_given(
        "initial_wheel_momentum",
        "kg m2/s",
        "Angular momentum of the wheels when the run begins, in body axes",
        _ZERO,
        1e9,
    ),
    parameter(
        "extrapolation",
        "1",
        "1 if force and torque of the appendage are those of the last step, 0 if they are those of the present one",
        1.0,
        0.0,
        1.0,
    ),
    *array(input_, "force", "N", "Force of the appendage, mean over its step, in body axes", _AXES, **_FREE),
    *array(
        input_,
        "torque",
        "N m",
        "Torque of the appendage about the hub's origin, mean over its step, in body axes",
        _AXES,
        **_FREE,
    ),
    *array(input_, "thruster_force", "N", "Force of the thrusters, in body axes", _AXES, **_FREE),
    *array(
        input_, "thruster_torque", "N m", "Torque of the thrusters about the hub's origin, in body axes", _AXES, **_FREE
    ),
    *array(
        input_,
        "wheel_torque",
        "N m",
        "Torque of the motors on the wheels, the opposite of that on the hub, in body axes",
        _AXES,
        **_FREE,
    ),
    input_("attached_mass", "kg", "Mass of the appendage's part that is fixed to the hub; constant", 0.0, 0.0, 1e9),
    *array(
        input_,
        "attached_first_moment",
        "kg m",
        "Its mass times place from the hub's origin, in body axes",
        _AXES,
        **_FREE,
    ),
    *array(input_, "attached_inertia", "kg m2", "Its inertia about the hub's origin, in body axes", _INERTIA, **_FREE),
    *array(
        output,
        "acceleration",
        "m/s2",
        "Acceleration of the hub's origin, mean over the step, in the body axes half way",
        _AXES,
        nominal=1.0,
    ),
    *array(
        output,
        "angular_acceleration",
        "rad/s2",
        "Angular acceleration, mean over the step, in body axes",
        _AXES,
        nominal=1.0,
    ),
    *array(output, "angular_velocity", "rad/s", "Angular velocity, in body axes", _AXES),
    *array(output, "attitude", "1", "Quaternion from body to inertial axes", _QUATERNION),
    *array(output, "position", "m", "Position of the hub's origin, in inertial axes", _AXES),
    *array(output, "velocity", "m/s", "Velocity of the hub's origin, in inertial axes", _AXES),
    *array(
        output, "wheel_momentum", "kg m2/s", "Angular momentum of the wheels relative to the hub, in body axes", _AXES
    ),
    *array(local, "momentum", "kg m/s", "Momentum of the hub and what is attached, in inertial axes", _AXES),
    *array(
        local,
        "angular_momentum",
        "kg m2/s",
        "Angular momentum of the same about the inertial origin, wheels included, in inertial axes",
        _AXES,
    ),
    local("kinetic_energy", "J", "Kinetic energy of the same, the spin of the wheels left out"),
)
