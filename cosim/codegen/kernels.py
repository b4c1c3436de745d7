"""From kernels to machine code: Numba -> LLVM IR -> stripped IR -> address, cached on disk.

The loop loads the stripped IR, and the exporter links the same text into an FMU, so that both
compute the same. The IR depends on libm only. Numba is imported when a kernel is compiled for
the first time; afterwards its IR comes from the cache. The key covers everything that the code
depends on: source code of the kernels and of every function that they call, layout of the
storage, versions of the tools.
"""

from __future__ import annotations

import hashlib
import re
import sys
import threading
import types
from collections.abc import Callable, Mapping
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from ..core.participant import Participant
from ..errors import CompilationError
from .cache import cached_bytes
from .names import check_names

_LIBRARIES = {"numpy", "math", "numba", "scipy", "llvmlite", "builtins"}

#: the functions of the platform's C library that the IR of a kernel may call
LIBM = frozenset(
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 log log2 log10 "
    "log1p pow sqrt cbrt hypot fabs floor ceil trunc round rint nearbyint fmod fmin fmax copysign ldexp "
    "frexp modf erf erfc tgamma lgamma memcpy memset memmove".split()
)
_REMEDY = {
    "NRT_": "it allocates an array; write into a declared Local, by loops or cosim.functions",
    "Py": "it needs the Python runtime (an exception, a string, a Python object)",
    "numba_": "it needs Numba's runtime",
}


# ------------------------------------------------------------------- fingerprint


def _is_user_function(value: Any) -> bool:
    """Tell whether a global of a kernel is a Python function that must be compiled with it."""
    return isinstance(value, types.FunctionType) and not _is_library(value.__module__ or "")


def _is_library(module: str) -> bool:
    return module.partition(".")[0] in _LIBRARIES


def _names(code: types.CodeType) -> set[str]:
    """Return the global names that a code object and those nested in it mention."""
    nested = (c for c in code.co_consts if isinstance(c, types.CodeType))
    return set(code.co_names).union(*(_names(c) for c in nested))


def _describe(value: Any, seen: dict[int, int]) -> str:
    """Return a text that differs whenever a kernel could compute something else with `value`."""
    if isinstance(value, (tuple, list)):
        return f"{type(value).__name__}({[_describe(item, seen) for item in value]})"
    if isinstance(value, types.CodeType):
        consts = [_describe(c, seen) for c in value.co_consts]
        return f"code({value.co_code.hex()},{value.co_names},{value.co_varnames},{consts})"
    value = getattr(value, "py_func", value)  # a function under @njit
    if _is_user_function(value):
        if id(value) in seen:
            return f"seen{seen[id(value)]}"
        seen[id(value)] = len(seen)
        names = sorted(_names(value.__code__))
        used = {n: value.__globals__[n] for n in names if n in value.__globals__}
        modules = [
            m for m in used.values() if isinstance(m, types.ModuleType) and not _is_library(m.__name__)
        ]
        used |= {f"{m.__name__}.{n}": getattr(m, n) for m in modules for n in names if hasattr(m, n)}
        defaults = _describe([value.__defaults__, sorted((value.__kwdefaults__ or {}).items())], seen)
        cells = [_describe(c.cell_contents, seen) for c in value.__closure__ or ()]
        globals_ = [f"{n}={_describe(v, seen)}" for n, v in used.items()]
        code = value.__code__
        if code.co_consts[:1] == (value.__doc__,):  # the docstring; it does not change what is computed
            code = code.replace(co_consts=(None, *code.co_consts[1:]))
        return (
            f"function({_describe(code, seen)},{defaults},{cells},{globals_},{getattr(value, 'kernel', '')})"
        )
    if isinstance(value, types.ModuleType):
        return f"module({value.__name__})"
    if hasattr(value, "__module__") and hasattr(value, "__qualname__"):
        return f"object({value.__module__}.{value.__qualname__})"
    if hasattr(value, "tobytes"):
        return f"array({value.dtype},{value.shape},{value.tobytes().hex()})"
    return repr(value)


