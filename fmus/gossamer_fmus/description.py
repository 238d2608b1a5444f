"""``modelDescription.xml`` and ``buildDescription.xml``, from a model's table of variables.

Neighbouring variables that share a name, such as ``strain[1]`` .. ``strain[4]``, are one array in FMI 3.0.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from importlib.metadata import version
from itertools import groupby, product
from typing import Literal
from xml.etree import ElementTree as ET

from gossamer_files.measured.units import in_base_units
from gossamer_models import ParameterError, StepModel, Variable

FmiVersion = Literal[2, 3]
# Two periods of the load in the demo, in steps that the membrane takes as one.
_DEFAULT_EXPERIMENT = {"startTime": "0", "stopTime": "0.2532", "stepSize": "0.0003"}
_LOG_CATEGORIES = {
    "logStatusWarning": "Results that have left the range in which the model is valid; once each.",
    "logStatusDiscard": "Steps that were refused, and why.",
    "logStatusError": "Calls that were refused, and why.",
}
OPTIONAL = "optional"  # type of inputs that a program may leave at their start values
_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # attributes of <BaseUnit>


@dataclass(frozen=True, slots=True, kw_only=True)
class Array:
    """One array, or one scalar.

    Attributes
    ----------
    name : str
        Without indices.
    first : int
        Place of the first element in the table.
    members : tuple of Variable
        Elements; the last index runs fastest.
    shape : tuple of int
        Empty for a scalar.
    """

    name: str
    first: int
    members: tuple[Variable, ...]
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of elements."""
        return len(self.members)

    @property
    def label(self) -> str:
        """Name with the first and last indices."""
        names = [f"`{v.name}`" for v in self.members]
        return names[0] if len(names) == 1 else f"{names[0]} .. `{self.members[-1].name}`"

    @property
    def description(self) -> str:
        """Common beginning of the descriptions of all elements."""
        if self.size == 1:
            return self.members[0].description
        common = os.path.commonprefix([v.description for v in self.members])  # noqa: RUF071
        return re.sub(r"[^\w)]+$", "", common[: common.rfind(" ")]) + " .."


def scalars_of(model: StepModel) -> list[Array]:
    """Return each variable of a model by itself, as FMI 2.0 has them."""
    return [Array(name=v.name, first=i, members=(v,), shape=()) for i, v in enumerate(model.variables)]


def arrays_of(model: StepModel) -> list[Array]:
    """Return the arrays and scalars of a model in table order.

    Raises
    ------
    ParameterError
        Elements are missing, are not in the order in which the last index runs fastest, or differ in unit, range or
        variability.
    """
    arrays: list[Array] = []
    numbered = enumerate(model.variables)
    for (name, _), group in groupby(numbered, key=lambda item: (item[1].name.split("[")[0], item[1].causality)):
        places, members = zip(*group, strict=True)
        last = re.search(r"\[(.*)\]", members[-1].name)
        shape = tuple(int(part) for part in last[1].split(",")) if last else ()
        indices = product(*(range(1, size + 1) for size in shape))
        names = [f"{name}[{','.join(map(str, index))}]" if index else name for index in indices]
        kinds = {(v.unit, v.minimum, v.maximum, v.nominal, v.discrete) for v in members}
        if [v.name for v in members] != names or len(kinds) > 1 or name in {array.name for array in arrays}:
            msg = (
                f"the elements of {name!r} in model {model.name!r} do not form an array: list all of them in one place, the "
                "last index fastest, with one unit, range and variability."
            )
            raise ParameterError(msg)
        arrays.append(Array(name=name, first=places[0], members=members, shape=shape))
    return arrays


def arrays_in_parts(model: StepModel) -> tuple[list[Array], list[Array], list[Array]]:
    """Return the arrays and scalars of parameters, inputs and results, as ``arrays_of``."""
    arrays = arrays_of(model)
    parameters, inputs = ([a for a in arrays if a.members[0].causality == each] for each in ("parameter", "input"))
    return parameters, inputs, arrays[len(parameters) + len(inputs) :]


