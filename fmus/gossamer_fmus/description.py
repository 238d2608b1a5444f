"""``modelDescription.xml`` (FMI 2.0 and 3.0) and the documentation page, all from a model's table of variables."""

from __future__ import annotations

import re
from html import escape
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree as ET

from gossamer_models import ParameterError, StepModel, Variable

from .arrays import arrays_of
from .interface import Interface

# Symbols of SI base dimensions in pint, and attributes of <BaseUnit>.
_BASE = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
_BEGIN, _END = "<!-- variables -->", "<!-- end of variables -->"
_LOG_CATEGORIES = {
    "logStatusDiscard": "Steps that were refused, and why.",
    "logStatusError": "Calls that were refused, and why.",
}


def model_description(model: StepModel, interface: Interface, guid: str, *, native: bool) -> bytes:
    """Write the model description of FMI 2.0.

    Parameters
    ----------
    model : StepModel
        The model; value references are places in its table.
    interface : Interface
        Default experiment.
    guid : str
        Identifier of interface and content.
    native : bool
        True: compiled from ``sources/fmi2.c``; False: runs in Python.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    tool = "" if native else f" with PythonFMU {version('pythonfmu')}"
    root = _root(model, tool, fmiVersion="2.0", guid=guid, numberOfEventIndicators="0")
    capabilities = {
        "needsExecutionTool": not native,
        "canHandleVariableCommunicationStepSize": True,
        "canInterpolateInputs": False,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canNotUseMemoryManagementFunctions": True,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": native and _has_derivatives(model),
    }
    kind = ET.SubElement(root, "CoSimulation", {"modelIdentifier": model.name} | _flags(capabilities))
    if native:
        ET.SubElement(ET.SubElement(kind, "SourceFiles"), "File", name="fmi2.c")
    _common(root, model, interface)
    if not native:
        fatal = {"name": "logStatusFatal", "description": "The FMU could not be started."}
        ET.SubElement(root.find("LogCategories"), "Category", fatal)  # type: ignore[arg-type]
    variables = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        variables.append(_scalar_variable(variable, reference))
    structure = ET.SubElement(root, "ModelStructure")
    given = slice(0, model.slices()[1].stop)
    outputs = [i for i, variable in enumerate(model.variables) if variable.causality == "output"]
    listed = ET.SubElement(structure, "Outputs")
    for i in outputs:
        dependencies = " ".join(str(k + 1) for k in _dependencies(model, i))
        ET.SubElement(listed, "Unknown", index=str(i + 1), dependencies=dependencies)
    unknowns = ET.SubElement(structure, "InitialUnknowns")
    everything = " ".join(str(i + 1) for i in range(given.stop))
    for i in outputs:
        ET.SubElement(unknowns, "Unknown", index=str(i + 1), dependencies=everything)
    return _bytes(root)


def model_description_3(model: StepModel, interface: Interface, token: str) -> bytes:
    """Write the model description of FMI 3.0: neighbours such as ``strain[1]``, ``strain[2]`` are one array ``strain``.

    Parameters
    ----------
    model : StepModel
        The model; value references are 0 for time and then count the arrays.
    interface : Interface
        Default experiment.
    token : str
        Identifier of interface and content.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    root = _root(model, "", fmiVersion="3.0", instantiationToken=token)
    capabilities = {
        "canHandleVariableCommunicationStepSize": True,
        "canGetAndSetFMUState": True,
        "canSerializeFMUState": True,
        "providesDirectionalDerivatives": _has_derivatives(model),
    }
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": model.name} | _flags(capabilities))
    _common(root, model, interface)
    variables = ET.SubElement(root, "ModelVariables")
    about_time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ET.SubElement(variables, "Float64", about_time | {"unit": "s", "description": "Time"})
    arrays = arrays_of(model)
    reference = {i: str(k) for k, array in enumerate(arrays, 1) for i in range(array.first, array.first + array.size)}
    for array in arrays:
        element = ET.SubElement(
            variables,
            "Float64",
            {"name": array.name, "valueReference": reference[array.first]}
            | _about(array.members[0])
            | {"description": array.description, "unit": array.members[0].unit}
            | _numbers(array.members[0])
            | ({} if array.members[0].start is None else {"start": " ".join(repr(v.start) for v in array.members)}),
        )
        for size in array.shape:
            ET.SubElement(element, "Dimension", start=str(size))
    structure = ET.SubElement(root, "ModelStructure")
    given = [array for array in arrays if array.members[0].start is not None]
    outputs = [array for array in arrays if array.members[0].causality == "output"]
    for array in outputs:
        places = range(array.first, array.first + array.size)
        needed = dict.fromkeys(reference[k] for i in places for k in _dependencies(model, i))
        ET.SubElement(structure, "Output", valueReference=reference[array.first], dependencies=" ".join(needed))
    everything = " ".join(reference[array.first] for array in given)
    for array in outputs:
        ET.SubElement(structure, "InitialUnknown", valueReference=reference[array.first], dependencies=everything)
    return _bytes(root)


