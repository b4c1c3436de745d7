"""Which outputs depend on which inputs: read off the source code of the kernels.

The answer is a superset, by variable: assignments are followed without regard to their
order, a condition counts for everything assigned under it, and a call may write every
declared variable that it is given. What cannot be read depends on everything.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .participant import Participant

_EVALUATION = ("derivatives", "outputs", "step")


class _Flow(ast.NodeVisitor):
    """Collects `target <- sources` pairs of one kernel, over attributes of self and local names."""

    def __init__(self, self_name: str) -> None:
        self.self_name = self_name
        self.conditions: list[set[str]] = []
        self.edges: list[tuple[set[str], set[str]]] = []
        self.opaque = False

    def names(self, node: ast.AST | None) -> set[str]:
        """Return the variables that a node mentions: `self.x` as ".x", locals as "x"."""
        found: set[str] = set()
        for child in ast.walk(node) if node is not None else ():
            if isinstance(child, ast.Attribute) and isinstance(child.value, ast.Name):
                if child.value.id == self.self_name:
                    found.add(f".{child.attr}")
            elif isinstance(child, ast.Name) and child.id != self.self_name:
                found.add(child.id)
        return found

    def assign(self, targets: list[ast.expr], value: ast.AST) -> None:
        sources = self.names(value).union(*self.conditions)
        for target in targets:
            inner = target
            while isinstance(inner, (ast.Subscript, ast.Starred)):
                if isinstance(inner, ast.Subscript):
                    sources = sources | self.names(inner.slice)
                inner = inner.value
            self.edges.append((self.names(inner), sources | self.names(target)))

    def visit_Assign(self, node: ast.Assign) -> None:
        self.assign(node.targets, node.value)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.assign([node.target], node.value)
        self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign([node.target], node.value)
        self.generic_visit(node)

    def visit_For(self, node: ast.For) -> None:
        self.assign([node.target], node.iter)
        self._under(node.iter, node)

    def visit_While(self, node: ast.While) -> None:
        self._under(node.test, node)

    def visit_If(self, node: ast.If) -> None:
        self._under(node.test, node)

    def _under(self, condition: ast.expr, node: ast.AST) -> None:
        self.conditions.append(self.names(condition))
        self.generic_visit(node)
        self.conditions.pop()

    def visit_Call(self, node: ast.Call) -> None:
        given = [*node.args, *(k.value for k in node.keywords)]
        method = isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name)
        receiver = [node.func.value] if method else []  # type: ignore[attr-defined]
        if any(isinstance(a, ast.Name) and a.id == self.self_name for a in [*given, *receiver]):
            self.opaque = True
        whole = {f".{a.attr}" for a in given if isinstance(a, ast.Attribute)}
        views = {n for a in given if isinstance(a, ast.Subscript) for n in self.names(a.value)}
        locals_ = {a.id for a in given if isinstance(a, ast.Name)}
        written = whole | views | locals_
        if written:
            self.edges.append((written, set().union(*(self.names(a) for a in given), *self.conditions)))
        self.generic_visit(node)


def _edges(kernel: Callable[..., Any]) -> list[tuple[set[str], set[str]]] | None:
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(kernel)))
    except (OSError, TypeError, SyntaxError):
        return None
    function = tree.body[0]
    if not isinstance(function, ast.FunctionDef):
        return None
    flow = _Flow(function.args.args[0].arg)
    for statement in function.body:
        flow.visit(statement)
    return None if flow.opaque else flow.edges


def dependencies(participant: Participant) -> dict[str, set[str]]:
    """Return, for every output and derivative, the inputs and states that it may depend on."""
    kinds = {name: v.kind for name, v in participant.variables.items()}
    sources = {n for n, kind in kinds.items() if kind in ("input", "state")}
    wanted = [n for n, kind in kinds.items() if kind in ("output", "derivative")]
    edges: list[tuple[set[str], set[str]]] = []
    for name in _EVALUATION:
        if name in participant.kernels:
            more = _edges(participant.kernels[name])
            if more is None:
                return {n: set(sources) for n in wanted}
            edges += more
    reach: dict[str, set[str]] = {f".{n}": {n} if n in sources else set() for n in kinds}
    for vector, kind in (("input_vector", "input"), ("state_vector", "state")):
        reach[f".{vector}"] = {n for n in sources if kinds[n] == kind}
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
    vectors = reach.get(".derivative_vector", set())
    return {n: (reach[f".{n}"] | (vectors if kinds[n] == "derivative" else set())) & sources for n in wanted}