def model_description(model: StepModel, guid: str, *, fmi: FmiVersion = 2, native: bool) -> bytes:
    """Write the model description.

    Parameters
    ----------
    model : StepModel
        The model. In FMI 2.0 value references are places in its table. In FMI 3.0 neighbours such as ``strain[1]``,
        ``strain[2]`` are one array ``strain``; 0 refers to time, k to the k-th array.
    guid : str
        Identifier of interface and content.
    fmi : {2, 3}
        Version of the standard.
    native : bool
        True: compiled from C; False: runs in Python, in FMI 2.0 only.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    if fmi == 2:
        arrays = scalars_of(model)
        root = _root(model, native=native, fmiVersion="2.0", guid=guid, numberOfEventIndicators="0")
    else:
        arrays = arrays_of(model)
        root = _root(model, native=native, fmiVersion="3.0", instantiationToken=guid)
    capabilities = {key: str(value).lower() for key, value in _capabilities(model, fmi, native=native).items()}
    kind = ET.SubElement(root, "CoSimulation", {"modelIdentifier": model.name} | capabilities)
    if fmi == 2 and native:
        ET.SubElement(ET.SubElement(kind, "SourceFiles"), "File", name="fmi2.c")
    units = ET.SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(["s", *(variable.unit for variable in model.variables)]):
        ET.SubElement(ET.SubElement(units, "Unit", name=name), "BaseUnit", base_unit(name))
    if any(v.optional for v in model.variables):
        types, said = ET.SubElement(root, "TypeDefinitions"), {"name": OPTIONAL, "description": "May stay as it starts"}
        if fmi == 2:
            ET.SubElement(ET.SubElement(types, "SimpleType", said), "Real")
        else:
            ET.SubElement(types, "Float64Type", said)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in (_LOG_CATEGORIES | ({} if native else {"logStatusFatal": "The FMU could not be started."})).items():
        ET.SubElement(categories, "Category", name=name, description=text)
    ET.SubElement(root, "DefaultExperiment", _DEFAULT_EXPERIMENT)
    variables = ET.SubElement(root, "ModelVariables")
    if fmi == 3:
        time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
        ET.SubElement(variables, "Float64", time | {"unit": "s", "description": "Time"})
    variables.extend((_scalar if fmi == 2 else _float64)(array, k) for k, array in enumerate(arrays, 1))
    root.append(_structure(model, arrays, fmi))
    return _bytes(root)


def build_description(model: StepModel) -> bytes:
    """Write ``sources/buildDescription.xml`` of FMI 3.0: how an importing tool compiles the sources."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C11")
    ET.SubElement(files, "SourceFile", name="fmi3.c")
    ET.SubElement(configuration, "Library", name="m", external="true")
    return _bytes(root)


def base_unit(name: str) -> dict[str, str]:
    """Return the attributes of ``<BaseUnit>`` for a unit symbol: exponents of the SI base units and a factor.

    Raises
    ------
    ParameterError
        The unit is unknown, has an offset as degC has, or is not a product of integer powers of base units.
    """
    found = in_base_units(re.sub(r"(?<=[A-Za-z])(?=-?\d)", "**", name))  # kg/m3 is kg/m**3
    if found is None or found.offset or set(found.powers) - set(_BASE):
        msg = f"unit {name!r} is not a product of integer powers of SI base units. Use one that is."
        raise ParameterError(msg)
    attributes = {unit: str(power) for unit, power in found.powers.items()}
    return attributes | ({"factor": repr(found.factor)} if found.factor != 1.0 else {})


def _root(model: StepModel, *, native: bool, **attributes: str) -> ET.Element:
    tool = f"Gossamer {version('gossamer')}" + ("" if native else f" with PythonFMU {version('pythonfmu')}")
    return ET.Element(
        "fmiModelDescription",
        attributes,
        modelName=model.name,
        description=model.description,
        author="The Gossamer developers",
        version=version("gossamer"),
        copyright="The Gossamer developers",
        license="BSD-3-Clause",
        generationTool=tool,
        variableNamingConvention="structured",
    )


