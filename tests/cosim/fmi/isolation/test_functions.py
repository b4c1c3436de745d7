"""The table of the functions that an isolated FMU supports."""

from __future__ import annotations

import re

import pytest

from cosim.codegen.c_compiler import fmi_headers
from cosim.fmi.isolation.functions import sources

#: written by hand in instances.c, and never sent to the host
_ANSWERED_HERE = {
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi3GetVersion",
    "fmi3InstantiateScheduledExecution",
    "fmi3ActivateModelPartition",
}


@pytest.mark.parametrize("version", [2, 3])
def test_every_function_of_the_headers_is_in_the_table(version):
    header = (fmi_headers() / f"fmi{version}Functions.h").read_text()
    declared = set(re.findall(rf"FMI{version}_Export\s+fmi{version}\w+TYPE\s+(fmi{version}\w+)\s*;", header))
    numbered = set(re.findall(rf"F_(fmi{version}\w+)", sources()["functions.h"]))
    assert len(declared) > 40
    assert declared - numbered <= _ANSWERED_HERE
    assert numbered <= declared


def test_a_row_becomes_both_ends_of_a_call():
    """A step has a time, and a second name for the loop; arrays have their lengths."""
    text = sources()["functions.c"]
    assert (
        "EXPORT fmi2Status loop_fmi2DoStep(void *c, double t, double h, int no_set_before)\n"
        "{ return caller_step(caller_at(c, t, t + h), F_fmi2DoStep, "
        "(struct argument[]){REAL(t), REAL(h), NUMBER(no_set_before)}, 3); }\n"
    ) in text
    assert "(struct argument[]){IN(vr, n), NUMBER(n), OUT(values, m), NUMBER(m)}, 4)" in text
    assert (
        "case F_fmi2DoStep: return (int)((fmi2DoStepTYPE *)f)(instance, real(a[0]), real(a[1]), (int)a[2]);"
        in text
    )
