"""Read an SSP (1.0) archive, whoever wrote it, as a scenario.

Symbols: a *node* is a connector, ``(path, name)``, where ``path`` names the elements from the root system down to its
owner; ``wires`` leads from a node to the one that feeds it; ``values`` holds what parameter bindings give to nodes.

Nested systems are flattened: their connectors are only followed through. Along a connection units are converted, then
its linear transformation is applied, as SSP prescribes. What is no signal or value of an FMU is refused by name.
"""

from __future__ import annotations

import json
import logging
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from .archive import check_archive, unpack
from .errors import OrchestratorError, ScenarioError
from .fmu import FmuFile
from .graph import find_cycle, sort_components
from .names import split_endpoint
from .scenario import Scenario, Value, make_scenario
from .source import Source
from .ssp import ANNOTATION, KEPT
from .ssp_files import SspFiles
from .ssp_parameters import Given, convert, definitions, read_bindings
from .units import factors

logger = logging.getLogger(__name__)

STRUCTURE = "SystemStructure.ssd"
_FMU_TYPES = (None, "application/x-fmu-sharedlibrary")
_SENDS = {"output": True, "calculatedParameter": True, "input": False, "parameter": False}

Place = tuple[str, ...]
Node = tuple[Place, str]


@contextmanager
def open_ssp(path: Path, *, step: float | None = None, stop: float | None = None) -> Iterator[Scenario]:
    """Unpack an ``.ssp`` into a temporary folder and describe it as a scenario.

    Parameters
    ----------
    path : Path
        The file; it is not trusted.
    step, stop : float or None
        Communication step and last time [s] in place of those of the file.

    Yields
    ------
    Scenario
        Its FMUs are in the temporary folder, so it can be used inside the ``with`` block only.

    Raises
    ------
    ScenarioError
        The archive is dangerous or damaged, or says what this program cannot do; with the name at fault.
    """
    path = Path(path)
    check_archive(path, kind="SSP", needs=STRUCTURE, failure=ScenarioError)
    with TemporaryDirectory(prefix="gossamer-", ignore_cleanup_errors=True) as name:
        unpack(path, Path(name), failure=ScenarioError)
        files = SspFiles(path.name, Path(name))
        try:
            scenario = _Reader(files).scenario(step, stop)
        except OrchestratorError:
            raise
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            # something that the schema requires is missing, or is no number
            reason = files.schema_reason(files.folder / STRUCTURE) or f"{type(error).__name__}: {error}"
            files.refuse(f"its system structure cannot be understood: {reason}", "Correct it by SSP's schema")
        yield scenario


@dataclass(frozen=True)
class _Wire:
    """What feeds a node; units are converted before gain and bias, unless the connection says no."""

    origin: Node
    gain: float
    bias: float
    converts: bool


