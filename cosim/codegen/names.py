"""The names of a kernel, checked before it is compiled: `self.x` must be declared.

The compiler would end in an error that names neither the class nor the line.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

from ..core.participant import VECTORS, Participant
from ..errors import CompilationError, DeclarationError, did_you_mean


def check_names(participant: Participant) -> None:
    """Refuse a name of `self` in a kernel that is not declared, with file and line.

    Raises DeclarationError for a name that the instance does not have at all, CompilationError
    for a method or another attribute of Python's, which a compiled kernel cannot reach.
    """
    known = [*participant.variables, *VECTORS]
    for kernel, function in participant.kernels.items():
        for name, line in _attributes(function):
            if name in known:
                continue
            where = f"{type(participant).__name__}.{kernel} ({inspect.getsourcefile(function)}, line {line})"
            if hasattr(participant, name):
                raise CompilationError(
                    f"{where} uses self.{name}, which is not a declared variable; declare it as a Parameter, "
                    "or write a method as a function outside the class"
                )
            raise DeclarationError(
                f"{where} uses self.{name}, which is not declared{did_you_mean(name, known)}; "
                "a State keeps a value from step to step, a Local is working memory"
            )


def _attributes(function: Callable[..., Any]) -> Iterator[tuple[str, int]]:
    """Yield the attributes of `self` that a function uses, with their lines; none without its source."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError):
        return
    (definition,) = tree.body
    if not isinstance(definition, ast.FunctionDef) or not definition.args.args:
        return
    self_name = definition.args.args[0].arg
    for node in ast.walk(definition):
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == self_name
        ):
            yield node.attr, first + node.lineno - 1
