"""A component in a framework of flight software: F Prime or cFS, written from the model's table of variables.

The files belong beside those of ``flight``, whose C they call. Templates are in ``native/frameworks``::

    Component.fpp, .hpp, .cpp, CMakeLists.txt                F Prime: ports, events, telemetry with limits, parameters
    component_app.h, .c, component_tbl.c, CMakeLists.txt     cFS: table of parameters, packets of results and housekeeping
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Literal

from gossamer_models import StepModel

from .description import Array, arrays_in_parts
from .flight import PERIOD, c_comment
from .flight_mathematics import FloatBits

Framework = Literal["fprime", "cfs"]
Arrays = Sequence[Array]


def framework_files(
    model: StepModel, name: str, framework: Framework, bits: FloatBits = 64, period: float = PERIOD
) -> dict[str, bytes]:
    """Return the files of a component for a framework by name.

    Parameters
    ----------
    model : StepModel
        As for ``flight_files``.
    name : str
        Of the component.
    framework : {"fprime", "cfs"}
        Whose.
    bits : {32, 64}
        Of its numbers.
    period : float
        Between samples [s], where it starts.
    """
    parameters, inputs, results = arrays_in_parts(model)
    parts = _fprime(parameters, inputs, results, bits) if framework == "fprime" else _cfs(parameters, bits)
    named = {"Name": name.capitalize(), "name": name, "NAME": name.upper(), "period": repr(period)}
    parts |= named | {"description": c_comment(model.description)}

    def filled(text: str) -> str:
        return reduce(lambda text, part: text.replace(f"{{{{{part[0]}}}}}", part[1]), parts.items(), text)

    files = {}
    for path in sorted((Path(__file__).parent / "native/frameworks" / framework).iterdir()):
        label = path.name.replace("Name", parts["Name"]).replace("name", name)
        files[label] = filled(path.read_text(encoding="utf-8")).encode()
    return files


def _fprime(parameters: Arrays, inputs: Arrays, results: Arrays, bits: FloatBits) -> dict[str, str]:
    real = f"F{bits}"

    def kind(a: Array) -> str:
        return f"{{{{Name}}}}{_capital(a.name)}" if a.shape else real

    def argument(a: Array) -> str:
        return f"const {kind(a)}& {a.name}" if a.shape else f"{real} {a.name}"

    def each(a: Array, text: str) -> str:
        """Write a line for a scalar, or for each element of an array, whose place {at} is."""
        places = [f"[{i}]" for i in range(a.size)] if a.shape else [""]
        return "\n".join("  " + text.replace("{at}", at) for at in places)

    def value(a: Array) -> str:
        return f"{kind(a)}(y.{a.name})" if a.shape else f"y.{a.name}"

    return {
        "arrays": "".join(f"\n  array {kind(a)} = [{a.size}] {real}\n" for a in (*parameters, *inputs, *results) if a.shape),
        "inputs": "\n".join(f"    ${a.name}: {kind(a)} @< {_meaning(a)}" for a in inputs),
        "results": "\n".join(f"    ${a.name}: {kind(a)} @< {_meaning(a)}" for a in results),
        "telemetry": "\n".join(_channel(a, kind(a), k) for k, a in enumerate(results, 1)),
        "parameters": "\n".join(
            f"    @ {_meaning(a)}\n    param {a.name.upper()}: {kind(a)} default {_start(a)} id 0x{k:02x} "
            f"set opcode 0x{0x40 + k:02x} save opcode 0x{0x80 + k:02x}\n"
            for k, a in enumerate(parameters, 1)
        ),
        "real": real,
        "input_arguments": ", ".join(map(argument, inputs)),
        "get_parameters": "\n".join(
            each(a, f"p.{a.name}{{at}} = this->paramGet_{a.name.upper()}(valid){{at}};") for a in parameters
        ),
        "set_inputs": "\n".join(each(a, f"u.{a.name}{{at}} = {a.name}{{at}};") for a in inputs),
        "set_results": "\n".join(f"  this->tlmWrite_{a.name}({value(a)});" for a in results),
        "result_values": ", ".join(map(value, results)),
    }


def _cfs(parameters: Arrays, bits: FloatBits) -> dict[str, str]:
    suffix, smallest, largest = ("f", "1e-37f", "3.4e38f") if bits == 32 else ("", "1e-300", "1.7976931348623157e308")

    def bound(value: float | None, otherwise: str) -> str:
        return otherwise if value is None else f"{float(value)!r}{suffix}"

    lines, starts = [], []
    for a in parameters:
        low, high = a.members[0].minimum, a.members[0].maximum
        for at in [f"[{i}]" for i in range(a.size)] if a.shape else [""]:
            limits = f"{bound(low, '-' + largest)}, {bound(high, largest)}"
            lines.append(f"  Valid = Valid && Within(t->Parameters.{a.name}{at}, {limits});")
        numbers = ", ".join(bound(v.start, "0.0") for v in a.members)
        starts.append(f"        .{a.name} = {f'{{{numbers}}}' if a.shape else numbers}, /* {c_comment(_meaning(a))} */")
    return {"smallest": smallest, "largest": largest, "ranges": "\n".join(lines), "starts": "\n".join(starts)}


def _channel(a: Array, kind: str, k: int) -> str:
    """Write a telemetry channel; a scalar has the limits of its range in red."""
    line = f"    @ {_meaning(a)}\n    telemetry ${a.name}: {kind} id 0x{k:02x}"
    if a.shape:
        return f"{line}\n"
    first = a.members[0]
    limits = (("low", first.minimum), ("high", first.maximum))
    ends = [f" {side} {{ red {float(end)!r} }}" for side, end in limits if end is not None]
    return f'{line} format "{{e}}{first.after}"{"".join(ends)}\n'


def _start(a: Array) -> str:
    numbers = [repr(float(v.start or 0.0)) for v in a.members]
    return f"[{', '.join(numbers)}]" if a.shape else numbers[0]


def _meaning(a: Array) -> str:
    """Return unit, meaning and range on one line."""
    low, high = a.members[0].limits
    ends = f"; {low:g} to {high:g}" if a.members[0].minimum is not None or a.members[0].maximum is not None else ""
    return f"[{a.members[0].unit}] {a.description}{ends}"


def _capital(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))