def _capabilities(model: StepModel, fmi: FmiVersion, *, native: bool) -> dict[str, bool]:
    # FMI defines derivatives for continuous outputs only.
    derivatives = native and any(v.causality == "output" and not v.discrete for v in model.variables)
    derivatives &= model.tables is None or model.expression is not None  # loops over elements have none
    if fmi == 3:
        return {
            "canHandleVariableCommunicationStepSize": True,
            "canGetAndSetFMUState": True,
            "canSerializeFMUState": True,
            "providesDirectionalDerivatives": derivatives,
        }
    return {
        "needsExecutionTool": not native,
        "canHandleVariableCommunicationStepSize": True,
        "canInterpolateInputs": False,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canNotUseMemoryManagementFunctions": True,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": derivatives,
    }


def _scalar(array: Array, k: int) -> ET.Element:
    """Describe the k-th variable in FMI 2.0."""
    (variable,) = array.members
    attributes = {"name": variable.name, "valueReference": str(k - 1), "description": variable.description}
    attributes |= _kind(variable)
    if variable.causality != "input":
        attributes["initial"] = "calculated" if variable.start is None else "exact"
    element = ET.Element("ScalarVariable", attributes)
    ET.SubElement(element, "Real", _numbers(array))
    return element


def _float64(array: Array, k: int) -> ET.Element:
    """Describe the k-th array in FMI 3.0."""
    attributes = {"name": array.name, "valueReference": str(k), "description": array.description}
    element = ET.Element("Float64", attributes | _kind(array.members[0]) | _numbers(array))
    for size in array.shape:
        ET.SubElement(element, "Dimension", start=str(size))
    return element


def _kind(variable: Variable) -> dict[str, str]:
    variability = "fixed" if variable.causality == "parameter" else "discrete" if variable.discrete else "continuous"
    return {"causality": variable.causality, "variability": variability}


def _numbers(array: Array) -> dict[str, str]:
    """Return unit, range, nominal and start values."""
    first = array.members[0]
    numbers = {"min": first.minimum, "max": first.maximum, "nominal": first.nominal}
    starts = [repr(float(v.start)) for v in array.members if v.start is not None]
    return (
        ({"declaredType": OPTIONAL} if first.optional else {})
        | {"unit": first.unit}
        | {key: repr(float(value)) for key, value in numbers.items() if value is not None}
        | ({"start": " ".join(starts)} if starts else {})
    )


def _structure(model: StepModel, arrays: list[Array], fmi: FmiVersion) -> ET.Element:
    """List the outputs and their dependencies: in a step, and initially, when they may depend on all given variables."""
    number = {array.first + i: str(k) for k, array in enumerate(arrays, 1) for i in range(array.size)}
    given = " ".join(number[array.first] for array in arrays if array.members[0].start is not None)
    in_a_step, initially = {}, {}
    for array in arrays:
        if array.members[0].causality == "output":
            places = range(array.first, array.first + array.size)
            inputs = dict.fromkeys(number[i] for place in places for i in _dependencies(model, place))
            in_a_step[number[array.first]], initially[number[array.first]] = " ".join(inputs), given
    root = ET.Element("ModelStructure")
    for kind, dependencies in (("Output", in_a_step), ("InitialUnknown", initially)):
        parent = root if fmi == 3 else ET.SubElement(root, f"{kind}s")
        tag, reference = (kind, "valueReference") if fmi == 3 else ("Unknown", "index")
        for k, needed in dependencies.items():
            ET.SubElement(parent, tag, {reference: k, "dependencies": needed})
    return root


def _dependencies(model: StepModel, output: int) -> list[int]:
    """Return the places in the table of the inputs that an output depends on within a communication step."""
    _, inputs, results = model.slices()
    if model.step_limit is not None:  # in several internal steps, an input of a state reaches every output
        return list(range(inputs.start, inputs.stop))
    by_output = model.step.jac_sparsity(1, 1).T
    begin, end = by_output.colind()[output - results.start :][:2]
    return [inputs.start + column for column in by_output.row()[begin:end]]


def _bytes(root: ET.Element) -> bytes:
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"
