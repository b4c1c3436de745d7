"""The functions of FMI that an isolated FMU supports, as a table, and the C code generated from it.

A row is the function's prototype without the instance; an array states its direction and
length: `in double x[n]`, `out text values[n]`. Both ends of a call are generated from it: the
function of FMI that this process calls, which packs its arguments (caller.h), and the call that the
host makes (host.c). The compiler compares both with the FMI headers. The functions that make and
free an instance are not in the table but written by hand in instances.c and host.c.

The word before a name is the way in which the loop of a run calls the function. Unless it is
"call", the function exists twice, the second time with `loop_` before its name: see caller.h.
The arguments `t`, a time, and `h`, the length of a step, are kept for the message of a crash.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_HANDMADE = """
    fmi2Instantiate fmi2FreeInstance fmi3InstantiateModelExchange fmi3InstantiateCoSimulation fmi3FreeInstance
"""
_VALUES_2 = """
get  fmi2Get{name}(in uint32_t vr[n], size_t n, out {type} values[n])
post fmi2Set{name}(in uint32_t vr[n], size_t n, in {type} values[n])
"""
_VALUES_3 = """
get  fmi3Get{name}(in uint32_t vr[n], size_t n, out {type} values[m], size_t m)
post fmi3Set{name}(in uint32_t vr[n], size_t n, in {type} values[m], size_t m)
"""
_TYPES_2 = {"Real": "double", "Integer": "int", "Boolean": "int"}
_TYPES_3 = {
    **{"Float32": "float", "Float64": "double", "Boolean": "bool"},
    **{f"{u.upper()}Int{bits}": f"{u}int{bits}_t" for bits in (8, 16, 32, 64) for u in ("", "u")},
}
_BOTH = """
call {fmi}SetDebugLogging({bool} on, size_t n, in text categories[n])
call {fmi}ExitInitializationMode()
call {fmi}EnterEventMode()
call {fmi}EnterContinuousTimeMode()
call {fmi}Terminate()
call {fmi}Reset()
call {fmi}GetFMU{s}tate(out void* state[1])
call {fmi}SetFMU{s}tate(void* state)
call {fmi}FreeFMU{s}tate(out void* state[1])
call {fmi}SerializedFMU{s}tateSize(void* state, out size_t size[1])
call {fmi}SerializeFMU{s}tate(void* state, out {fmi}Byte bytes[n], size_t n)
call {fmi}De{S}erializeFMU{s}tate(in {fmi}Byte bytes[n], size_t n, out void* state[1])
call {fmi}CompletedIntegratorStep({bool} no_set_before, out {bool} event[1], out {bool} terminate[1])
post {fmi}SetTime(double t)
post {fmi}SetContinuousStates(in double x[n], size_t n)
call {fmi}GetContinuousStates(out double x[n], size_t n)
call {fmi}GetNominalsOfContinuousStates(out double x[n], size_t n)
call {fmi}GetEventIndicators(out double z[n], size_t n)
"""
_ONLY_2 = """
call fmi2SetupExperiment(int has_tolerance, double tolerance, double t, int has_stop, double stop)
call fmi2EnterInitializationMode()
call fmi2GetString(in uint32_t vr[n], size_t n, out text values[n])
call fmi2SetString(in uint32_t vr[n], size_t n, in text values[n])
call fmi2GetDirectionalDerivative(in uint32_t of[n], size_t n, in uint32_t to[m], size_t m, \
in double seed[m], out double result[n])
call fmi2SetRealInputDerivatives(in uint32_t vr[n], size_t n, in int order[n], in double values[n])
call fmi2GetRealOutputDerivatives(in uint32_t vr[n], size_t n, in int order[n], out double values[n])
call fmi2NewDiscreteStates(out fmi2EventInfo info[1])
call fmi2GetDerivatives(out double x[n], size_t n)
step fmi2DoStep(double t, double h, int no_set_before)
call fmi2CancelStep()
call fmi2GetStatus(fmi2StatusKind kind, out fmi2Status value[1])
call fmi2GetRealStatus(fmi2StatusKind kind, out double value[1])
call fmi2GetIntegerStatus(fmi2StatusKind kind, out int value[1])
call fmi2GetBooleanStatus(fmi2StatusKind kind, out int value[1])
call fmi2GetStringStatus(fmi2StatusKind kind, out text value[1])
"""
_DERIVATIVE_3 = (
    "call fmi3Get{kind}Derivative(in uint32_t of[n], size_t n, in uint32_t to[m], size_t m, "
    "in double seed[k], size_t k, out double result[l], size_t l)\n"
)
_ONLY_3 = """
call fmi3EnterInitializationMode(bool has_tolerance, double tolerance, double t, bool has_stop, double stop)
call fmi3EnterConfigurationMode()
call fmi3ExitConfigurationMode()
call fmi3EnterStepMode()
call fmi3EvaluateDiscreteStates()
call fmi3GetString(in uint32_t vr[n], size_t n, out text values[m], size_t m)
call fmi3SetString(in uint32_t vr[n], size_t n, in text values[m], size_t m)
call fmi3GetBinary(in uint32_t vr[n], size_t n, out size_t sizes[m], out blob values[m], size_t m)
call fmi3SetBinary(in uint32_t vr[n], size_t n, in size_t sizes[m], in blob values[m], size_t m)
call fmi3GetClock(in uint32_t vr[n], size_t n, out bool values[n])
call fmi3SetClock(in uint32_t vr[n], size_t n, in bool values[n])
call fmi3GetIntervalDecimal(in uint32_t vr[n], size_t n, out double values[n], \
out fmi3IntervalQualifier qualifiers[n])
call fmi3GetIntervalFraction(in uint32_t vr[n], size_t n, out uint64_t counters[n], \
out uint64_t resolutions[n], out fmi3IntervalQualifier qualifiers[n])
call fmi3GetShiftDecimal(in uint32_t vr[n], size_t n, out double values[n])
call fmi3GetShiftFraction(in uint32_t vr[n], size_t n, out uint64_t counters[n], out uint64_t resolutions[n])
call fmi3SetIntervalDecimal(in uint32_t vr[n], size_t n, in double values[n])
call fmi3SetIntervalFraction(in uint32_t vr[n], size_t n, in uint64_t counters[n], in uint64_t resolutions[n])
call fmi3SetShiftDecimal(in uint32_t vr[n], size_t n, in double values[n])
call fmi3SetShiftFraction(in uint32_t vr[n], size_t n, in uint64_t counters[n], in uint64_t resolutions[n])
call fmi3GetOutputDerivatives(in uint32_t vr[n], size_t n, in int orders[n], out double values[m], size_t m)
call fmi3GetNumberOfVariableDependencies(uint32_t vr, out size_t n[1])
call fmi3GetVariableDependencies(uint32_t vr, out size_t elements[n], out uint32_t independents[n], \
out size_t independent_elements[n], out fmi3DependencyKind kinds[n], size_t n)
call fmi3UpdateDiscreteStates(out bool again[1], out bool terminate[1], out bool nominals[1], \
out bool states[1], out bool timed[1], out double time[1])
call fmi3GetContinuousStateDerivatives(out double x[n], size_t n)
call fmi3GetNumberOfEventIndicators(out size_t n[1])
call fmi3GetNumberOfContinuousStates(out size_t n[1])
step fmi3DoStep(double t, double h, bool no_set_before, out bool event[1], out bool terminate[1], \
out bool early[1], out double last[1])
"""
_TABLE = "".join(
    [
        _ONLY_2,
        _BOTH.format(fmi="fmi2", bool="int", s="s", S="S"),
        *(_VALUES_2.format(name=name, type=type_) for name, type_ in _TYPES_2.items()),
        _ONLY_3,
        _BOTH.format(fmi="fmi3", bool="bool", s="S", S="s"),
        *(_DERIVATIVE_3.format(kind=kind) for kind in ("Directional", "Adjoint")),
        *(_VALUES_3.format(name=name, type=type_) for name, type_ in _TYPES_3.items()),
    ]
)
_ELEMENTS = {"text": "char *", "blob": "uint8_t *"}  # of strings and binary data


@dataclass(frozen=True)
class _Argument:
    """An argument: direction ("" for a plain value), type, name, and length of an array."""

    direction: str
    type: str
    name: str
    length: str

    def parameter(self) -> str:
        """Return the declaration in the function of FMI."""
        if not self.direction:
            return f"{self.type} {self.name}"
        constant = "const " if self.direction == "in" else ""
        if self.type in _ELEMENTS:
            return f"const {_ELEMENTS[self.type]}{constant}{self.name}[]"
        return f"{constant}{self.type} {self.name}[]"

    def packed(self) -> str:
        """Return the macro of caller.h that describes the value."""
        if not self.direction:
            macro = {"double": "REAL", "void*": "HANDLE"}.get(self.type, "NUMBER")
            return f"{macro}({self.name})"
        kind = {"text": "TEXTS", "blob": "BLOBS"}.get(self.type, "")
        macro = {"in": kind or "IN", "out": f"OUT_{kind}" if kind else "OUT"}[self.direction]
        sizes = "sizes, " if macro == "BLOBS" else ""
        return f"{macro}({self.name}, {sizes}{self.length})"

    def unpacked(self, i: int) -> str:
        """Return the value in the host, from the i-th word."""
        if self.direction or self.type == "void*":
            return f"pointer(a[{i}])"
        return f"real(a[{i}])" if self.type == "double" else f"({self.type})a[{i}]"


@dataclass(frozen=True)
class _Function:
    how: str
    name: str
    arguments: tuple[_Argument, ...]

    def caller(self) -> str:
        """Return the definitions of the function that this process calls."""
        parameters = "".join(f", {a.parameter()}" for a in self.arguments)
        packed = ", ".join(a.packed() for a in self.arguments)
        names = [a.name for a in self.arguments]
        time = f"caller_at(c, t, {'t + h' if 'h' in names else 't'})" if "t" in names else "c"
        given = f"(struct argument[]){{{packed}}}, {len(names)}" if packed else "NULL, 0"
        ways = {"": "call"} | ({"loop_": self.how} if self.how != "call" else {})
        return "".join(
            f"EXPORT {self.name[:4]}Status {prefix}{self.name}(void *c{parameters})\n"
            f"{{ return caller_{how}({time}, F_{self.name}, {given}); }}\n"
            for prefix, how in ways.items()
        )

    def host(self) -> str:
        """Return the case of the host's switch that calls the FMU."""
        words = "".join(f", {a.unpacked(i)}" for i, a in enumerate(self.arguments))
        return f"    case F_{self.name}: return (int)(({self.name}TYPE *)f)(instance{words});\n"


