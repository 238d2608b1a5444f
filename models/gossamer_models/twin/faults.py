"""What may go wrong with a structure beside damage of its zones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from ..errors import ParameterError
from ..membrane import Fault, Structure
from ..membrane.setup import LEFT, SCALABLE, SPRINGS
from .calibration import with_factors
from .forward import Forward, MembraneForward


def known_faults(structure: Structure) -> tuple[Fault, ...]:
    """Return the faults that a structure describes, and those that any of its kind may have."""
    own = structure.setup.faults
    return (*own, *(fault for fault in _usual(structure) if fault.name not in {each.name for each in own}))


def _usual(structure: Structure) -> Iterator[Fault]:
    setup, scalable = structure.setup, structure.setup.scalable
    if setup.gas is not None:
        yield Fault(name="loss of gas", parameter="gas_amount")
    if "tension" in scalable:
        yield Fault(name="loss of edge tension", parameter="tension_factor")
    if "prestress" in scalable:
        yield Fault(name="loss of prestress", parameter="prestress_factor")
    if structure.starts_in_plane:
        yield Fault(name="loss of prestrain", parameter="edge_displacement")
    if setup.directional:
        for k, zone in enumerate(structure.zone_names, 1):
            for name in LEFT:
                yield Fault(name=f"{zone} torn {name.partition('_')[2]}", parameter=f"{name}[{k}]")
    for k, i in enumerate(setup.springs, 1):
        yield Fault(name=f"loose support {setup.supports[i].group}", parameter=f"{SPRINGS}[{k}]")
    density = "density" if structure.starts_in_plane else "density_factor"
    yield Fault(name="mass added", parameter=density, change="rises")
    yield Fault(name="mass lost", parameter=density)
    for k in range(1, structure.n_sensors + 1):
        yield Fault(name=f"sensor {k} loose", parameter=f"sensor[{k}]")


def with_faults(forward: Forward, faults: Sequence[Fault] | Literal["known"]) -> MembraneForward:
    """Return a membrane that may have faults.

    Raises
    ------
    ParameterError
        It is no membrane of a setup, or a fault acts on what it does not have.
    """
    if not isinstance(forward, MembraneForward) or forward.gauges is not None:
        msg = "faults are those of the membrane of a setup. Give that, not another forward model."
        raise ParameterError(msg)
    structure = with_factors(forward.structure, SCALABLE)
    these = known_faults(structure) if faults == "known" else tuple(faults)
    return MembraneForward(structure, {**forward.parameters, **forward.inputs}, faults=these)
