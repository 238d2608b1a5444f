"""Write a scenario and its FMUs as an SSP archive; what other formats cannot express of a scenario.

Written is the subset that other tools read: one flat system without connectors of its own, every input connected or given
a value, Reals only, and for each component one parameter set, named ``initialValues``, inside the system structure. What
SSP has no place for stands in annotations: the step in that of the Open Simulation Platform, whose tools read it; master,
order, groups and record in one of type ``ANNOTATION``.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Collection, Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from gossamer_files import write_archive
from gossamer_files.options import option
from lxml import etree
from pyssp_standard.common_content_ssc import Annotation, TypeReal
from pyssp_standard.parameter_types import ParameterType
from pyssp_standard.ssd import SSD, Component, Connection, Connector, DefaultExperiment, ParameterBinding, System
from pyssp_standard.ssv import Parameter, SSVElem
from pyssp_standard.transformation_types import Transformation
from pyssp_standard.unit import BaseUnit, Unit
from pyssp_standard.utils import register_namespaces

from ..errors import ScenarioError, require, writing
from ..fmi.archive import check_target
from ..fmi.file import FmuFile
from ..fmi.types import scale
from ..scenario import schema
from ..scenario.plan import ComponentPlan, Plan, make_plan
from ..scenario.schema import Scenario
from ..scenario.source import Problems
from ..words import first_few
from .ssp_files import ANNOTATION, KEPT, STRUCTURE

logger = logging.getLogger(__name__)

_OSP = "com.opensimulationplatform"
_OSP_NAMESPACE = "http://opensimulationplatform.com/SSP/OSPAnnotations"


def export_ssp(scenario: schema.Scenario, fmus: Path, out: Path) -> Path:
    """Write a scenario and its FMUs as one ``.ssp``.

    Parameters
    ----------
    scenario : Scenario
        What to write.
    fmus : Path
        Folder in which FMUs are looked up by name.
    out : Path
        The file to write; the same scenario and FMUs give the same bytes.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ScenarioError
        The scenario is wrong, or has keys that SSP cannot express; each with its line.
    """
    out = Path(out)
    check_target(out, ".ssp")
    with closing(make_plan(scenario, Path(fmus))) as plan:
        _refuse_inexpressible(plan)
        sources = _sources(plan.files)
        members = {STRUCTURE: _structure(plan, sources)}
        members |= {source: file.path.read_bytes() for file, source in sources.items()}
    with writing(out):
        write_archive(out, members)
    return out


def _refuse_inexpressible(plan: Plan) -> None:
    """Report everything that SSP, or the subset that other tools read, cannot express."""
    advice = "or give its value as an input from the start"
    problems = inexpressible(plan.scenario, "SSP", {"noise": None, "dropout": None}, advice)
    for c in plan.connections:
        for end, name, variable in ((c.origin, c.sender, c.output), (c.target, c.receiver, c.input)):
            kind = plan.component(name).fmu.variables[variable].type
            if kind != "Real":
                text = f"{end!r} is of type {kind}, but other tools connect only Reals of an SSP. Remove the connection."
                problems.add(("connections",), text)
    for component in plan.components:
        for name, value in component.start.items():
            variable = component.fmu.variables[name]
            if variable.type != "Real" and str(value).lower() != str(variable.start).lower():
                table = "inputs" if variable.causality == "input" else "parameters"
                problems.add(
                    ("components", component.name, table, name),
                    f"{component.name}.{name} = {value!r} is a {variable.type}, but other tools read only Reals "
                    f"from an SSP. Leave it at the FMU's start value, {variable.start!r}.",
                )
    problems.raise_if_any()
    if names := [file.name for file in plan.files if file.arrays]:
        logger.warning(
            "%s: SSP 1.0 has no arrays, so those of FMI 3.0 are written element by element, 'strain[1]' and so on. "
            "'gossamer run' reads that; other tools may not. FMUs of FMI 2.0 work in all of them",
            ", ".join(names),
        )
    if clocks := [f"{c.name}.{clock}" for c in plan.components for clock in c.fmu.clocks]:
        logger.warning("SSP keeps the clocks inside their FMUs, and not every tool ticks them: %s", first_few(clocks))


def _sources(files: Iterable[FmuFile]) -> dict[FmuFile, str]:
    """Name the FMUs in the archive; two files of one name get numbers."""
    sources: dict[FmuFile, str] = {}
    for file in files:
        name, number = f"resources/{file.name}.fmu", 2
        while name in sources.values():
            name, number = f"resources/{file.name}_{number}.fmu", number + 1
        sources[file] = name
    return sources


def _structure(plan: Plan, sources: dict[FmuFile, str]) -> bytes:
    """Write the system structure through pyssp-standard."""
    scenario = plan.scenario
    register_namespaces()
    ssd = SSD(STRUCTURE, mode="w")
    ssd.name, ssd.version = scenario.name, "1.0"
    ssd.top_level_metadata.generationTool = "Gossamer"
    ssd.top_level_metadata.generationDateAndTime = ""  # the same scenario gives the same bytes
    ssd.base_element.description = scenario.title
    ssd.system = System(name=re.sub(r"\W", "_", scenario.name, flags=re.ASCII))
    by_name = {c.name: c for c in plan.components}
    ssd.system.elements = [_component(by_name[name], sources, ssd.units) for name in scenario.components]
    ssd.system.connections = [
        Connection(start_element=c.sender, start_connector=c.output, end_element=c.receiver, end_connector=c.input)
        for c in plan.connections
    ]
    rest = scenario.model_dump(include=KEPT, exclude_defaults=True)
    annotation = Annotation(ANNOTATION)
    annotation.add_text(json.dumps({"version": 1, **rest}))
    ssd.system.annotations.add_annotation(annotation)
    ssd.default_experiment = DefaultExperiment()
    ssd.default_experiment.start_time, ssd.default_experiment.stop_time = scenario.start, scenario.stop
    ssd.default_experiment.annotations.add_annotation(_osp_step(scenario.step))
    ssd.__write__()
    for element, connection in zip(ssd.root.iter("{*}Connection"), plan.connections, strict=True):
        _transform(element, connection)
    ssd.root.append(ssd.root.find("ssd:DefaultExperiment", ssd.namespaces))  # after the units, as the schema wants it
    namespaces = {prefix: ssd.namespaces[prefix] for prefix in ("ssd", "ssc", "ssv")} | {"osp": _OSP_NAMESPACE}
    # libcosim wants them declared at the top, under these names
    etree.cleanup_namespaces(ssd.root, top_nsmap=namespaces)
    return bytes(etree.tostring(ssd.root, pretty_print=True, encoding="utf-8", xml_declaration=True))


def _component(plan: ComponentPlan, sources: dict[FmuFile, str], units: Any) -> Any:  # noqa: ANN401
    """Describe one component: its Real inputs and outputs, the parameters that are set, and their values."""
    component = Component()
    component.name, component.source = plan.name, sources[plan.fmu]
    component.component_type = "application/x-fmu-sharedlibrary"
    component.implementation = "ModelExchange" if plan.fmu.model_exchange else "CoSimulation"
    shown = [
        *plan.fmu.names("input", "output", kind="Real"),
        *(v for v in plan.fmu.names("parameter", kind="Real") if v in plan.start),
    ]
    for name in shown:
        unit, base = plan.fmu.unit(name), plan.fmu.unit_definition(name)
        known = unit is not None and base is not None and declare_unit(units, unit, base)
        kind = plan.fmu.variables[name].causality
        component.connectors.append(Connector(name=name, kind=kind, type_=TypeReal(unit if known else None)))
    start = {name: float(value) for name, value in plan.start.items() if plan.fmu.variables[name].type == "Real"}
    if start:
        values = SSVElem(name="initialValues")
        for name, value in start.items():
            content = ParameterType("Real", {"value": repr(value)})
            content.parameter = {"value": repr(value)}  # without the unit that pyssp-standard 0.9 sets to None
            values.parameters.append(Parameter(name=name, type_name="Real", type_value=content))
        component.parameter_bindings = [ParameterBinding(ssv=values)]
    return component


def _transform(element: Any, connection: schema.Connection) -> None:  # noqa: ANN401
    """Add gain and bias to a written connection; pyssp-standard 0.9 forgets its transformation."""
    if connection.gain is not None or connection.bias is not None:
        factor = 1.0 if connection.gain is None else connection.gain
        values = {"factor": repr(factor), "offset": repr(connection.bias or 0.0)}
        element.append(Transformation("LinearTransformation", values).element())
        element.set("suppressUnitConversion", "true")  # gain and bias convert units too


def _osp_step(step: float) -> Any:  # noqa: ANN401
    """Write the step as libcosim reads it."""
    annotation = Annotation(_OSP)
    algorithm = etree.SubElement(annotation.root, f"{{{_OSP_NAMESPACE}}}Algorithm", nsmap={"osp": _OSP_NAMESPACE})
    etree.SubElement(algorithm, f"{{{_OSP_NAMESPACE}}}FixedStepAlgorithm", baseStepSize=repr(step))
    return annotation


def inexpressible(scenario: Scenario, what: str, keys: Mapping[str, float | None], advice: str) -> Problems:
    """List what a format does not have of the steps, the events and the keys of connections.

    Parameters
    ----------
    scenario : Scenario
        What is to be expressed.
    what : str
        The format, for messages.
    keys : mapping of str to float or None
        Keys that it does not have, with the value that changes nothing.
    advice : str
        What to do about an event, besides removing it.
    """
    problems = Problems(scenario.source)
    for table, things in (("events", "events"), ("inputs", "inputs from files")):
        for i, _ in enumerate(getattr(scenario, table)):
            problems.add((table, i), f"{what} has no {things}. Remove it, {advice}.")
    for name, component in scenario.components.items():
        if component.every > 1:
            text = f"{what} steps all components at once, so it has no 'every'. Remove it."
            problems.add(("components", name, "every"), text)
    if scenario.step_control is not None:
        problems.add(("step_control",), f"{what} has no step control. Remove the table.")
    for i, connection in enumerate(scenario.connections):
        for key, neutral in keys.items():
            if getattr(connection, key) not in (None, neutral):
                problems.add(("connections", i, key), f"{what} has no {key} in its connections. Remove it.")
    if left := ",".join(kind for kind in LEFT if _of_kind(scenario, kind)):
        problems.note = f"{option('without', left)} writes the rest."
    return problems


LEFT = ("noise", "dropout", "events")


def _of_kind(scenario: Scenario, kind: str) -> list[str]:
    """Name what a scenario has of a kind that can be left behind."""
    if kind == "events":
        return [f"event at {event.time:g} s" for event in scenario.events]
    return [f"{kind} of {c.origin} -> {c.target}" for c in scenario.connections if getattr(c, kind)]


def leave_behind(scenario: Scenario, kinds: Collection[str]) -> Scenario:
    """Return a scenario without its noise, dropout or events, those that are named; a warning says what stays behind.

    Raises
    ------
    ScenarioError
        Something else is named.
    """
    for kind in kinds:
        require(kind in LEFT, f"{kind!r} cannot be left behind. Name some of {', '.join(LEFT)}.", ScenarioError)
    left = [text for kind in kinds for text in _of_kind(scenario, kind)]
    if not left:
        return scenario
    logger.warning("%s: this stays behind: %s", scenario.source.name, first_few(left))
    gone = dict.fromkeys(set(kinds) - {"events"})
    kept = [c.model_copy(update=gone) for c in scenario.connections]
    return scenario.model_copy(update={"connections": kept, "events": [] if "events" in kinds else scenario.events})


def declare_unit(units: Any, name: str, base: Any) -> bool:  # noqa: ANN401
    """Define a unit by FMPy's ``BaseUnit`` or None among pyssp-standard's; False if the name has another meaning there."""
    try:
        units.add_unit(Unit(name, None if base is None else BaseUnit(scale(base))))
    except ValueError:
        return False
    return True
