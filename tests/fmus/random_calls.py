"""Drive an FMU with random calls: python random_calls.py FMU UNZIPPED SEED."""

import ctypes
import math
import random
import sys

import fmpy
from fmpy import fmi2

VALUES = [0.0, -0.0, 0.1, -1.0, 0.94, 1e-310, 1e308, -1e308, math.nan, math.inf, -math.inf]
STEPS = [1e-4, 3e-4, 1e-3, 0.0, -1e-3, 1e9, 1e-300, math.nan, math.inf]
REFERENCES = [0, 1, 2, 3, 4, 5, 10, 20, 30, 40, 60, 82, 83, 1000, 2**31 - 1, 2**31, 2**32 - 1]


def main(path, unzipped, seed):
    rng = random.Random(seed)
    description = fmpy.read_model_description(path)
    slave = fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=unzipped,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="fuzzed",
    )
    slave.instantiate()
    dll, c = slave.dll, slave.component
    saved = []

    def references(n):
        return (ctypes.c_uint * n)(*rng.choices(REFERENCES, k=n))

    def set_real():
        n = rng.randint(0, 4)
        dll.fmi2SetReal(c, references(n), n, (ctypes.c_double * n)(*rng.choices(VALUES, k=n)))

    def get_real():
        n = rng.randint(0, 4)
        dll.fmi2GetReal(c, references(n), n, (ctypes.c_double * n)())

    def other_types():
        dll.fmi2GetInteger(c, references(1), 1, (ctypes.c_int * 1)())
        dll.fmi2SetInteger(c, references(1), 1, (ctypes.c_int * 1)(1))
        dll.fmi2GetBoolean(c, references(1), 1, (ctypes.c_int * 1)())
        dll.fmi2SetBoolean(c, references(1), 1, (ctypes.c_int * 1)(1))
        dll.fmi2GetString(c, references(1), 1, (ctypes.c_char_p * 1)())
        dll.fmi2SetString(c, references(1), 1, (ctypes.c_char_p * 1)(b"%s%n"))

    def initialize():
        slave.setupExperiment(startTime=rng.choice([0.0, 1.0]))
        slave.enterInitializationMode()
        slave.exitInitializationMode()

    def states():
        if saved and rng.random() < 0.5:
            slave.setFMUstate(rng.choice(saved))
        elif len(saved) < 10:
            saved.append(slave.getFMUstate())

    def bytes_():
        state = slave.getFMUstate()
        content = bytearray(slave.serializeFMUstate(state))
        slave.freeFMUstate(state)
        if rng.random() < 0.7:
            content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        if rng.random() < 0.3:
            del content[rng.randrange(len(content)) :]
        restored = slave.deSerializeFMUstate(bytes(content))
        slave.setFMUstate(restored)
        slave.freeFMUstate(restored)

    calls = [set_real] * 4 + [get_real] * 2 + [other_types, initialize, states, bytes_, slave.reset]
    for _ in range(500):
        if rng.random() < 0.4:
            dll.fmi2DoStep(c, ctypes.c_double(0.0), ctypes.c_double(rng.choice(STEPS)), 0)
        else:
            rng.choice(calls)()
    for state in saved:
        slave.freeFMUstate(state)
    slave.terminate()
    slave.freeInstance()
    sys.stdout.write("survived\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
