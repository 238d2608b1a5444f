"""Run one FMU in FMPy or libcosim and write a table: a row per communication point, a column per watched variable.

``python container_host.py job.json table.npy``, in a process of its own, so that what a host prints or breaks disturbs
nobody. It knows the tools and nothing of Gossamer.
"""

import json
import sys
from pathlib import Path

import numpy as np


def run_fmpy(job):
    import fmpy

    result = fmpy.simulate_fmu(
        job["fmu"],
        stop_time=job["step"] * job["ticks"],
        step_size=job["step"],
        output_interval=job["step"],
        start_values=job["start"],
        output=job["watched"],
    )
    return np.column_stack([result[name] for name in job["watched"]])


def run_libcosim(job):
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.FATAL)
    execution = CosimExecution.from_step_size(round(job["step"] * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=job["fmu"], instance_name="container"))
    references = {v.name.decode(): v.reference for v in execution.slave_variables(slave)}
    for name, value in job["start"].items():
        assert execution.real_initial_value(slave, references[name], value)
    observer = CosimObserver.create_time_series(buffer_size=job["ticks"] + 2)
    assert execution.add_observer(observer)
    for name in job["watched"]:
        assert observer.start_time_series(slave, references[name], CosimVariableType.REAL)
    samples = job["ticks"] + 2  # libcosimpy withholds the last sample
    assert execution.step(samples - 1)
    series = [observer.time_series_real_samples(slave, references[n], 0, samples)[2] for n in job["watched"]]
    return np.column_stack(series)


if __name__ == "__main__":
    what = json.loads(Path(sys.argv[1]).read_text())
    np.save(sys.argv[2], {"fmpy": run_fmpy, "libcosim": run_libcosim}[what["host"]](what))
