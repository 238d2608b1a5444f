"""Read an SSP archive, whoever wrote it, as a scenario.

Its system structure becomes a network: FMUs, their connectors, what feeds them, and the values given to them. Nested systems
are flattened: their connectors are only followed through. What is no signal or value of an FMU is refused by name.

Symbols: a *node* is a connector, ``(place, name)``, where ``place`` names the elements from the root system down to its
owner; ``feeds`` leads from a node to the one that feeds it; ``values`` holds what parameter bindings give to nodes.

Along a connection units are converted, then its linear transformation is applied, as SSP prescribes.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gossamer_files.options import option
from lxml import etree

from ..errors import OrchestratorError
from ..fmi.archive import unpack
from ..fmi.file import FmuFile
from ..fmi.types import conversion, parse
from ..scenario.connections import find_cycle, sort_components
from ..scenario.load import make_scenario
from ..scenario.schema import Connection, Scenario, Value
from ..scenario.source import Source
from .ssp_files import ANNOTATION, KEPT, SSP, STRUCTURE, BoundValue, SspFiles, definitions, read_bindings, transformation

logger = logging.getLogger(__name__)

_FMU_TYPES = (None, "application/x-fmu-sharedlibrary")
_SENDS = {"output": True, "calculatedParameter": True, "input": False, "parameter": False}

Place = tuple[str, ...]
Node = tuple[Place, str]


@dataclass(frozen=True)
class Feed:
    """The source of a node; units are converted before gain and bias, unless the connection suppresses it."""

    feeder: Node
    gain: float
    bias: float
    converts: bool


class Network:
    """A system structure, by node or by place.

    Parameters
    ----------
    files : SspFiles
        The unpacked SSP.
    root : lxml.etree.Element
        Its structure.

    Attributes
    ----------
    names, fmus : dict
        Name in the scenario and FMU of every component, by place.
    kinds, units, feeds, values : dict
        Kind of connector, definition of its unit, what feeds it and what it is given, by node.
    """

    def __init__(self, files: SspFiles, root: Any) -> None:  # noqa: ANN401
        self.files = files
        self.names: dict[Place, str] = {}
        self.fmus: dict[Place, FmuFile] = {}
        self.kinds: dict[Node, str] = {}
        self.units: dict[Node, Any] = {}
        self.feeds: dict[Node, Feed] = {}
        self.values: dict[Node, BoundValue] = {}
        self._bound: list[tuple[str, BoundValue]] = []
        self._read_system(root.find("{*}System"), (), definitions(files, root))
        if not self.fmus:
            files.refuse("it holds no FMU", "Add one")
        nodes = {dotted(node): node for node in self.kinds}
        for name, given in self._bound:
            if name in nodes:
                self.values[nodes[name]] = given
            else:
                logger.warning("%s: a value is given to %r, which is not there; it is ignored", files.name, name)

    def endpoint(self, node: Node) -> str:
        """Return the name of an FMU's variable in the scenario."""
        return f"{self.names[node[0]]}.{node[1]}"

    def chain(self, node: Node) -> list[Node]:
        """List the nodes from one back to where its signal begins."""
        chain = [node]
        while chain[-1] in self.feeds:
            chain.append(self.feeds[chain[-1]].feeder)
            if chain[-1] in chain[:-1]:
                self.files.refuse(
                    f"connectors feed each other in a circle at {dotted(node)!r}", "Remove one of their connections"
                )
        return chain

    def transfer(self, chain: list[Node]) -> tuple[float, float]:
        """Return gain and bias from the last node of a chain to its first."""
        unit, gain, bias = self.units.get(chain[-1]), 1.0, 0.0
        for node in reversed(chain[:-1]):
            feed, own = self.feeds[node], self.units.get(node)
            factor, offset = (conversion(unit, own) if feed.converts else None) or (1.0, 0.0)
            gain, bias = feed.gain * factor * gain, feed.gain * (factor * bias + offset) + feed.bias
            unit = unit if own is None else own
        return gain, bias

    def value(self, node: Node) -> Value | None:
        """Return what a parameter or an unconnected input is given; None leaves the FMU's start value."""
        chain, variable = self.chain(node), self.fmus[node[0]].variables[node[1]]
        while len(chain) > 1 and chain[-1] not in self.values:
            chain.pop()
        given = self.values.get(chain[-1])
        if given is None:
            start = variable.start if variable.causality == "input" else None
            own: Any = start if start is None or variable.type == "Binary" else parse(variable.type, start)
            return own  # type: ignore[no-any-return]
        if variable.type == "Enumeration":
            self.files.refuse(f"{dotted(node)!r} is an enumeration", "Leave it at the FMU's start value")
        if not isinstance(given.value, float):
            return given.value
        gain, bias = self.transfer(chain)
        return gain * given.converted(self.units.get(chain[-1])) + bias

    def _read_system(self, system: Any, place: Place, units: dict[str, Any]) -> None:  # noqa: ANN401
        """Read a system, its elements first: bindings of a higher level replace those of a lower one."""
        self._read_connectors(system, place, units)
        for child in system.iterfind("{*}Elements/*"):
            kind = etree.QName(child).localname
            if kind not in ("System", "Component"):
                self.files.refuse(f"it has a {kind} {child.get('name')!r}", "Connect its signals directly")
            read = self._read_system if kind == "System" else self._read_component
            read(child, (*place, child.attrib["name"]), units)
        for connection in system.iterfind("{*}Connections/{*}Connection"):
            self._read_connection(connection, place)
        self._bind(system, place, ".".join(place) or "the root system")

    def _read_component(self, component: Any, place: Place, units: dict[str, Any]) -> None:  # noqa: ANN401
        label, kind, source = ".".join(place), component.get("type"), component.get("source", "")
        if kind not in _FMU_TYPES or not source.endswith(".fmu"):
            what = repr(source if kind in _FMU_TYPES else kind)
            self.files.refuse(f"component {label!r} is not an FMU but {what}", "Replace it by FMUs")
        path = self.files.find(source, f"the source of component {label!r}")
        same = [fmu for fmu in self.fmus.values() if fmu.path == path]
        fmu = self.fmus[place] = same[0] if same else FmuFile(path)
        name = re.sub(r"\W", "_", "_".join(place), flags=re.ASCII)
        name = f"_{name}" if name[0].isdigit() else name
        while name in self.names.values():
            name += "_"
        self.names[place] = name
        if name != label:
            logger.warning("%s: component %r is renamed to %r", self.files.name, label, name)
        self._read_connectors(component, place, units)
        for variable, description in fmu.variables.items():
            self.kinds[place, variable] = description.causality
            unit = fmu.unit_definition(variable)
            if unit is not None:
                self.units[place, variable] = unit
        self._bind(component, place, f"component {label!r}")

    def _read_connectors(self, element: Any, place: Place, units: dict[str, Any]) -> None:  # noqa: ANN401
        for connector in element.iterfind("{*}Connectors/{*}Connector"):
            node = place, connector.attrib["name"]
            self.kinds[node] = connector.attrib["kind"]
            for kind in connector:
                if (unit := units.get(kind.get("unit", ""))) is not None:
                    self.units[node] = unit

    def _read_connection(self, connection: Any, place: Place) -> None:  # noqa: ANN401
        """Read a connection, which may be written in either direction."""
        start, end = (
            ((*place, *filter(None, [connection.get(f"{which}Element")])), connection.attrib[f"{which}Connector"])
            for which in ("start", "end")
        )
        label = f"connection {dotted(start)!r} to {dotted(end)!r}"
        sends = []
        for node in (start, end):
            kind = self.kinds.get(node)
            if kind not in _SENDS:
                what = "is not there" if kind is None else f"is of kind {kind!r}"
                self.files.refuse(f"{label}: {dotted(node)!r} {what}", "Connect an output to an input")
            sends.append(_SENDS[kind or ""] != (node[0] == place))  # seen from inside, a system's input sends
        if sends == [False, True]:
            start, end = end, start
        elif sends != [True, False]:
            self.files.refuse(f"{label} joins two {'outputs' if sends[0] else 'inputs'}", "Connect an output to an input")
        if end in self.feeds:
            self.files.refuse(f"{dotted(end)!r} is connected twice", "Remove one of its connections")
        kind, gain, bias, converts = transformation(connection)
        if kind not in ("", "LinearTransformation"):
            self.files.refuse(f"{label} has a {kind}", "Use a linear transformation of Reals")
        self.feeds[end] = Feed(start, gain, bias, converts)

    def _bind(self, element: Any, place: Place, owner: str) -> None:  # noqa: ANN401
        """Keep the values that the bindings of a component or system give, by their names from the root system."""
        found = read_bindings(self.files, element, owner)
        self._bound += [(dotted((place, name)), given) for name, given in found.items()]


