"""Feedthrough: the inputs on which each output depends, read off the source code of the kernels.

A run orders its evaluation by this result (stage coupling, algebraic cycles): it holds for every
value of the parameters, and needs no compilation. The model structure of an exported FMU refines
it by element, for the parameters as they are: fmus/export/dependencies.py.

The result is a superset, by variable: assignments are followed without regard to their
order, a condition counts for everything assigned under it (for everything, where it
leads to a return, break or continue), all names of an array share its values, and a call
writes those arguments that the source of the called function writes. The
outputs of a kernel that cannot be read depend on every input and state.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import textwrap
import types
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from .participant import VECTORS, Participant

_EVALUATION = ("derivatives", "outputs", "step")


class _Flow(ast.NodeVisitor):
    """Collects `target <- sources` pairs of one function, over attributes of self and local names."""

    def __init__(self, self_name: str, globals_: Mapping[str, Any], dimensions: Mapping[str, int]) -> None:
        self.self_name = self_name
        self.globals = globals_
        #: number of dimensions of the variables of the participant, ".x" -> 0, 1, 2
        self.dimensions = dimensions
        self.conditions: list[set[str]] = []
        self.edges: list[tuple[set[str], set[str]]] = []
        #: the names that decide whether the rest of the function runs
        self.jumps: set[str] = set()
        #: names with elements that are written, and names that share memory with each other
        self.stored: set[str] = set()
        self.shared: list[set[str]] = []
        self.opaque = False

    def names(self, node: ast.AST | None) -> set[str]:
        """Return the variables whose values a node uses: `self.x` as ".x", locals as "x"."""
        if node is None or (isinstance(node, ast.Attribute) and node.attr in ("shape", "size", "ndim")):
            return set()
        if isinstance(node, ast.Attribute) and _is_dotted(node) and node.value.id == self.self_name:  # type: ignore[attr-defined]
            return {f".{node.attr}"}
        if isinstance(node, ast.Name):
            return {node.id} - {self.self_name}
        return set().union(*(self.names(child) for child in ast.iter_child_nodes(node)))

    def assign(self, targets: list[ast.expr], value: ast.AST) -> None:
        sources = self.names(value).union(*self.conditions)
        shared = self.memory_of(value)
        for target in targets:
            names = set()
            for node in ast.walk(target):
                if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
                    self.stored |= self.names(node.value)
                    sources = sources | self.names(node.slice)
                    names |= self.names(node.value)
            names = names or self.names(target)
            names |= self.names(target) if isinstance(target, (ast.Tuple, ast.List)) else set()
            self.edges.append((names, set(sources)))
            if shared:
                self.edges.append((shared, names))
                self.shared.append(shared | names)

    def memory_of(self, value: ast.AST) -> set[str]:
        """Return the variables whose memory a value may be: whole arrays, parts of them, other names."""
        if isinstance(value, (ast.Tuple, ast.List)):
            return set().union(*(self.memory_of(item) for item in value.elts))
        if isinstance(value, ast.IfExp):
            return self.memory_of(value.body) | self.memory_of(value.orelse)
        indices: list[ast.expr] = []
        while isinstance(value, ast.Subscript):
            indices += value.slice.elts if isinstance(value.slice, ast.Tuple) else [value.slice]
            value = value.value
        if not isinstance(value, (ast.Name, ast.Attribute)):
            return set()
        names = self.names(value)
        element = len(indices) if not any(isinstance(i, ast.Slice) for i in indices) else 0
        return {n for n in names if not n.startswith(".") or self.dimensions.get(n, 0) > element}

    def visit_Assign(self, node: ast.Assign) -> None:
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(node.targets) == 1:
            for one, its_value in zip(target.elts, value.elts, strict=False):
                self.assign([one], its_value)
        else:
            self.assign(node.targets, value)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.assign([node.target], node.value)
        self.stored |= self.names(node.target)
        self.generic_visit(node)

    def _single(self, node: ast.NamedExpr | ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign([node.target], node.value)
        self.generic_visit(node)

    visit_NamedExpr = visit_AnnAssign = _single

    def visit_For(self, node: ast.For) -> None:
        self.assign([node.target], node.iter)
        self._under(node.iter, node)

    def _tested(self, node: ast.While | ast.If) -> None:
        self._under(node.test, node)

    visit_While = visit_If = _tested

    def _under(self, condition: ast.expr, node: ast.AST) -> None:
        self.conditions.append(self.names(condition))
        self.generic_visit(node)
        self.conditions.pop()

    def _jump(self, node: ast.AST) -> None:
        self.jumps = self.jumps.union(*self.conditions)
        self.generic_visit(node)

    visit_Return = visit_Break = visit_Continue = visit_Raise = visit_Assert = _jump

    def _unreadable(self, node: ast.AST) -> None:
        self.opaque = True

    visit_FunctionDef = visit_Lambda = visit_Try = visit_With = visit_Match = _unreadable

    def called(self, function: ast.expr) -> Any:
        """Return the called function, or None if it is unknown."""
        if isinstance(function, ast.Name):
            return self.globals.get(function.id)
        module = self.globals.get(function.value.id) if _is_dotted(function) else None  # type: ignore[attr-defined]
        known = isinstance(module, types.ModuleType)
        return getattr(module, function.attr, None) if known else None  # type: ignore[attr-defined]

    def visit_Call(self, node: ast.Call) -> None:
        given: list[ast.expr] = [*node.args, *(k.value for k in node.keywords)]
        receiver = [node.func.value] if isinstance(node.func, ast.Attribute) else []
        for argument in [*given, *receiver]:
            if isinstance(argument, ast.Name) and argument.id == self.self_name:
                self.opaque = True
        if receiver and self.names(receiver[0]) - self.globals.keys():
            self.opaque = True  # a method of the value of a variable
        parameters = None if node.keywords else _written(self.called(node.func))
        changed = [a for i, a in enumerate(given) if parameters is None or i in parameters]
        written = set().union(*(self.memory_of(a) for a in changed))
        if written:
            self.stored |= written
            used = set().union(*(self.names(a) for a in given), *self.conditions)
            self.edges.append((written, used - written if len(written) == 1 else used))
        self.generic_visit(node)


def _is_dotted(node: ast.expr) -> bool:
    return isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)


def _flow(function: Any, kernel: bool, dimensions: Mapping[str, int]) -> _Flow | None:
    """Read a function; return None if its source cannot be read."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError, SyntaxError):
        return None
    if not isinstance(tree, ast.FunctionDef):
        return None
    known = vars(builtins) | function.__globals__
    flow = _Flow(tree.args.args[0].arg if kernel else "", known, dimensions)
    for statement in tree.body:
        flow.visit(statement)
    return None if flow.opaque else flow


