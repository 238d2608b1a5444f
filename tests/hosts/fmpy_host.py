"""Run the chain with a loop over FMPy's own classes, FMU by FMU (Gauss-Seidel) or all at once (Jacobi)."""

import json
import sys
from pathlib import Path

import fmpy
import numpy as np
from fmpy import fmi2


class Member:
    """An FMU and where its variables are."""

    def __init__(self, name, path, start):
        description = fmpy.read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        for variable, value in start.items():
            self.set(variable, value)
        self.fmu.enterInitializationMode()

    def set(self, variable, value):
        self.fmu.setReal([self.references[variable]], [value])

    def get(self, variable):
        return self.fmu.getReal([self.references[variable]])[0]


def main(job, table):
    members = {c["name"]: Member(c["name"], c["fmu"], c["start"]) for c in job["components"]}

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
