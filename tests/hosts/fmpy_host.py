"""Run the chain with a loop over FMPy's own classes, FMU by FMU (Gauss-Seidel) or all at once (Jacobi)."""

import json
import sys
from math import prod
from pathlib import Path

import fmpy
import numpy as np
from fmpy import fmi2, fmi3


class Member:
    """An FMI 2.0 FMU and where its variables are."""

    slave = fmi2.FMU2Slave

    def __init__(self, name, path, start):
        self.description = fmpy.read_model_description(path)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.fmu = self.slave(
            guid=self.description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.initialize(start)

    def initialize(self, start):
        self.fmu.setupExperiment(startTime=0.0)
        for name, value in start.items():
            self.set(name, value)
        self.fmu.enterInitializationMode()

    def set(self, name, value):
        self.fmu.setReal([self.variables[name].valueReference], [value])

    def get(self, name):
        return self.fmu.getReal([self.variables[name].valueReference])[0]


class Member3(Member):
    """An FMI 3.0 FMU, of whose arrays ``name[i]`` is an element."""

    slave = fmi3.FMU3Slave

    def initialize(self, start):
        for name, value in start.items():
            self.set(name, value)
        self.fmu.enterInitializationMode()

    def set(self, name, value):
        reference, array, place = self._look_up(name)
        array[place] = value
        self.fmu.setFloat64([reference], array)

    def get(self, name):
        _, array, place = self._look_up(name)
        return array[place]

    def _look_up(self, name):
        base, _, index = name.removesuffix("]").partition("[")
        variable = self.variables[base]
        size = prod(dimension.start for dimension in variable.dimensions)
        array = self.fmu.getFloat64([variable.valueReference], nValues=size)
        return variable.valueReference, array, int(index or 1) - 1


def main(job, table):
    kind = {"2.0": Member, "3.0": Member3}
    members = {
        c["name"]: kind[fmpy.read_model_description(c["fmu"]).fmiVersion](c["name"], c["fmu"], c["start"])
        for c in job["components"]
    }

    def receive(name):
        for sender, output, receiver, entry in job["connections"]:
            if receiver == name:
                members[name].set(entry, members[sender].get(output))

    def watch():
        return [members[component].get(variable) for component, variable in job["watched"]]

    for name, member in members.items():
        receive(name)
        member.fmu.exitInitializationMode()
    groups = [[name] for name in members] if job["master"] == "gauss-seidel" else [list(members)]
    rows = [watch()]
    for time, size in job["steps"]:
        for group in groups:
            for name in group:
                receive(name)
            for name in group:
                members[name].fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)
        rows.append(watch())
    for member in members.values():
        member.fmu.terminate()
        member.fmu.freeInstance()
    np.save(table, rows)


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()), sys.argv[2])
