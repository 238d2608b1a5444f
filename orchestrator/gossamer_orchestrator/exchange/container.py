"""A whole scenario as one FMU, by fmucontainer of the FMU Manipulation Toolbox.

The container steps its FMUs one after another in the order of the scenario's master, each with the outputs just computed,
at the scenario's step: the same numbers as the orchestrator's. Its variables are called ``component.variable``: its
inputs are those that the scenario gives a value, which is their start value, and optional ones; its outputs are those that
no component receives and those that are recorded. Parameters are set as in the scenario and not exposed.

A host may set inputs before the first step. In FMI 3 a container sets those start values that are not the FMUs' own when
initialization begins, so a host replaces these in initialization mode, not before.

fmucontainer 2.0 carries neither units nor ranges into the container, and stamps times and random identifiers; both are
corrected here, so that a build is reproducible.
"""

from __future__ import annotations

import hashlib
import uuid
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fmu_manipulation_toolbox.container import FMUContainer, FMUContainerError
from fmu_manipulation_toolbox.operations import FMUError
from gossamer_files import write_archive
from gossamer_files.inputs import followed
from gossamer_files.options import option
from lxml import etree
from pyssp_standard.unit import Units

from ..errors import ScenarioError, require, writing
from ..fmi.archive import check_target
from ..fmi.file import OPTIONAL
from ..fmi.slave import collect_errors
from ..fmi.types import holds
from ..scenario.plan import Plan, make_plan
from ..scenario.schema import Scenario
from ..words import first_few
from .ssp_writer import declare_unit, inexpressible

_NAMESPACE = uuid.UUID("6c0ac8a6-6d8d-5a15-8f0e-6ed3a6a0c1b4")
_NEUTRAL = {"gain": 1.0, "bias": 0.0, "noise": None, "dropout": None}  # what a container's connections do not have


def build_container(scenario: Scenario, fmus: Path, out: Path, *, fmi: int = 2) -> Path:
    """Merge a scenario and its FMUs into one FMU.

    Parameters
    ----------
    scenario : Scenario
        What to merge.
    fmus : Path
        Folder in which FMUs are looked up by name.
    out : Path
        The FMU to write; the same scenario and FMUs give the same bytes.
    fmi : {2, 3}
        Version of FMI outside.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ScenarioError
        The scenario is wrong, or has keys that a container cannot express; each with its line.
    """
    out = Path(out)
    check_target(out, ".fmu")
    require(fmi in (2, 3), f"a container can be FMI 2 or 3 outside, not {fmi}. Choose one of them.", ScenarioError)
    if not out.stem.isidentifier() or not out.stem.isascii():
        msg = f"{out.name!r} cannot be the name of an FMU's binary. Use letters, digits and underscores, no digit first."
        raise ScenarioError(msg)
    with closing(make_plan(scenario, Path(fmus))) as plan:
        if followed(out) in [followed(file.path) for file in plan.files]:
            msg = f"{out} is one of the scenario's FMUs. Name another file with {option('out')}."
            raise ScenarioError(msg)
        problems = inexpressible(scenario, "a container", _NEUTRAL, "and let the host change the container's input")
        for i, _ in enumerate(scenario.groups):
            problems.add(("groups", i), "a container steps each FMU once, and has no groups. Remove the group.")
        for component in plan.components:
            if component.fmu.arrays:
                text = f"FMU {component.fmu.name!r} has arrays of FMI 3.0, which a container does not take. Use FMI 2.0."
                problems.add(("components", component.name, "fmu"), text)
            if component.fmu.model_exchange:
                text = f"FMU {component.fmu.name!r} is for model exchange, which a container does not integrate."
                problems.add(("components", component.name, "fmu"), f"{text} Export it for co-simulation.")
            if component.fmu.clocks:
                clocks = first_few([*component.fmu.clocks])
                text = f"FMU {component.fmu.name!r} has clocks, which a container does not tick: {clocks}."
                problems.add(("components", component.name, "fmu"), f"{text} Take the FMU out of it.")
        for c in plan.connections:
            sent = plan.component(c.sender).fmu.variables[c.output].type
            received = plan.component(c.receiver).fmu.variables[c.input].type
            if not holds(received, sent):
                text = f"{c.origin!r} is of type {sent} and {c.target!r} of type {received}, and a container does not round."
                problems.add(("connections",), f"{text} Connect variables of one type.")
            if not problems.found and (c.gain not in (None, 1.0) or c.bias not in (None, 0.0)):
                text = f"{c.origin!r} and {c.target!r} have different units, and a container does not convert them."
                problems.add(("connections",), f"{text} Connect variables of one unit.")
        problems.raise_if_any()
        with TemporaryDirectory(prefix="gossamer-") as folder:
            members = _build(plan, Path(folder), out.stem, fmi)
    with writing(out):
        write_archive(out, members)
    return out


