"""Run the chain with PathSim: every FMU is a block with a schedule of its own."""

import json
import sys
from pathlib import Path

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import Constant, Scope
from pathsim_fmi import CoSimulationFMU


def main(job, table):
    step, connections = job["step"], job["connections"]
    blocks = {}
    for component in job["components"]:
        name = component["name"]
        # A block initializes its FMU when it is made and reads no inputs then: give it the outputs of the others.
        arriving = {entry: blocks[s].outputs[output] for s, output, receiver, entry in connections if receiver == name}
        start = component["start"] | arriving
        blocks[name] = CoSimulationFMU(component["fmu"], instance_name=name, start_values=start, dt=step)
    # Every step sets every input, an unconnected one to zero whatever its start value: constants hold the given ones.
    constants = [
        (Constant(value), blocks[c["name"]][variable])
        for c in job["components"]
        for variable, value in c["start"].items()
        if variable in blocks[c["name"]].fmu_wrapper.input_refs
    ]
    watched = [blocks[component][variable] for component, variable in job["watched"]]
    first = [blocks[component].outputs[variable] for component, variable in job["watched"]]
    scope = Scope()
    wires = [Connection(blocks[s][output], blocks[r][entry]) for s, output, r, entry in connections]
    wires += [Connection(constant, port) for constant, port in constants]
    wires += [Connection(source, scope[i]) for i, source in enumerate(watched)]
    simulation = Simulation([*(constant for constant, _ in constants), *blocks.values(), scope], wires, dt=step, log=False)
    simulation.run((job["ticks"] - 1) * step)  # FMUs step at the start of an interval: at t = 0 they have made one step
    _, rows = scope.read()
    np.save(table, np.vstack([first, rows.T]))


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()), sys.argv[2])
