"""The parts of an SSP as text, from which the tests of the reader build packages."""

from __future__ import annotations

from cosim.ssp.format import NAMESPACES

SPACES = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES.items())
REAL = "<ssc:Real/>"


def component(name, source, connectors, more="", **attributes):
    """A component; connectors are "name kind [unit]"."""
    listed = ""
    for text in connectors:
        name_, kind, *unit = text.split()
        given = f' unit="{unit[0]}"' if unit else ""
        listed += f'<ssd:Connector name="{name_}" kind="{kind}"><ssc:Real{given}/></ssd:Connector>'
    extra = "".join(f' {k}="{v}"' for k, v in attributes.items())
    return (
        f'<ssd:Component name="{name}" source="resources/{source}.fmu"{extra}>'
        f"<ssd:Connectors>{listed}</ssd:Connectors>{more}</ssd:Component>"
    )


def connection(start, end, inside="", **attributes):
    """A connection between "element.connector" or "connector", of the system itself."""
    text = ""
    for which, where in (("start", start), ("end", end)):
        element, _, name = where.rpartition(".")
        text += f' {which}Element="{element}"' if element else ""
        text += f' {which}Connector="{name}"'
    extra = "".join(f' {k}="{v}"' for k, v in attributes.items())
    return f"<ssd:Connection{text}{extra}>{inside}</ssd:Connection>"


def system(elements, connections="", before="", after="", name="top"):
    joined = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    inside = f"{before}<ssd:Elements>{elements}</ssd:Elements>{joined}{after}"
    return f'<ssd:System name="{name}">{inside}</ssd:System>'


def parameters(**values):
    """A parameter set of reals, in place."""
    listed = "".join(
        f'<ssv:Parameter name="{n.replace("__", ".")}"><ssv:Real value="{v}"/></ssv:Parameter>'
        for n, v in values.items()
    )
    inside = f"<ssv:Parameters>{listed}</ssv:Parameters>"
    return f'<ssv:ParameterSet version="1.0" name="set" {SPACES}>{inside}</ssv:ParameterSet>'


def binding(inside="", **attributes):
    extra = "".join(f' {k}="{v}"' for k, v in attributes.items())
    values = f"<ssd:ParameterValues>{inside}</ssd:ParameterValues>" if "source" not in attributes else inside
    return f"<ssd:ParameterBinding{extra}>{values}</ssd:ParameterBinding>"


def bindings(*each):
    return f"<ssd:ParameterBindings>{''.join(each)}</ssd:ParameterBindings>"


GAIN = ["x input", "u output"]
SUM = ["u input", "x output", "y output"]
TWO = component("g", "Gain", GAIN) + component("h", "Gain", GAIN)
