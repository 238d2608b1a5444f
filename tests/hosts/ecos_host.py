"""Run the chain with Ecos through ecospy, from its own configuration or from an .ssp."""

import ctypes
import json
import sys
from pathlib import Path

import numpy as np

TBB = Path(sys.prefix, "lib/libtbb.so.12")  # ecospy does not bring the library it is linked with; package "tbb" does
if TBB.exists():
    ctypes.CDLL(str(TBB), mode=ctypes.RTLD_GLOBAL)

from ecospy import EcosSimulation, EcosSimulationStructure  # noqa: E402


def configure(job):
    """Add models, start values and connections one by one."""
    structure = EcosSimulationStructure()
    for component in job["components"]:
        structure.add_model(component["name"], component["fmu"])
    for sender, output, receiver, entry in job["connections"]:
        structure.make_real_connection(f"{sender}::{output}", f"{receiver}::{entry}")
    start = {f"{c['name']}::{variable}": value for c in job["components"] for variable, value in c["start"].items()}
    structure.add_parameter_set("initialValues", start)
    return EcosSimulation(structure=structure, step_size=job["step"])


def main(job, table):
    ssp, step = job.get("ssp"), job["step"]
    simulation = EcosSimulation(ssp_path=ssp, step_size=step) if ssp else configure(job)

    def watch():
        return [simulation.get_real(f"{component}::{variable}") for component, variable in job["watched"]]

    simulation.init(parameter_set="initialValues")
    rows = [watch()]
    for _ in range(job["ticks"]):
        simulation.step()
        rows.append(watch())
    simulation.terminate()
    simulation.free()
    np.save(table, rows)


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()), sys.argv[2])