def _parsed(row: str) -> _Function:
    match = re.fullmatch(r"(\w+) +(\w+)\((.*)\)", row)
    if match is None:
        raise ValueError(f"{row!r} is not a row of the table")
    arguments = re.findall(r"(?:(in|out) )?(\w+\*?) (\w+)(?:\[(\w+)\])?", match[3])
    return _Function(match[1], match[2], tuple(_Argument(*a) for a in arguments))


def sources() -> dict[str, str]:
    """Return the generated files by name: the numbers of the functions, and both ends of their calls."""
    functions = [_parsed(row) for row in _TABLE.splitlines() if row]
    names = [*_HANDMADE.split(), *(f.name for f in functions)]
    return {
        "functions.h": f"enum function {{ {', '.join(f'F_{n}' for n in names)}, N_FUNCTIONS }};\n",
        "functions.c": "".join(
            [
                *(f'#include "{h}.h"\n' for h in ("caller", "host", "fmi2Functions", "fmi3Functions")),
                *(f.caller() for f in functions),
                "\nint perform(enum function function, void *f, void *instance, const uint64_t a[])\n{\n",
                "    switch (function) {\n",
                *(f.host() for f in functions),
                "    default: return STATUS_ERROR;\n    }\n}\n\n",
                "EXPORT const char *function_name(int function)\n{\n    static const char *const names[] = {",
                *(f'"{n}", ' for n in names),
                "};\n    return function >= 0 && function < N_FUNCTIONS ? names[function] : NULL;\n}\n",
            ]
        ),
    }