@lru_cache(maxsize=1)
def _tools() -> tuple[str, ...]:
    """Return the versions of everything that makes the code: this file, Python, libraries, processor."""
    versions = (version(name) for name in ("numba", "llvmlite", "numpy"))
    own = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    return own, sys.version, *versions, llvm.get_host_cpu_name()


def fingerprint(functions: Mapping[str, Callable[..., Any]], *more: object) -> str:
    """Return a hash of functions, of all functions and constants they use, and of the tool versions."""
    seen: dict[int, int] = {}
    parts = [f"{name}:{_describe(function, seen)}" for name, function in functions.items()]
    parts += [*(repr(item) for item in more), *_tools()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


# ---------------------------------------------------------------------- lowering


def _jitted(
    function: Callable[..., Any], kernels: Mapping[str, Callable[..., Any]], memo: dict[Any, Any]
) -> Any:
    """Return `function` for Numba, with the Python functions that it calls made compilable too."""
    import numba

    if function in memo:
        return memo[function]
    if hasattr(function, "kernel"):
        memo[function] = _jitted(kernels[function.kernel], kernels, memo)
        return memo[function]
    globals_ = dict(function.__globals__)
    twin = types.FunctionType(
        function.__code__, globals_, function.__name__, function.__defaults__, function.__closure__
    )
    memo[function] = _without_python(numba.njit(twin, error_model="numpy"))
    for name in _names(function.__code__):
        if _is_user_function(globals_.get(name)):
            globals_[name] = _jitted(globals_[name], kernels, memo)
    return memo[function]


def _without_python(dispatcher: Any) -> Any:
    """Leave out the parts that only Python needs: wrappers, and machine code for each function.

    These are Numba's internals; tests/cosim/codegen/test_kernels.py notices when they change.
    """

    def flags_without_wrappers(flags: Any) -> Any:
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags

    def keep(compiled: Any) -> None:
        compiled = compiled._replace(entry_point=object())  # the key by which callers find the code
        dispatcher.targetctx.insert_user_function(compiled.entry_point, compiled.fndesc, [compiled.library])
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    dispatcher._compiler._customize_flags = flags_without_wrappers
    dispatcher.add_overload = keep
    return dispatcher


def _lower(name: str, dispatcher: Any, signature: tuple[Any, ...]) -> str:
    """Compile a kernel of (storage, then up to two times); return IR of `i32 name(ptr, double, double)`.

    The function returns 0, or Numba's code of the exception that was raised.
    """
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.errors import NumbaError

    try:
        dispatcher.compile(signature)
    except NumbaError as error:
        raise CompilationError(f"{name} cannot be compiled: {_first_reason(str(error))}") from error
    except (AssertionError, NotImplementedError) as error:
        raise CompilationError(
            f"{name} cannot be compiled: Numba does not support an operation in it, such as assigning a "
            "whole array to a declared variable; use assign(x, self.y) or a loop"
        ) from error
    compiled = dispatcher.overloads[signature]
    returned = str(compiled.signature.return_type)
    if returned != "none":
        raise CompilationError(
            f"{name} returns a value ({returned}); a kernel writes to self and returns nothing"
        )
    with global_compiler_lock:
        compiled.library._ensure_finalized()
    inner = compiled.fndesc.llvm_func_name
    given = ("ptr %self", "double %t", "double %h")
    passed = ", ".join(given[: len(signature)])
    # Numba's convention: status f(return value *, exception **, arguments); -2 says "returned None"
    wrapper = f"""
declare i32 @"{inner}"(ptr, ptr, {", ".join(a.split()[0] for a in given[: len(signature)])})
define i32 @"{name}"({", ".join(given)}) {{
  %ret = alloca i64
  %exc = alloca ptr
  %status = call i32 @"{inner}"(ptr %ret, ptr %exc, {passed})
  %none = icmp eq i32 %status, -2
  %result = select i1 %none, i32 0, i32 %status
  ret i32 %result
}}
"""
    module = llvm.parse_assembly(compiled.library.get_llvm_str())
    glue = llvm.parse_assembly(wrapper)
    glue.triple, glue.data_layout = module.triple, module.data_layout
    module.link_in(glue)
    return _stripped(module, name)


def _first_reason(text: str) -> str:
    """Return the lines of a Numba error that a user can act on."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    lines = [line.strip() for line in plain.splitlines() if line.strip()]
    useful = [line for line in lines if not line.startswith(("Failed in", "During:", "-", "*", "This error"))]
    return " ".join(useful[:4])


def _stripped(module: Any, name: str) -> str:
    """Keep `name` and the functions that it needs; remove all others, such as wrappers for Python."""
    for item in [*module.functions, *module.global_variables]:
        if not item.is_declaration and item.name != name:
            item.linkage = "internal"
    machine = _target_machine()
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = True
    options.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    check_symbols(module, name)
    return "\n".join(line for line in str(module).splitlines() if not line.startswith("target ")) + "\n"


def check_symbols(module: Any, name: str) -> None:
    """Refuse a kernel that needs a symbol outside libm, which neither the loop nor an FMU has."""
    for function in module.functions:
        symbol = function.name
        if function.is_declaration and not symbol.startswith("llvm.") and symbol not in LIBM:
            known = (text for prefix, text in _REMEDY.items() if symbol.startswith(prefix))
            why = next(known, "it is not in libm; call only functions of libm and of cosim.functions")
            raise CompilationError(f"{name} needs '{symbol}', which compiled code does not have: {why}")


def _target_machine(jit: bool = False) -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=jit)


def kernel_key(participant: Participant) -> str:
    """Return the hash of everything that the compiled kernels of a participant depend on."""
    return fingerprint(participant.kernels, str(participant.dtype))


def lower(participant: Participant) -> str:
    """Return LLVM IR with `i32 kernel_NAME(double *storage, double t, double h)` for every kernel NAME.

    The text names no target and needs no symbol but libm's. Raises CompilationError,
    naming class and kernel, when Numba cannot compile a kernel or when the code needs Python.
    """
    file = f"kernels/{kernel_key(participant)}.ll"
    return cached_bytes(file, lambda: _lower_kernels(participant).encode()).decode()


def _lower_kernels(participant: Participant) -> str:
    import numba

    check_names(participant)
    storage = numba.from_dtype(participant.dtype)
    memo: dict[Any, Any] = {}
    modules = []
    for name, kernel in participant.kernels.items():
        times = kernel.__code__.co_argcount - 1
        signature = (storage, *([numba.float64] * times))
        dispatcher = _jitted(kernel, participant.kernels, memo)
        try:
            text = _lower(f"kernel_{name}", dispatcher, signature)
        except CompilationError as error:
            raise CompilationError(f"{type(participant).__name__}: {error}") from error
        modules.append(llvm.parse_assembly(text))
    for module in modules[1:]:
        modules[0].link_in(module)
    return str(modules[0])


# ----------------------------------------------------------------------- loading

_engines: dict[str, Any] = {}
_engines_lock = threading.Lock()  # an engine that a second thread replaced would be freed with its code


def load(ir: str) -> Callable[[str], int]:
    """Compile IR for this machine; return a function that gives the address of a symbol."""
    key = hashlib.sha256(ir.encode()).hexdigest()
    with _engines_lock:
        if key not in _engines:
            engine = llvm.create_mcjit_compiler(llvm.parse_assembly(ir), _target_machine(jit=True))
            engine.finalize_object()
            _engines[key] = engine
    address: Callable[[str], int] = _engines[key].get_function_address
    return address


def kernel_addresses(participant: Participant) -> dict[str, int]:
    """Return the address of every compiled kernel of a participant."""
    symbol = load(lower(participant))
    return {name: symbol(f"kernel_{name}") for name in participant.kernels}
