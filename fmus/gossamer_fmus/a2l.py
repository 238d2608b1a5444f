"""Where the values of a native FMU lie, for calibration tools: an A2L file per binary, as FMI-LS-XCP has it [1]_.

The FMU holds no XCP service; that of an importer reads and writes its memory. Addresses are relative to the base address of
the binary, and those of the first instance in a process, which alone has a fixed place. Files::

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

import struct
from collections.abc import Mapping
from pathlib import PurePosixPath

from gossamer_models import StepModel

FOLDER = "extra/org.fmi-standard.fmi-ls-xcp"
VALUES_OFFSET = 4 * 8  # of the variables in a State, and so in an Instance (stepper.h) [byte]
_LARGEST = 1.7976931348623157e308
_FAT, _MACH, _ELF = b"\xca\xfe\xba\xbe", b"\xcf\xfa\xed\xfe", b"\x7fELF"
_PROCESSORS = {0x01000007: "x86_64-darwin", 0x0100000C: "aarch64-darwin"}
_MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiLayeredStandardManifest xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
  fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-xcp" fmi-ls:fmi-ls-version="1.0.0"
  fmi-ls:fmi-ls-description="Layered standard based on FMI 2 and FMI 3 for describing and implementing XCP support for \
FMUs, which can either provide an XCP service or allow direct memory access via A2L files."
  containsXcpService="false" supportsDirectMemoryAccessViaA2L="true"/>
"""
_DOCUMENT = """The A2L files describe the memory of this FMU for an XCP service of the importer. The FMU holds none, so there
is no IF_DATA XCP. Addresses are relative to the base address of the loaded binary. They are those of the instance that is
made first in a process; others are allocated, and no address of them is known before. All values are doubles of 8 bytes,
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
        for platform, one in _parts(PurePosixPath(path).parent.name, library).items():
            begin = symbol_address(one, first_instance(model)) + VALUES_OFFSET
            files[f"{FOLDER}/{platform}/{model.name}.a2l"] = _file(model, begin)
    return {name: text.encode() for name, text in files.items()}


def first_instance(model: StepModel) -> str:
    """Return the symbol of the first instance."""
    return f"{model.name}_first_instance"


def symbol_address(library: bytes, name: str) -> int:
    """Return the address of an exported symbol in an ELF, PE or Mach-O library of 64 bits, relative to its base.

    Raises
    ------
    KeyError
        The library does not export it.
    """
    find = _in_elf if library.startswith(_ELF) else _in_mach if library.startswith(_MACH) else _in_pe
    return find(library)[name]


def _parts(platform: str, library: bytes) -> dict[str, bytes]:
    """Return a library by platform, or its parts if it is a universal one (mach-o/fat.h)."""
    if not library.startswith(_FAT):
        return {platform: library}
    heads = (struct.unpack_from(">5I", library, 8 + 20 * k) for k in range(struct.unpack_from(">I", library, 4)[0]))
    return {_PROCESSORS[processor]: library[begin : begin + size] for processor, _, begin, size, _ in heads}


def _text(library: bytes, begin: int) -> str:
    return library[begin : library.index(b"\0", begin)].decode()


def _in_elf(library: bytes) -> dict[str, int]:
    begin, (size, count) = struct.unpack_from("<Q", library, 0x28)[0], struct.unpack_from("<HH", library, 0x3A)
    sections = [struct.unpack_from("<IIQQQQIIQQ", library, begin + k * size) for k in range(count)]
    (table,) = (each for each in sections if each[1] == 11)  # SHT_DYNSYM
    names = sections[table[6]][4]
    symbols = (struct.unpack_from("<IBBHQQ", library, table[4] + k) for k in range(0, table[5], 24))
    return {_text(library, names + name): value for name, _, _, _, value, _ in symbols}


def _in_pe(library: bytes) -> dict[str, int]:
    head = struct.unpack_from("<I", library, 0x3C)[0] + 4
    (n_sections,), (size,) = struct.unpack_from("<H", library, head + 2), struct.unpack_from("<H", library, head + 16)
    sections = [struct.unpack_from("<4I", library, head + 20 + size + 40 * k + 8) for k in range(n_sections)]

    def place(address: int) -> int:
        return next(address - begin + at for length, begin, _, at in sections if begin <= address < begin + length)

    exports = place(struct.unpack_from("<I", library, head + 20 + 112)[0])
    _, n_names, addresses, names, ordinals = struct.unpack_from("<5I", library, exports + 20)
    found = {}
    for k in range(n_names):
        (name,) = struct.unpack_from("<I", library, place(names) + 4 * k)
        (ordinal,) = struct.unpack_from("<H", library, place(ordinals) + 2 * k)
        found[_text(library, place(name))] = struct.unpack_from("<I", library, place(addresses) + 4 * ordinal)[0]
    return found


def _in_mach(library: bytes) -> dict[str, int]:
    at, found = 32, {}
    for _ in range(struct.unpack_from("<I", library, 16)[0]):
        command, size, symbols, count, names, _ = struct.unpack_from("<6I", library, at)
        if command == 2:  # LC_SYMTAB; the base of a library is at 0
            for k in range(count):
                name, _, _, _, value = struct.unpack_from("<IBBHQ", library, symbols + 16 * k)
                found[_text(library, names + name).removeprefix("_")] = value
        at += size
    return found


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
