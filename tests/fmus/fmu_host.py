"""The FMUs to test, a thin host over FMPy (variables by name, messages that were logged), and something to feed it."""

import ctypes
import math
from functools import cache

import fmpy
import numpy as np
from fmpy import fmi2
from gossamer_fmus import NAMES
from gossamer_fmus.catalogue import MODELS

FMUS = NAMES

INPUTS = {
    "membrane": {"pressure": 500.0, "base_acceleration": 3.0, "damage[7]": 0.2},
    "sensor": {"strain": 0.11},
    "framed_membrane": {
        "pressure": 500.0,
        "frame_acceleration[3]": 3.0,
        "angular_velocity[1]": 0.2,
        "angular_acceleration[2]": 5.0,
        "damage[7]": 0.2,
    },
    "hub": {"force[3]": 20.0, "torque[1]": 3.0, "thruster_force[1]": 5.0, "wheel_torque[2]": 2.0, "attached_mass": 0.1},
    "detector": {"strain[1]": 0.1, "strain[2]": 0.2, "strain[3]": 0.05, "strain[4]": 0.3},
}


def model_of(name):
    """Make the model of an FMU."""
    return MODELS[name]()


def same(found, wanted, kind, name):
    """Whether an FMU has its model's numbers: to the bit, or but for round-off where a native membrane sums by a loop."""
    if kind == "python" or not name.endswith("membrane"):
        return np.array(found).tobytes() == np.array(wanted).tobytes()
    return np.allclose(found, wanted, rtol=1e-9, atol=1e-10, equal_nan=True)


def excite(name, k):
    """Input values that move, different for each step; a resistance stays near its rest value."""
    resistance = {"resistance": 100.0 * (1.0 + 0.01 * math.sin(0.3 * k))}
    if name in ("compensator", "filter"):
        return resistance
    if name == "estimator":
        return resistance | {"known": float(k % 5 == 2), "known_strain": 0.02 + 0.01 * math.sin(0.3 * k)}
    return {key: value * (1.0 + 0.1 * math.sin(0.3 * k)) for key, value in amplitudes(name).items()}


@cache
def amplitudes(name):
    """Input values to swing about: of an FMU that has none here, all inputs near their nominal values."""
    return INPUTS.get(name) or {v.name: v.nominal or 0.01 for v in model_of(name).variables if v.causality == "input"}


@cache
def description_of(path):
    """Read the model description of an FMU, once for all its instances."""
    return fmpy.read_model_description(str(path))


class Instance:
    """An FMU instance with its variables by name and the messages it logged."""

    def __init__(self, path, unzipped, name="instance"):
        self.description = description_of(path)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.messages = []
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        self._callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self.slave = fmi2.FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(unzipped),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        try:
            self.slave.instantiate(callbacks=self._callbacks, loggingOn=True)
        except Exception:
            self.slave.freeLibrary()  # pythonfmu 0.7.0 corrupts memory at exit if its library is still loaded then
            raise
        self.time = 0.0

    def _log(self, _environment, _name, _status, _category, message):
        self.messages.append(message.decode())

    def initialize(self, **start):
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        for name, value in start.items():
            self.set(name, value)
        self.slave.exitInitializationMode()

    def set(self, name, value):
        self.slave.setReal([self.references[name]], [value])

    def get(self, *names):
        return self.slave.getReal([self.references[name] for name in names])

    def step(self, h):
        """Return the FMI status: 0 ok, 2 discard."""
        status = self.slave.dll.fmi2DoStep(self.slave.component, ctypes.c_double(self.time), ctypes.c_double(h), 0)
        if status == 0:
            self.time += h
        return status

    def names(self, causality):
        return [v.name for v in self.description.modelVariables if v.causality == causality]