def build_description(model: StepModel) -> bytes:
    """Write ``sources/buildDescription.xml`` of FMI 3.0: how an importing tool compiles the sources."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C11")
    ET.SubElement(files, "SourceFile", name="fmi3.c")
    ET.SubElement(configuration, "Library", name="m", external="true")
    return _bytes(root)


def _root(model: StepModel, tool: str, **attributes: str) -> ET.Element:
    return ET.Element(
        "fmiModelDescription",
        attributes,
        modelName=model.name,
        description=model.description,
        author="The Gossamer developers",
        version=version("gossamer"),
        copyright="The Gossamer developers",
        license="BSD-3-Clause",
        generationTool=f"Gossamer {version('gossamer')}{tool}",
        variableNamingConvention="structured",
    )


def _common(root: ET.Element, model: StepModel, interface: Interface) -> None:
    """Add what both versions of the standard write alike: units, log categories, default experiment."""
    units = ET.SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(["s", *(variable.unit for variable in model.variables)]):
        ET.SubElement(ET.SubElement(units, "Unit", name=name), "BaseUnit", base_unit(name))
    categories = ET.SubElement(root, "LogCategories")
    for name, text in _LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    times = {"startTime": 0.0, "stopTime": interface.stop_time, "stepSize": interface.step_size}
    ET.SubElement(root, "DefaultExperiment", {key: f"{value:.16g}" for key, value in times.items()})


def _has_derivatives(model: StepModel) -> bool:
    """Tell whether an output is continuous: FMI defines derivatives for no others."""
    return any(v.causality == "output" and not v.discrete for v in model.variables)


def _dependencies(model: StepModel, output: int) -> list[int]:
    """Return the places in the table of the inputs that an output depends on within a communication step."""
    _, inputs, results = model.slices()
    if model.step_limit is not None:  # several internal steps, in which what acts on a state reaches every output
        return list(range(inputs.start, inputs.stop))
    by_output = model.step.jac_sparsity(1, 1).T
    begin, end = by_output.colind()[output - results.start :][:2]
    return [inputs.start + column for column in by_output.row()[begin:end]]


def _flags(values: dict[str, bool]) -> dict[str, str]:
    return {key: str(value).lower() for key, value in values.items()}


def _bytes(root: ET.Element) -> bytes:
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def base_unit(name: str) -> dict[str, str]:
    """Return the attributes of ``<BaseUnit>`` for a unit symbol: exponents of the SI base units and a factor.

    Raises
    ------
    ParameterError
        The unit is unknown, has an offset as degC has, or is no product of whole powers of base units.
    """
    import pint

    powers = re.sub(r"(?<=[A-Za-z])(?=-?\d)", "**", name)  # kg/m3 is kg/m**3
    registry = pint.application_registry
    try:
        quantity, twice = (registry.Quantity(value, powers).to_base_units() for value in (1.0, 2.0))
        items = {_BASE[str(unit)]: exponent for unit, exponent in quantity.unit_items()}
    except (pint.PintError, KeyError) as error:
        msg = f"unit {name!r} cannot be written in base units: {error}. Use another."
        raise ParameterError(msg) from error
    if twice.magnitude != 2.0 * quantity.magnitude or any(exponent != int(exponent) for exponent in items.values()):
        msg = f"unit {name!r} is no product of whole powers of SI base units. Use one that is."
        raise ParameterError(msg)
    attributes = {unit: str(int(exponent)) for unit, exponent in items.items()}
    if quantity.magnitude != 1.0:
        attributes["factor"] = repr(float(quantity.magnitude))
    return attributes


def _scalar_variable(variable: Variable, reference: int) -> ET.Element:
    attributes = {"name": variable.name, "valueReference": str(reference), "description": variable.description}
    attributes |= _about(variable)
    if variable.causality != "input":
        attributes["initial"] = "calculated" if variable.start is None else "exact"
    element = ET.Element("ScalarVariable", attributes)
    start = {} if variable.start is None else {"start": repr(float(variable.start))}
    ET.SubElement(element, "Real", {"unit": variable.unit} | _numbers(variable) | start)
    return element


def _about(variable: Variable) -> dict[str, str]:
    """Return causality and variability, which both versions of the standard write alike."""
    changing = "discrete" if variable.discrete else "continuous"
    return {
        "causality": variable.causality,
        "variability": "fixed" if variable.causality == "parameter" else changing,
    }


def _numbers(variable: Variable) -> dict[str, str]:
    numbers = {"min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal}
    return {key: repr(float(value)) for key, value in numbers.items() if value is not None}


def variables_table(model: StepModel) -> str:
    """Return the variables as a Markdown table; elements of one array share a row."""
    rows = ["| name | causality | unit | start | range | description |", "|---|---|---|---|---|---|"]
    for array in arrays_of(model):
        first = array.members[0]
        start = "" if first.start is None else f"{first.start:g}"
        low = "" if first.minimum is None else f"{first.minimum:g}"
        high = "" if first.maximum is None else f"{first.maximum:g}"
        span = f"{low} .. {high}" if low or high else ""
        rows.append(f"| {array.label} | {first.causality} | {first.unit} | {start} | {span} | {array.description} |")
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
