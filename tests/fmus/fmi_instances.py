"""Instances of FMI 2.0 and 3.0 with the same methods, over FMPy, and the messages that they logged."""

from fmpy import fmi2, fmi3
from fmu_host import description_of
from gossamer_fmus.description import arrays_of


class Fmi2:
    """An instance of FMI 2.0 and what it logged; its groups of values are single variables."""

    def __init__(self, model, path, folder):
        self.messages = []
        self.groups = {reference: range(reference, reference + 1) for reference in range(len(model.variables))}
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *args: self.messages.append(args[-1]))
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self.slave = fmi2.FMU2Slave(
            guid=description_of(path).guid, unzipDirectory=folder, modelIdentifier=model.name, instanceName="fuzzed"
        )
        self.slave.instantiate(callbacks=callbacks, loggingOn=True)

    def start(self):
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()

    def leave(self):
        self.slave.exitInitializationMode()

    def terminate(self):
        self.slave.terminate()

    def reset(self):
        self.slave.reset()

    def set(self, references, values):
        self.slave.setReal(references, values)

    def get(self, references):
        return self.slave.getReal(references)

    def step(self, h):
        self.slave.doStep(0.0, h)

    def other_types(self):
        for of_type, value in (("Integer", 1), ("Boolean", True), ("String", "%s%n")):
            getattr(self.slave, f"get{of_type}")([0])
            getattr(self.slave, f"set{of_type}")([0], [value])

    def save(self):
        return self.slave.getFMUstate()

    def restore(self, state):
        self.slave.setFMUstate(state)

    def free(self, state):
        self.slave.freeFMUstate(state)

    def write(self, state):
        return self.slave.serializeFMUstate(state)

    def read(self, content):
        return self.slave.deSerializeFMUstate(content)


class Fmi3(Fmi2):
    """An instance of FMI 3.0; its groups of values are arrays."""

    def __init__(self, model, path, folder):
        self.messages = []
        arrays = arrays_of(model)
        self.groups = {k: range(array.first, array.first + array.size) for k, array in enumerate(arrays, 1)}
        self.slave = fmi3.FMU3Slave(
            guid=description_of(path).guid, unzipDirectory=folder, modelIdentifier=model.name, instanceName="fuzzed"
        )
        self.slave.instantiate(logMessage=lambda *args: self.messages.append(args[-1]), loggingOn=True)

    def start(self):
        self.slave.enterInitializationMode(startTime=0.0)

    def set(self, references, values):
        self.slave.setFloat64(references, values)

    def get(self, references):
        return self.slave.getFloat64(references, sum(len(self.groups.get(k, "1")) for k in references))

    def other_types(self):
        for of_type, value in (("Int32", 1), ("Boolean", True), ("String", "%s%n")):
            getattr(self.slave, f"get{of_type}")([1])
            getattr(self.slave, f"set{of_type}")([1], [value])

    def save(self):
        return self.slave.getFMUState()

    def restore(self, state):
        self.slave.setFMUState(state)

    def free(self, state):
        self.slave.freeFMUState(state)

    def write(self, state):
        return self.slave.serializeFMUState(state)

    def read(self, content):
        return self.slave.deserializeFMUState(content)