def dotted(node: Node) -> str:
    """Write a node as messages show it."""
    return ".".join((*node[0], node[1]))


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
        The archive is dangerous or damaged, or needs what this program cannot do; the message names the part.
    """
    path = Path(path)
    with TemporaryDirectory(prefix="gossamer-", ignore_cleanup_errors=True) as name, _naming(path.name, Path(name)):
        unpack(path, Path(name), SSP)
        files = SspFiles(path.name, Path(name))
        try:
            scenario = _read_scenario(files, step, stop)
        except OrchestratorError:
            raise
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            # something that the schema requires is missing, or is no number
            files.refuse_unread(error)
        yield scenario


@contextmanager
def _naming(archive: str, folder: Path) -> Iterator[None]:
    """Name files by their place in the archive in errors of the ``with`` block, not by the folder it is unpacked into."""
    try:
        yield
    except OrchestratorError as error:
        for place in (str(folder.resolve()), str(folder)):
            error.args = tuple(str(text).replace(place, archive) for text in error.args)
        raise


def _read_scenario(files: SspFiles, step: float | None, stop: float | None) -> Scenario:
    """Read the structure and put the scenario together."""
    root = files.root(files.folder / STRUCTURE, "SystemStructureDescription")
    if root.find("{*}System") is None:
        files.refuse("its system structure holds no system", "Ask its author for a complete one")
    network = Network(files, root)
    content = _annotation(files, root)
    connections = _connections(network)
    if "order" not in content and content.get("master") != "jacobi":
        content |= _order(network, connections)
    times = {key: float(text) for e in root.findall("{*}DefaultExperiment") for key, text in e.items() if "Time" in key}
    start = times.get("startTime", 0.0)
    stop = times.get("stopTime") if stop is None else stop
    content |= {
        "title": root.get("description", ""),
        "start": start,
        "step": _step(network, root) if step is None else step,
        "stop": _preferred(network, "stopTime", "stop time", max, above=start) if stop is None else stop,
        "components": _components(network, {c.target for c in connections}),
        "connections": connections,
    }
    return make_scenario(content, source=Source(files.name, ""), folder=files.folder)


def _connections(network: Network) -> list[Connection]:
    """Follow every FMU's input back to the output that feeds it."""
    connections = []
    for node, feed in network.feeds.items():
        chain = network.chain(node)
        first = chain[-1]
        if node[0] not in network.fmus or first[0] not in network.fmus:
            continue
        if (network.kinds[first], network.kinds[node]) != ("output", "input"):
            label = f"{dotted(first)!r} to {dotted(node)!r}"
            network.files.refuse(f"connection {label} sets a parameter", "Give the parameter a value instead")
        gain, bias = network.transfer(chain)
        content: dict[str, Any] = {"from": network.endpoint(first), "to": network.endpoint(node)}
        if (gain, bias) != (1.0, 0.0) or not feed.converts:
            content |= {"gain": gain if gain != 1.0 or not bias else None, "bias": bias or None}
        connections.append(Connection.model_validate(content))
    return connections


