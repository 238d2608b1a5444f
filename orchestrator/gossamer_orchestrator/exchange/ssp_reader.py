"""Read an SSP archive, whoever wrote it, as a scenario.

Nested systems are flattened: their connectors are only followed through. What is no signal or value of an FMU is refused by
name.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pyssp_standard.ssd import SSD

from ..errors import OrchestratorError
from ..fmi.archive import unpack
from ..scenario.graph import find_cycle, sort_components
from ..scenario.load import make_scenario
from ..scenario.schema import Connection, Scenario, Value
from ..scenario.source import Source
from .ssp_files import ANNOTATION, KEPT, SSP, STRUCTURE, SspFiles
from .ssp_network import Network, dotted

logger = logging.getLogger(__name__)


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
    root = files.parse(files.folder / STRUCTURE).getroot()
    ssd = files.read(SSD, files.folder / STRUCTURE)
    if ssd.system is None:
        files.refuse("its system structure holds no system", "Ask its author for a complete one")
    network = Network(files, ssd, root)
    content = _annotation(files, root)
    connections = _connections(network)
    if "order" not in content and content.get("master") != "jacobi":
        content |= _order(network, connections)
    times = {key: float(text) for e in root.findall("{*}DefaultExperiment") for key, text in e.items() if "Time" in key}
    start = times.get("startTime", 0.0)
    stop = times.get("stopTime") if stop is None else stop
    content |= {
        "title": ssd.base_element.description or "",
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
        for table, causality in (("parameters", "parameter"), ("inputs", "input")):
            for variable in fmu.names(causality):
                value = network.value((place, variable))
                if value is not None and network.endpoint((place, variable)) not in connected:
                    tables[table][variable] = value
        source = fmu.path.relative_to(network.files.folder.resolve()).as_posix()
        components[network.names[place]] = {"fmu": source, **tables}
    return components


def _order(network: Network, connections: list[Connection]) -> dict[str, Any]:
    """Choose an order if FMUs feed each other in a circle, because SSP does not state one."""
    names = network.names.values()
    feeds = {name: [c.receiver for c in connections if c.sender == name] for name in names}
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


def _preferred(
    network: Network, key: str, name: str, pick: Callable[[list[float]], float], above: float = 0.0
) -> float:
    """Return what the FMUs prefer of a number that the archive does not state."""
    experiments = [fmu.description.defaultExperiment for fmu in network.fmus.values()]
    found = [float(number) for e in experiments if (number := getattr(e, key, None)) is not None]
    numbers = [number for number in found if number > above]
    option = name.split()[0]
    if not numbers:
        network.files.refuse(f"neither it nor its FMUs state a {name}", f"Name one with --{option}")
    picked = pick(numbers)
    message = "%s states no %s: %g s is taken, the %s of its FMUs. Another can be named with --%s"
    logger.warning(message, network.files.name, name, picked, "smallest" if pick is min else "largest", option)
    return picked
