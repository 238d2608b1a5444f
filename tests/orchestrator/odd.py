"""An FMU of FMI 2.0 in C that is odd as a test asks: C statements are put into its functions, see ``odd.c``."""

from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy
from gossamer_models.compiler import compile_shared

PLACES = ("load", "instantiation", "entry", "exit", "setting", "reading", "step")
XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="odd" guid="{{odd}}" generationTool="hand">
  <CoSimulation modelIdentifier="odd" canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
  <UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions>
  <DefaultExperiment startTime="0" {experiment}/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real unit="m" start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output"><Real unit="m"/></ScalarVariable>
    <ScalarVariable name="p" valueReference="2" causality="parameter" variability="fixed">
      <Real unit="m" start="0"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2"/></Outputs>
    <InitialUnknowns><Unknown index="2"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def build(path: Path, experiment: str = 'stepSize="0.01"', **statements: str) -> Path:
    """Compile the FMU for this machine, with C statements at some of ``PLACES``."""
    header = "".join(f"#define AT_{place.upper()} {statements.pop(place, '')}\n" for place in PLACES)
    assert not statements
    header += f'#define PIDS "{path.parent / "pids"}"\n'
    sources = {"odd.c": Path(__file__).with_name("odd.c").read_bytes(), "odd.h": header.encode()}
    headers = Path(fmpy.__file__).parent / "c-code"
    library = f"odd{fmpy.sharedLibraryExtension}"
    binary = compile_shared(sources, "odd.c", library, ["-I", str(headers)], "an odd FMU")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", XML.format(experiment=experiment))
        archive.writestr(f"binaries/{fmpy.platform}/{library}", binary)
    return path