class _Container(FMUContainer):  # type: ignore[misc]
    """A container with start values that a host can replace, and with a completed model description."""

    def __init__(self, name: str, folder: Path, plan: Plan, fmi: int) -> None:
        super().__init__(name, folder, fmi_version=fmi)
        self.plan, self.fmi = plan, fmi
        self.start_time, self.stop_time = plan.scenario.start, plan.scenario.stop

    def make_fmu_txt(self, *args: Any, **options: Any) -> None:  # noqa: ANN401
        """Write the configuration such that inputs get their start values once.

        fmucontainer 2.0 sets those of inputs again when initialization ends, over what the host has set by then.
        """
        inputs = [c.port for c in self.start_values if c.port.causality == "input"]
        for port in inputs:
            port.causality = "parameter"
        super().make_fmu_txt(*args, **options)
        for port in inputs:
            port.causality = "input"

    def make_fmu_package(self, base_directory: Path, _name: Path) -> None:
        """Complete the model description and read what is to be packed."""
        text = self.plan.scenario.source.text
        if text:
            (base_directory / "documentation/scenario.toml").write_text(text, encoding="utf-8")
        _complete(base_directory, self.plan, self.fmi)
        self.members = _members(base_directory)


def _build(plan: Plan, folder: Path, name: str, fmi: int) -> dict[str, bytes]:
    """Let fmucontainer merge the FMUs, and return the files of the archive."""
    with collect_errors() as complaints:
        try:
            container = _Container(name, folder, plan, fmi)
            _connect(container, plan)
            container.make_fmu(
                f"{name}.fmu", plan.scenario.step, sequential=plan.scenario.master == "gauss-seidel", profiling=False
            )
        except (FMUContainerError, FMUError) as error:
            complaints.append(str(error))
    if complaints:
        what = f"fmucontainer reports: {'; '.join(complaints)}"
        msg = f"{plan.scenario.source.name}: {what}. Correct the scenario or its FMUs."
        raise ScenarioError(msg)
    return dict(container.members)


def _connect(container: Any, plan: Plan) -> None:  # noqa: ANN401
    """Add FMUs in stepping order, then links, inputs, values and outputs."""
    for component in plan.components:
        container.get_fmu(str(component.fmu.path.resolve()), f"{component.name}.fmu")
    for component in plan.components:
        for c in component.connections:
            container.add_link(f"{c.sender}.fmu", c.output, f"{c.receiver}.fmu", c.input)
    for link in container.links.values():
        link.name = f"{Path(link.cport_from.fmu.name).stem}.{link.cport_from.port.name}"  # fmucontainer's is lower case
    for component in plan.components:
        fed = {connection.input for connection in component.connections}
        for variable in component.fmu.names("input"):
            if variable not in fed:
                container.add_input(f"{component.name}.{variable}", f"{component.name}.fmu", variable)
        for variable, value in component.start.items():
            description = component.fmu.variables[variable]
            if description.causality == "input" and description.type == "Real" and float(description.start) == value:
                continue  # in FMI 3 a container overwrites what a host sets before initialization begins
            text = repr(float(value)) if description.type == "Real" else value
            container.add_start_value(f"{component.name}.fmu", variable, text)
        for variable in component.fmu.names("output"):
            if variable not in component.sent:
                container.add_output(f"{component.name}.fmu", variable, f"{component.name}.{variable}")