@lru_cache(maxsize=256)
def _written(function: Any) -> frozenset[int] | None:
    """Return the positions of the arguments that a function may write into; None means any of them."""
    if isinstance(function, types.BuiltinFunctionType) or function in (float, int, bool, range):
        return frozenset()  # of numbers, such as math.sin
    if not isinstance(function, types.FunctionType) or hasattr(function, "kernel"):
        return None
    try:
        flow = _flow(function, False, {})
    except RecursionError:
        return None
    if flow is None:
        return None
    stored = set(flow.stored)
    for _ in flow.shared:
        stored = stored.union(*(names for names in flow.shared if names & stored))
    return frozenset(i for i, name in enumerate(inspect.signature(function).parameters) if name in stored)


def _edges(
    kernel: Callable[..., Any], dimensions: Mapping[str, int]
) -> list[tuple[set[str], set[str]]] | None:
    flow = _flow(kernel, True, dimensions)
    if flow is None:
        return None

    def own(names: set[str]) -> set[str]:  # local names belong to their kernel
        return {n if n.startswith(".") else f"{kernel.__name__}:{n}" for n in names}

    return [(own(targets), own(used | flow.jumps)) for targets, used in flow.edges]


def dependencies(participant: Participant) -> dict[str, set[str]]:
    """Return, for every output and derivative, the inputs and states that it may depend on."""
    kinds = {name: v.kind for name, v in participant.variables.items()}
    sources = {n for n, kind in kinds.items() if kind in ("input", "state")}
    wanted = [n for n, kind in kinds.items() if kind in ("output", "derivative")]
    edges: list[tuple[set[str], set[str]]] = []
    dimensions = {f".{n}": len(v.shape) for n, v in participant.variables.items()}
    dimensions |= {f".{vector}": 1 for vector in VECTORS}
    for name in _EVALUATION:
        if name in participant.kernels:
            more = _edges(participant.kernels[name], dimensions) if participant.compiled else None
            if more is None:
                return {n: set(sources) for n in wanted}
            edges += more
    reach: dict[str, set[str]] = {f".{n}": {n} if n in sources else set() for n in kinds}
    written, read = (set().union(*(edge[side] for edge in edges)) for side in (0, 1))
    for vector, kind in VECTORS.items():
        members = {f".{n}" for n, k in kinds.items() if k == kind}
        edges += [(members, {f".{vector}"})] if f".{vector}" in written else []
        edges += [({f".{vector}"}, members)] if f".{vector}" in read else []
    changed = True
    while changed:
        changed = False
        for targets, used in edges:
            reached = set().union(*(reach.get(u, set()) for u in used))
            for target in targets:
                known = reach.setdefault(target, set())
                if not reached <= known:
                    known |= reached
                    changed = True
    return {n: reach[f".{n}"] & sources for n in wanted}
