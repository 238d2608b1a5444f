"""Instances of FMUs of either version of FMI, for co-simulation or model exchange."""

from __future__ import annotations

from .file import FmuFile
from .instance import Instance
from .instance3 import Instance3
from .model_exchange import ModelExchange2, ModelExchange3


def start_instance(fmu: FmuFile, name: str, time: float = 0.0) -> Instance:
    """Start an instance of an FMU of either version and kind; see ``Instance``."""
    kinds = {(2, False): Instance, (3, False): Instance3, (2, True): ModelExchange2, (3, True): ModelExchange3}
    return kinds[fmu.version, fmu.model_exchange](fmu, name, time)