def _complete(folder: Path, plan: Plan, fmi: int) -> None:
    """Complete the model description: units, ranges, recorded outputs, and an identifier from the content."""
    path = folder / "modelDescription.xml"
    tree = etree.parse(path)
    root = tree.getroot()
    for key in ("generationDateAndTime", "author", "license"):
        root.attrib.pop(key, None)
    licenses = {file.description.license for file in plan.files}
    if len(licenses) == 1 and None not in licenses:
        root.set("license", licenses.pop())
    names = ", ".join(f"{c.name} ({c.fmu.name})" for c in plan.components)
    root.set("description", f"{plan.scenario.title or plan.scenario.name}: {names}")
    root.set("generationTool", f"Gossamer with {root.get('generationTool')}")
    units, types = Units(), False
    for variable in root.find("ModelVariables"):
        component, _, name = variable.get("name").partition(".")
        if not name:
            continue
        fmu = plan.component(component).fmu
        real = variable.find("Real") if fmi == 2 else next(variable.iter("Float64"), None)
        if (component, name) in plan.columns and fmu.variables[name].causality == "output":
            variable.set("causality", "output")
        if real is None:
            continue
        if variable.get("causality") == "input" and fmu.is_optional(name):  # whoever runs the container may leave it out too
            real.set("declaredType", OPTIONAL)
            types = True
        unit = fmu.unit(name)
        if unit is not None and declare_unit(units, unit, fmu.unit_definition(name)):
            real.set("unit", unit)
        for key in ("min", "max", "nominal"):
            value = getattr(fmu.variables[name], key)
            if value is not None:
                real.set(key, value)
    if not units.is_empty():
        root.insert(root.index(root.find("LogCategories")), units.element("fmi"))
    if types:
        defined = etree.Element("TypeDefinitions")
        simple = etree.SubElement(defined, "SimpleType" if fmi == 2 else "Float64Type", name=OPTIONAL)
        if fmi == 2:
            etree.SubElement(simple, "Real")
        root.insert(root.index(root.find("LogCategories")), defined)
    _structure(root, fmi)
    key = "guid" if fmi == 2 else "instantiationToken"
    root.set(key, "")
    tree.write(path, encoding="utf-8", xml_declaration=True, pretty_print=True)
    content = "".join(f"{name} {hashlib.sha256(data).hexdigest()}\n" for name, data in _members(folder).items())
    root.set(key, f"{{{uuid.uuid5(_NAMESPACE, content)}}}")
    tree.write(path, encoding="utf-8", xml_declaration=True, pretty_print=True)


def _structure(root: Any, fmi: int) -> None:  # noqa: ANN401
    """List the outputs anew."""
    structure = root.find("ModelStructure")
    structure.clear()
    outputs = [(i, v) for i, v in enumerate(root.find("ModelVariables"), start=1) if v.get("causality") == "output"]
    for section in ("Output", "InitialUnknown"):
        parent = etree.SubElement(structure, f"{section}s") if fmi == 2 and outputs else structure
        for i, variable in outputs:
            if fmi == 2:
                etree.SubElement(parent, "Unknown", index=str(i))
            else:
                etree.SubElement(parent, section, valueReference=variable.get("valueReference"))


def _members(folder: Path) -> dict[str, bytes]:
    """Return every file by its name in the archive, the model description first."""
    files = {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    return dict(sorted(files.items(), key=lambda item: (item[0] != "modelDescription.xml", item[0])))
