"""Run the chain with libcosim (Open Simulation Platform), from its own configuration or from an .ssp."""

import json
import sys
from pathlib import Path

import numpy as np
from libcosimpy._internal import get_last_error_message
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave


def configure(job):
    """Add slaves, start values and connections one by one."""
    execution = CosimExecution.from_step_size(round(job["step"] * 1e9))  # [ns]
    slaves = [CosimLocalSlave(fmu_path=c["fmu"], instance_name=c["name"]) for c in job["components"]]
    for slave in slaves:
        assert slave.ptr(), get_last_error_message()
        assert execution.add_local_slave(slave) >= 0
    places = look_up(execution)
    for component in job["components"]:
        for variable, value in component["start"].items():
            assert execution.real_initial_value(*places[component["name"], variable], value)
    for sender, output, receiver, entry in job["connections"]:
        assert execution.connect_real_variables(*places[sender, output], *places[receiver, entry]) == 0
    return execution


def look_up(execution):
    """Slave index and value reference by component and variable."""
    return {
        (slave.name.decode(), variable.name.decode()): (slave.index, variable.reference)
        for slave in execution.slave_infos()
        for variable in execution.slave_variables(slave.index)
    }


def main(job, table):
    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(job["ssp"]) if "ssp" in job else configure(job)
    places = look_up(execution)
    observer = CosimObserver.create_time_series(buffer_size=job["ticks"] + 2)
    assert execution.add_observer(observer)
    watched = [places[component, variable] for component, variable in job["watched"]]
    for place in watched:
        assert observer.start_time_series(*place, CosimVariableType.REAL)
    # libcosimpy takes step 0 for an empty place and withholds the last sample: request one step more.
    samples = job["ticks"] + 2
    assert execution.step(samples - 1)
    columns = [observer.time_series_real_samples(*place, from_step=0, sample_count=samples)[2] for place in watched]
    np.save(table, np.column_stack(columns))


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()), sys.argv[2])
