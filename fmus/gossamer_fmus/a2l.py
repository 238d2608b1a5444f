"""Where the values of a native FMU lie, for calibration tools: an A2L file per binary, as FMI-LS-XCP has it [1]_.

The FMU holds no XCP service; that of an importer reads and writes its memory. Addresses are relative to the base address of
the binary, and those of the first instance in a process whose environment has ``GOSSAMER_FIXED_ADDRESS``;
others are allocated. Files::

    extra/org.fmi-standard.fmi-ls-xcp/fmi-ls-manifest.xml
    extra/org.fmi-standard.fmi-ls-xcp/<platform>/<name>.a2l    <platform> as below ``binaries/``
    documentation/fmi-ls-xcp.txt

Inputs, outputs and locals are measurements, parameters are characteristics, each with its unit and range (A2L 1.71 [2]_).

References
----------
.. [1] FMI Layered Standard for XCP 1.0, Modelica Association Project FMI, https://github.com/modelica/fmi-ls-xcp.
.. [2] ASAM MCD-2 MC (ASAP2), version 1.7.1, https://www.asam.net/standards/detail/mcd-2-mc/.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from gossamer_models import StepModel
from gossamer_models.errors import CompilerError

FOLDER = "extra/org.fmi-standard.fmi-ls-xcp"
VALUES_OFFSET = 4 * 8  # of the variables in a State, and so in an Instance (stepper.h) [byte]
_LARGEST = 1.7976931348623157e308
_MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiLayeredStandardManifest xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
  fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-xcp" fmi-ls:fmi-ls-version="1.0.0"
  fmi-ls:fmi-ls-description="Layered standard based on FMI 2 and FMI 3 for describing and implementing XCP support for \
FMUs, which can either provide an XCP service or allow direct memory access via A2L files."
  containsXcpService="false" supportsDirectMemoryAccessViaA2L="true"/>
"""
_DOCUMENT = """The A2L files describe the memory of this FMU for an XCP service of the importer. The FMU holds none, so there
is no IF_DATA XCP. Addresses are relative to the base address of the loaded binary. They are those of the instance that is
made first in a process whose environment has GOSSAMER_FIXED_ADDRESS=1; others are allocated, and no address of them is
known before. All values are doubles of 8 bytes,
lowest byte first. Read at communication points. A parameter that is written while the model runs holds from the next step,
and its range is not checked; what is computed from it when the initialization ends is not computed again.
"""


def descriptions(model: StepModel, binaries: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files of the layered standard by path.

    Parameters
    ----------
    model : StepModel
        The model.
    binaries : mapping of str to bytes
        Compiled libraries by path in the FMU; one for several processors gets a file for each.
    """
    files = {f"{FOLDER}/fmi-ls-manifest.xml": _MANIFEST, "documentation/fmi-ls-xcp.txt": _DOCUMENT}
    for path, library in binaries.items():
        for platform, at in _addresses(first_instance(model), PurePosixPath(path).parent.name, library).items():
            files[f"{FOLDER}/{platform}/{model.name}.a2l"] = _file(model, at + VALUES_OFFSET)
    return {name: text.encode() for name, text in files.items()}


def first_instance(model: StepModel) -> str:
    """Return the symbol of the first instance."""
    return f"{model.name}_first_instance"


def _addresses(name: str, platform: str, library: bytes) -> dict[str, int]:
    """Return where an exported symbol lies, from the base of a library, by platform: a universal one has two."""
    try:
        import lief  # slow to load
    except ImportError as error:
        msg = "native FMUs need lief, which reads where their symbols lie. Install it with: pip install 'lief>=1,<2'"
        raise CompilerError(msg) from error
    if "darwin" in platform:
        processors = lief.MachO.Header.CPU_TYPE
        names = {processors.X86_64: "x86_64-darwin", processors.ARM64: "aarch64-darwin"}
        parts: Any = lief.MachO.parse(list(library))  # owns them
        both = (parts.at(k) for k in range(parts.size))
        return {names[one.header.cpu_type]: one.get_symbol(f"_{name}").value for one in both}
    one: Any = lief.parse(library)
    if library.startswith(b"MZ"):  # for Windows
        return {platform: next(entry.address for entry in one.get_export().entries if entry.name == name)}
    return {platform: one.get_dynamic_symbol(name).value}


def _file(model: StepModel, begin: int) -> str:
    """Write the A2L file; the values begin at an address."""
    units = dict.fromkeys(v.unit for v in model.variables)
    lines = [
        "ASAP2_VERSION 1 71",
        f"/begin PROJECT {model.name} {_quoted(model.description)}",
        f"/begin MODULE {model.name} {_quoted(model.description)}",
        '/begin MOD_COMMON "" BYTE_ORDER MSB_LAST ALIGNMENT_FLOAT64_IEEE 8 /end MOD_COMMON',
        "/begin RECORD_LAYOUT number FNC_VALUES 1 FLOAT64_IEEE COLUMN_DIR DIRECT /end RECORD_LAYOUT",
        *(
            f'/begin COMPU_METHOD unit_{k} "" IDENTICAL "%.9" {_quoted(unit)} /end COMPU_METHOD'
            for k, unit in enumerate(units)
        ),
    ]
    for k, v in enumerate(model.variables):
        address, unit = f"0x{begin + 8 * k:08X}", f"unit_{list(units).index(v.unit)}"
        low, high = (
            repr(other if end is None else float(end)) for end, other in ((v.minimum, -_LARGEST), (v.maximum, _LARGEST))
        )
        link = f'SYMBOL_LINK "{first_instance(model)}" {VALUES_OFFSET + 8 * k}'
        name, meaning = v.name.replace(",", "]["), _quoted(v.description)
        if v.causality == "parameter":
            what = f"CHARACTERISTIC {name} {meaning} VALUE {address} number 0 {unit} {low} {high} {link}"
        else:
            what = f"MEASUREMENT {name} {meaning} FLOAT64_IEEE {unit} 0 0 {low} {high} ECU_ADDRESS {address} {link}"
        lines.append(f"/begin {what} /end {what.split()[0]}")
    return "\n".join([*lines, "/end MODULE", "/end PROJECT", ""])


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