def _components(network: Network, connected: set[str]) -> dict[str, Any]:
    for node in network.values:
        if node[0] in network.fmus and network.kinds[node] not in ("input", "parameter"):
            what = f"a value is given to {dotted(node)!r}, which is of kind {network.kinds[node]!r}"
            network.files.refuse(what, "Only inputs and parameters can be given values")
    components = {}
    for place, fmu in network.fmus.items():
        tables: dict[str, dict[str, Value]] = {"parameters": {}, "inputs": {}}
        for table, given in tables.items():
            for variable in fmu.names(table.removesuffix("s")):
                value = network.value((place, variable))
                if value is not None and network.endpoint((place, variable)) not in connected:
                    given[variable] = value
        source = fmu.path.relative_to(network.files.folder.resolve()).as_posix()
        components[network.names[place]] = {"fmu": source, **tables}
    return components


def _order(network: Network, connections: list[Connection]) -> dict[str, Any]:
    """Choose an order if FMUs feed each other in a circle, because SSP does not state one."""
    feeds = {name: [c.receiver for c in connections if c.sender == name] for name in network.names.values()}
    if not find_cycle(feeds):
        return {}
    order = sort_components(feeds, feeds)
    logger.warning("%s: FMUs feed each other; they step in the order %s", network.files.name, ", ".join(order))
    return {"order": order}


def _annotation(files: SspFiles, root: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return what ``export_ssp`` has kept for the way back."""
    for annotation in root.iterfind("{*}System/{*}Annotations/{*}Annotation"):
        if annotation.get("type") == ANNOTATION:
            try:
                content = json.loads(annotation.text or "")
                version = content.pop("version")
            except (ValueError, AttributeError, KeyError, TypeError, RecursionError) as error:
                files.refuse(f"its annotation {ANNOTATION!r} cannot be read: {error!r}", "Remove it")
            if version != 1:
                files.refuse(f"its annotation {ANNOTATION!r} is of version {version!r}, not 1", "Remove it")
            return {key: value for key, value in content.items() if key in KEPT}
    return {}


def _step(network: Network, root: Any) -> float:  # noqa: ANN401
    """Return the step that the archive states for libcosim or OMSimulator, else the smallest that an FMU prefers."""
    for algorithm in root.iter("{*}FixedStepAlgorithm", "{*}FixedStepMaster"):
        return float(algorithm.get("baseStepSize") or algorithm.get("stepSize"))
    return _preferred(network, "stepSize", "step", min)


def _preferred(network: Network, key: str, name: str, pick: Callable[[list[float]], float], above: float = 0.0) -> float:
    """Return what the FMUs prefer of a number that the archive does not state."""
    experiments = [fmu.description.defaultExperiment for fmu in network.fmus.values()]
    found = [float(number) for e in experiments if (number := getattr(e, key, None)) is not None]
    numbers = [number for number in found if number > above]
    named = option(name.split()[0])
    if not numbers:
        network.files.refuse(f"neither it nor its FMUs state a {name}", f"Name one with {named}")
    picked = pick(numbers)
    message = "%s states no %s: %g s is taken, the %s of its FMUs. Another can be named with %s"
    logger.warning(message, network.files.name, name, picked, "smallest" if pick is min else "largest", named)
    return picked
