"""Test FMUs of the behaviour of the FMI project's Reference FMUs: small C and hand-written model descriptions.

``build("Stair", 2, folder)`` compiles and packs one; ``NAMES`` lists those of each version, ``EXCHANGED`` those
that are for model exchange too.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import fmpy
from gossamer_models.compiler import compile_shared

HERE = Path(__file__).parent
NAMES = {fmi: sorted(path.stem for path in (HERE / f"fmi{fmi}").glob("*.xml")) for fmi in (2, 3)}
EXCHANGED = {
    fmi: [name for name in names if "<ModelExchange" in (HERE / f"fmi{fmi}/{name}.xml").read_text(encoding="utf-8")]
    for fmi, names in NAMES.items()
}
HEADERS = Path(fmpy.__file__).parent / "c-code"


def build(name: str, fmi: int, folder: Path, *, exchange: bool = False) -> Path:
    """Compile one of them for this machine and return its path, ``<name><fmi>.fmu``; or for model exchange only."""
    xml = (HERE / f"fmi{fmi}/{name}.xml").read_text(encoding="utf-8")
    if exchange:
        xml = re.sub(r" *<CoSimulation [^>]*>\n", "", xml)
    token = re.search(r'(?:guid|instantiationToken)="([^"]+)"', xml)[1]
    sources = ["model.h", f"{name}.h", f"fmi{fmi}.c", *(["fmi3_rest.c"] if fmi == 3 else [])]
    files = {source: (HERE / source).read_bytes() for source in sources}
    options = ["-I", str(HEADERS), f'-DMODEL_HEADER="{name}.h"', f'-DTOKEN="{token}"', *sources[3:]]
    library = f"{name}{fmpy.sharedLibraryExtension}"
    binary = compile_shared(files, f"fmi{fmi}.c", library, options, f"the test FMU {name}")
    path = folder / f"{name}{fmi}.fmu"
    place = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.writestr(f"binaries/{place}/{library}", binary)
        if name == "Resource":
            archive.writestr("resources/y.txt", "a")
    return path