class _Reader:
    """Everything that an SSP says, by node or by place."""

    def __init__(self, files: SspFiles) -> None:
        self.files = files
        self.names: dict[Place, str] = {}
        self.sources: dict[Place, str] = {}
        self.fmus: dict[Place, FmuFile] = {}
        self.systems: list[Place] = []
        self.kinds: dict[Node, str] = {}
        self.units: dict[Node, Any] = {}
        self.wires: dict[Node, _Wire] = {}
        self.values: dict[Node, Given] = {}

    def scenario(self, step: float | None, stop: float | None) -> Scenario:
        """Read the structure and put the scenario together."""
        from pyssp_standard.ssd import SSD

        ssd = self.files.read(SSD, self.files.folder / STRUCTURE)
        if ssd.system is None:
            self.files.refuse("its system structure holds no system", "Ask its author for a complete one")
        root = self.files.parse(self.files.folder / STRUCTURE).getroot()  # pyssp-standard leaves out transformations
        self._read_system(ssd.system, root.find("{*}System"), (), definitions(self.files, ssd.units))
        if not self.fmus:
            self.files.refuse("it holds no FMU", "There is nothing to run")
        content = self._annotation(root)
        connections = self._connections()
        if "order" not in content and content.get("master") != "jacobi":
            content |= self._order(connections)
        experiment = ssd.default_experiment
        start = 0.0 if experiment is None or math.isnan(experiment.start_time) else experiment.start_time
        last = None if experiment is None or math.isnan(experiment.stop_time) else experiment.stop_time
        content |= {
            "title": ssd.base_element.description or "",
            "start": start,
            "step": self._step(root) if step is None else step,
            "stop": (self._stop(start) if last is None else last) if stop is None else stop,
            "components": self._components({c["to"] for c in connections}),
            "connections": connections,
        }
        return make_scenario(content, source=Source(self.files.name, ""), folder=self.files.folder)

    # structure

    def _read_system(self, system: Any, element: Any, place: Place, units: dict[str, Any]) -> None:  # noqa: ANN401
        """Read a system, its elements first: bindings of a higher level replace those of a lower one."""
        from pyssp_standard.ssd import Component, System

        self.systems.append(place)
        self._read_connectors(system.connectors, place, units)
        for child, xml in zip(system.elements, element.iterfind("{*}Elements/*"), strict=True):
            if isinstance(child, System):
                self._read_system(child, xml, (*place, child.name), units)
            elif isinstance(child, Component):
                self._read_component(child, (*place, child.name), units)
            else:
                what = f"{xml.tag.rpartition('}')[2]} {xml.get('name')!r}"
                self.files.refuse(f"it has a {what}", "Connect its signals directly")
        for connection, xml in zip(system.connections, element.iterfind("{*}Connections/*"), strict=True):
            self._read_connection(connection, xml, place)
        self._set(read_bindings(self.files, system.parameter_bindings, ".".join(place) or "the root system"), place)

    def _read_component(self, component: Any, place: Place, units: dict[str, Any]) -> None:  # noqa: ANN401
        label, kind, source = ".".join(place), component.component_type, component.source or ""
        if kind not in _FMU_TYPES or not source.endswith(".fmu"):
            what = repr(source if kind in _FMU_TYPES else kind)
            self.files.refuse(f"component {label!r} is no FMU but {what}", "Put FMUs in its place")
        path = self.files.find(source, f"the source of component {label!r}")
        same = [fmu for fmu in self.fmus.values() if fmu.path == path]
        fmu = self.fmus[place] = same[0] if same else FmuFile(path)
        self.sources[place] = path.relative_to(self.files.folder.resolve()).as_posix()
        name = re.sub(r"\W", "_", "_".join(place), flags=re.ASCII)
        name = f"_{name}" if name[0].isdigit() else name
        while name in self.names.values():
            name += "_"
        self.names[place] = name
        if name != label:
            logger.warning("%s: component %r is called %r here", self.files.name, label, name)
        self._read_connectors(component.connectors, place, units)
        for variable, description in fmu.variables.items():
            self.kinds[place, variable] = description.causality
            unit = fmu.units.get(fmu.unit(variable) or "")
            if unit is not None:
                self.units[place, variable] = unit
        self._set(read_bindings(self.files, component.parameter_bindings, f"component {label!r}"), place)

    def _read_connectors(self, connectors: Iterable[Any], place: Place, units: dict[str, Any]) -> None:
        for connector in connectors:
            self.kinds[place, connector.name] = connector.kind
            unit = units.get(getattr(connector.type_, "unit", None) or "")
            if unit is not None:
                self.units[place, connector.name] = unit

    def _read_connection(self, connection: Any, xml: Any, place: Place) -> None:  # noqa: ANN401
        """Read a connection, which may be written in either direction."""
        start: Node = self._child(place, connection.start_element), connection.start_connector
        end: Node = self._child(place, connection.end_element), connection.end_connector
        label = f"connection {_text(start)!r} to {_text(end)!r}"
        sends = []
        for node in (start, end):
            kind = self.kinds.get(node)
            if kind not in _SENDS:
                what = "is not there" if kind is None else f"is of kind {kind!r}"
                self.files.refuse(f"{label}: {_text(node)!r} {what}", "Connect an output to an input")
            sends.append(_SENDS[kind or ""] != (node[0] == place))  # seen from inside, a system's input sends
        if sends == [False, True]:
            start, end = end, start
        elif sends != [True, False]:
            self.files.refuse(
                f"{label} joins two {'outputs' if sends[0] else 'inputs'}", "Connect an output to an input"
            )
        if end in self.wires:
            self.files.refuse(f"{_text(end)!r} is connected twice", "Remove one of its connections")
        gain, bias = 1.0, 0.0
        for child in xml:
            tag = child.tag.rpartition("}")[2]
            if tag == "LinearTransformation":
                gain, bias = float(child.get("factor", 1.0)), float(child.get("offset", 0.0))
            elif tag.endswith("Transformation"):
                self.files.refuse(f"{label} has a {tag}", "Only linear transformations of Reals can be run")
        self.wires[end] = _Wire(start, gain, bias, xml.get("suppressUnitConversion") not in ("true", "1"))

    def _child(self, place: Place, element: str | None) -> Place:
        return (*place, element) if element else place

    def _set(self, found: dict[str, Given], place: Place) -> None:
        """Give values to nodes by their hierarchical names below a place."""
        for name, given in found.items():
            node = self._node(place, name)
            if node is None:
                text = ".".join((*place, name))
                logger.warning("%s: there is no %r to give a value to; it is ignored", self.files.name, text)
            else:
                self.values[node] = given

    def _node(self, place: Place, name: str) -> Node | None:
        if (place, name) in self.kinds:
            return place, name
        below = [p for p in (*self.systems, *self.fmus) if p[:-1] == place != p and name.startswith(f"{p[-1]}.")]
        found = [self._node(p, name.removeprefix(f"{p[-1]}.")) for p in below]
        return next((node for node in found if node is not None), None)

    # from nodes to components and connections

    def _connections(self) -> list[dict[str, Any]]:
        """Follow the wire of every FMU's input to where it begins."""
        connections = []
        for node, wire in self.wires.items():
            chain = self._chain(node)
            origin = chain[-1]
            if node[0] not in self.fmus or origin[0] not in self.fmus:
                continue
            if (self.kinds[origin], self.kinds[node]) != ("output", "input"):
                text = f"{_text(origin)!r} to {_text(node)!r}"
                self.files.refuse(f"connection {text} sets a parameter", "Give the parameter a value instead")
            gain, bias = self._transfer(chain)
            ends = ((end, f"{self.names[place]}.{v}") for end, (place, v) in (("from", origin), ("to", node)))
            connection: dict[str, Any] = dict(ends)
            if (gain, bias) != (1.0, 0.0) or not wire.converts:
                connection |= ({"gain": gain} if gain != 1.0 or not bias else {}) | ({"bias": bias} if bias else {})
            connections.append(connection)
        return connections

    def _chain(self, node: Node) -> list[Node]:
        """List the nodes from one back to where its signal begins."""
        chain = [node]
        while chain[-1] in self.wires:
            chain.append(self.wires[chain[-1]].origin)
            if chain[-1] in chain[:-1]:
                self.files.refuse(f"connectors feed each other in a circle at {_text(node)!r}", "Cut it")
        return chain

    def _transfer(self, chain: list[Node]) -> tuple[float, float]:
        """Return gain and bias from the last node of a chain to its first."""
        unit, gain, bias = self.units.get(chain[-1]), 1.0, 0.0
        for node in reversed(chain[:-1]):
            wire, own = self.wires[node], self.units.get(node)
            factor, offset = (factors(unit, own) if wire.converts else None) or (1.0, 0.0)
            gain, bias = wire.gain * factor * gain, wire.gain * (factor * bias + offset) + wire.bias
            unit = unit if own is None else own
        return gain, bias

    def _components(self, connected: set[str]) -> dict[str, Any]:
        for node in self.values:
            if node[0] in self.fmus and self.kinds[node] not in ("input", "parameter"):
                what = f"a value is given to {_text(node)!r}, which is of kind {self.kinds[node]!r}"
                self.files.refuse(what, "Only inputs and parameters can be given values")
        components = {}
        for place, fmu in self.fmus.items():
            tables: dict[str, dict[str, Value]] = {"parameters": {}, "inputs": {}}
            for table, causality in (("parameters", "parameter"), ("inputs", "input")):
                for variable in fmu.names(causality):
                    value = self._value((place, variable))
                    if value is not None and f"{self.names[place]}.{variable}" not in connected:
                        tables[table][variable] = value
            components[self.names[place]] = {"fmu": self.sources[place], **tables}
        return components

    def _value(self, node: Node) -> Value | None:
        """Return what a parameter or an unconnected input is given; None leaves the FMU's start value."""
        chain, variable = self._chain(node), self.fmus[node[0]].variables[node[1]]
        while len(chain) > 1 and chain[-1] not in self.values:
            chain.pop()
        given = self.values.get(chain[-1])
        if given is None:
            start = variable.start if variable.causality == "input" else None
            return None if start is None else convert(variable.type, start)
        if variable.type == "Enumeration":
            self.files.refuse(f"{_text(node)!r} is an enumeration", "Leave it at the FMU's start value")
        value = given.converted(self.units.get(chain[-1]))
        if not isinstance(value, float):
            return value
        gain, bias = self._transfer(chain)
        return gain * value + bias

    def _order(self, connections: list[dict[str, Any]]) -> dict[str, Any]:
        """Choose an order where FMUs feed each other in a circle; SSP does not state one."""
        feeds: dict[str, list[str]] = {name: [] for name in self.names.values()}
        for connection in connections:
            feeds[split_endpoint(connection["from"])[0]].append(split_endpoint(connection["to"])[0])
        if not find_cycle(feeds):
            return {}
        order = sort_components(feeds, feeds)
        logger.warning("%s: FMUs feed each other; they step in the order %s", self.files.name, ", ".join(order))
        return {"order": order}

    # experiment

    def _annotation(self, root: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return what ``export_ssp`` has kept for the way back."""
        for annotation in root.iterfind("{*}System/{*}Annotations/{*}Annotation"):
            if annotation.get("type") == ANNOTATION:
                try:
                    content = json.loads(annotation.text or "")
                    version = content.pop("version")
                except (ValueError, AttributeError, KeyError, TypeError, RecursionError) as error:
                    self.files.refuse(f"its annotation {ANNOTATION!r} cannot be read: {error!r}", "Remove it")
                if version != 1:
                    self.files.refuse(f"its annotation {ANNOTATION!r} is of version {version!r}, not 1", "Remove it")
                return {key: value for key, value in content.items() if key in KEPT}
        return {}

    def _step(self, root: Any) -> float:  # noqa: ANN401
        """Return the step that the archive states for libcosim or OMSimulator, else the smallest that an FMU prefers."""
        for algorithm in root.iter("{*}FixedStepAlgorithm", "{*}FixedStepMaster"):
            return float(algorithm.get("baseStepSize") or algorithm.get("stepSize"))
        steps = self._preferred("stepSize")
        if not steps:
            self.files.refuse("neither it nor its FMUs state a step", "Name one with --step")
        logger.warning(
            "%s states no step: %g s, the smallest of its FMUs. Or name one with --step", self.files.name, min(steps)
        )
        return min(steps)

    def _stop(self, start: float) -> float:
        """Return the last time that an FMU prefers; the archive states none."""
        times = [time for time in self._preferred("stopTime") if time > start]
        if not times:
            self.files.refuse("neither it nor its FMUs state a stop time", "Name one with --stop")
        logger.warning(
            "%s states no stop time: %g s, from its FMUs. Or name one with --stop", self.files.name, max(times)
        )
        return max(times)

    def _preferred(self, key: str) -> list[float]:
        experiments = [fmu.description.defaultExperiment for fmu in self.fmus.values()]
        found = [getattr(experiment, key, None) for experiment in experiments]
        return [float(text) for text in found if text is not None]


def _text(node: Node) -> str:
    return ".".join((*node[0], node[1]))
