"""``modelDescription.xml`` (FMI 2.0) and the documentation page, both from a model's table of variables."""

from __future__ import annotations

import re
from html import escape
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree as ET

from gossamer_models import StepModel, Variable

from .interface import Interface

# Symbols of SI base dimensions in pint, and attributes of <BaseUnit>.
_BASE = {"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "radian": "rad"}
_BEGIN, _END = "<!-- variables -->", "<!-- end of variables -->"
_CAPABILITIES = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
_LOG_CATEGORIES = {
    "logStatusDiscard": "Steps that were refused, and why.",
    "logStatusError": "Calls that were ignored, and why.",
    "logStatusFatal": "The FMU could not be started.",
}


def model_description(model: StepModel, interface: Interface, guid: str) -> bytes:
    """Write the model description.

    Parameters
    ----------
    model : StepModel
        The model; value references are places in its table.
    interface : Interface
        Default experiment.
    guid : str
        Identifier of interface and content.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=guid,
        description=model.description,
        author="The Gossamer developers",
        version=version("gossamer"),
        copyright="The Gossamer developers",
        license="BSD-3-Clause",
        generationTool=f"Gossamer {version('gossamer')} with PythonFMU {version('pythonfmu')}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": model.name, **_CAPABILITIES})
    units = ET.SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(variable.unit for variable in model.variables):
        ET.SubElement(ET.SubElement(units, "Unit", name=name), "BaseUnit", base_unit(name))
    categories = ET.SubElement(root, "LogCategories")
    for name, text in _LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    ET.SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=f"{interface.stop_time:.16g}",
        stepSize=f"{interface.step_size:.16g}",
    )
    variables = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        variables.append(_scalar_variable(variable, reference))
    structure = ET.SubElement(root, "ModelStructure")
    given, results = slice(0, model.slices()[1].stop), model.slices()[2]
    outputs = [i for i, variable in enumerate(model.variables) if variable.causality == "output"]
    listed = ET.SubElement(structure, "Outputs")
    of_inputs = model.step.jac_sparsity(1, 1)
    for i in outputs:
        columns = of_inputs.T.row()[
            of_inputs.T.colind()[i - results.start] : of_inputs.T.colind()[i - results.start + 1]
        ]
        dependencies = " ".join(str(model.slices()[1].start + column + 1) for column in columns)
        ET.SubElement(listed, "Unknown", index=str(i + 1), dependencies=dependencies)
    unknowns = ET.SubElement(structure, "InitialUnknowns")
    everything = " ".join(str(i + 1) for i in range(given.stop))
    for i in outputs:
        ET.SubElement(unknowns, "Unknown", index=str(i + 1), dependencies=everything)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def base_unit(name: str) -> dict[str, str]:
    """Return the attributes of ``<BaseUnit>`` for a unit symbol: exponents of the SI base units and a factor."""
    import pint

    powers = re.sub(r"(?<=[A-Za-z])(?=-?\d)", "**", name)  # kg/m3 is kg/m**3
    quantity = pint.application_registry.Quantity(powers).to_base_units()
    attributes = {_BASE[str(unit)]: str(int(exponent)) for unit, exponent in quantity.unit_items()}
    if quantity.magnitude != 1.0:
        attributes["factor"] = repr(float(quantity.magnitude))
    return attributes


def _scalar_variable(variable: Variable, reference: int) -> ET.Element:
    given = variable.start is not None
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": "fixed"
        if variable.causality == "parameter"
        else "discrete"
        if variable.discrete
        else "continuous",
    }
    if variable.causality != "input":
        attributes["initial"] = "exact" if given else "calculated"
    element = ET.Element("ScalarVariable", attributes)
    numbers = {
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
        "start": variable.start,
    }
    shown = {key: repr(float(value)) for key, value in numbers.items() if value is not None}
    ET.SubElement(element, "Real", {"unit": variable.unit, **shown})
    return element


def variables_table(model: StepModel) -> str:
    """Return the variables as a Markdown table; elements of one array share a row."""
    groups: dict[tuple[str, str], list[Variable]] = {}
    for variable in model.variables:
        groups.setdefault((variable.name.split("[")[0], variable.causality), []).append(variable)
    rows = ["| name | causality | unit | start | range | description |", "|---|---|---|---|---|---|"]
    for members in groups.values():
        first, last = members[0], members[-1]
        name = f"`{first.name}`" if len(members) == 1 else f"`{first.name}` .. `{last.name}`"
        start = "" if first.start is None else f"{first.start:g}"
        low = "" if first.minimum is None else f"{first.minimum:g}"
        high = "" if first.maximum is None else f"{first.maximum:g}"
        span = f"{low} .. {high}" if low or high else ""
        rows.append(f"| {name} | {first.causality} | {first.unit} | {start} | {span} | {first.description} |")
    return "\n".join(rows)


def with_variables(readme: str, model: StepModel) -> str:
    """Return a README with the table of variables brought up to date, between its two markers."""
    before, _, rest = readme.partition(_BEGIN)
    after = rest.partition(_END)[2]
    return f"{before}{_BEGIN}\n{variables_table(model)}\n{_END}{after or chr(10)}"


def documentation(model: StepModel, interface: Interface) -> str:
    """Return the FMU's README with the table of variables as an HTML page."""
    from markdown_it import MarkdownIt

    path: Path = interface.folder / "README.md"
    text = with_variables(path.read_text(encoding="utf-8"), model)
    body = MarkdownIt("commonmark", {"html": True}).enable("table").render(text)
    style = "body{font:1rem/1.5 sans-serif;max-width:60rem;margin:2rem auto}td,th{padding:.2rem .6rem;text-align:left}"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(interface.title)}</title>'
        f"<style>{style}</style></head>\n<body>\n{body}</body></html>\n"
    )
