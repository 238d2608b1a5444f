"""System structures as a stranger might write them."""

from __future__ import annotations

from pathlib import Path

from gossamer_orchestrator import open_ssp
from simulated import simulate

SSD = """<?xml version="1.0" encoding="UTF-8"?>
<SystemStructureDescription xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription"
  xmlns:c="http://ssp-standard.org/SSP1/SystemStructureCommon"
  xmlns:v="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
  xmlns:m="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
  version="1.0" name="other" description="Not ours">
  <!-- a comment -->
  <System name="root">{content}</System>
  {rest}
</SystemStructureDescription>
"""


SSV = """<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="any">
  <ssv:Parameters>{}</ssv:Parameters>
  <ssv:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" factor="1000"/></ssc:Unit></ssv:Units></ssv:ParameterSet>"""


EXPERIMENT = '<DefaultExperiment stopTime="1.0"/>'


def connector(name: str, kind: str, unit: str = "") -> str:
    return f'<Connector name="{name}" kind="{kind}"><c:Real{unit}/></Connector>'


def component(name: str, fmu: str, connectors: str = "", more: str = "") -> str:
    connectors = f"<Connectors>{connectors}</Connectors>" if connectors else ""
    return f'<Component name="{name}" source="resources/{fmu}.fmu">{connectors}{more}</Component>'


def real(name: str, value: float, unit: str = "") -> str:
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{unit}/></ssv:Parameter>'


def bindings(content: str, source: str = "", inside: str = "") -> str:
    content = f"<ParameterValues>{content.replace('ssv:', 'v:').replace(':ssv', ':v')}</ParameterValues>" if content else ""
    return f"<ParameterBindings><ParameterBinding{source}>{content}{inside}</ParameterBinding></ParameterBindings>"


def connection(start: str, end: str, content: str = "", more: str = "") -> str:
    a, _, b = start.rpartition(".")
    c, _, d = end.rpartition(".")
    a, c = (f' startElement="{a}"' if a else ""), (f' endElement="{c}"' if c else "")
    return f'<Connection{a} startConnector="{b}"{c} endConnector="{d}"{more}>{content}</Connection>'


def system(elements: str, connections: str = "", connectors: str = "", more: str = "") -> str:
    connectors = f"<Connectors>{connectors}</Connectors>" if connectors else ""
    return f"{connectors}{more}<Elements>{elements}</Elements><Connections>{connections}</Connections>"


GAIN = connector("y", "output") + connector("u", "input")


SUM = connector("u", "input")


INNER = f"""<System name="inner">{
    system(
        component("gain", "gain", GAIN, bindings(SSV.format(real("factor", 2.0) + real("offset[1]", 1.0)))),
        connection("in", "gain.u") + connection("gain.y", "out"),
        connector("in", "input") + connector("out", "output"),
        bindings(SSV.format(real("gain.factor", 5.0))),
    )
}</System>"""


NESTED = system(
    INNER + component("sum", "integrator", SUM),
    connection("drive", "inner.in") + connection("inner.out", "sum.u", '<c:LinearTransformation factor="1"/>'),
    connector("drive", "input"),
    bindings(SSV.format(real("drive", 3.0) + real("inner.gain.factor", 7.0))),
)


def last(path: Path, name: str, **options: float) -> float:
    with open_ssp(path, step=0.1, **options) as scenario:
        return float(simulate(scenario, Path("nowhere"))[name][-1])
