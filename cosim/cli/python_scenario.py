"""The search for Python scenarios and blocks, by name or by path, and their loading."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pkgutil
import sys
from pathlib import Path
from traceback import extract_tb
from types import ModuleType

from ..core.participant import Participant
from ..errors import CosimError, did_you_mean
from ..fmi.fmu import FMU
from .scenario import Scenario, ScenarioError


def scenario_names() -> list[str]:
    """Return the names of the scenarios of this installation: files and folders that define a study."""
    package = importlib.import_module("scenarios")
    found = [m.name for m in pkgutil.iter_modules(package.__path__)]
    return sorted(n for n in found if _defines_a_study(n))


def _defines_a_study(name: str) -> bool:
    """Return whether a module defines Study or run, from its source, without importing it."""
    tree = ast.parse(_source(name))
    return any(getattr(node, "name", None) in ("Study", "run") for node in tree.body)


def _source(name: str) -> str:
    """Return the source of a scenario's file, or of study.py in its folder; "" if it has none."""
    try:
        spec = importlib.util.find_spec(_module_of(name))
    except ModuleNotFoundError:
        spec = None
    return Path(spec.origin).read_text(encoding="utf-8") if spec is not None and spec.origin else ""


def _module_of(name: str) -> str:
    spec = importlib.util.find_spec(f"scenarios.{name}")
    is_folder = spec is not None and spec.submodule_search_locations is not None
    return f"scenarios.{name}.study" if is_folder else f"scenarios.{name}"


def summary(name: str) -> str:
    """Return the first line of a scenario's docstring, without importing it."""
    return (ast.get_docstring(ast.parse(_source(name))) or "").partition("\n")[0]


def python_scenario(name: str) -> Scenario:
    """Return a scenario of this installation by its name, or a user's by the path of its .py file."""
    if name.endswith(".py"):
        return Scenario(Path(name).stem, load_file(Path(name)))
    if name not in scenario_names():
        raise ScenarioError(f"there is no scenario '{name}'" + did_you_mean(name, scenario_names()))
    module = _module_of(name)
    modules = [importlib.import_module(module)]
    if module.endswith(".study"):
        table = f"scenarios.{name}.table"
        modules += [importlib.import_module(table)] if importlib.util.find_spec(table) else []
    return Scenario(name, *modules)


def load_file(path: Path) -> ModuleType:
    """Load a user's Python file; it may import modules of its own folder.

    The module gets a name that no other module has, and its folder is searched last, so that
    a file named random.py or numpy.py does not replace another module.
    """
    if not path.is_file():
        raise ScenarioError(f"there is no file {path}; give the path or the name of a scenario")
    name = f"_file_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ScenarioError(f"{path} cannot be loaded as a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    folder = str(path.parent.resolve())
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        spec.loader.exec_module(module)
    except CosimError:
        raise
    except Exception as error:  # a user's file may raise anything
        lines = [f.lineno for f in extract_tb(error.__traceback__) if f.filename == spec.origin]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        raise ScenarioError(f"{path}, line {line}: {type(error).__name__}: {error}") from error
    return module


def find_part(text: str) -> Participant | FMU | type[Participant]:
    """Return the block that `file.py:Class`, `module:Class` or `scenario:participant` names."""
    where, colon, wanted = text.rpartition(":")
    if not colon:
        raise ScenarioError(f"'{text}': write FILE.py:CLASS, module:CLASS or scenario:participant")
    if where in scenario_names():
        return python_scenario(where).participant(wanted)
    try:
        module = load_file(Path(where)) if where.endswith(".py") else importlib.import_module(where)
    except ModuleNotFoundError as error:
        raise ScenarioError(f"'{text}': there is no module '{error.name}'; give a file as FILE.py") from error
    found = getattr(module, wanted, None)
    if isinstance(found, (Participant, FMU)) or (isinstance(found, type) and issubclass(found, Participant)):
        return found
    if found is None and (hasattr(module, "Study") or hasattr(module, "build")):
        return Scenario(where, module).participant(wanted)
    classes = {n: v for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, Participant)}
    parts = [n for n, v in classes.items() if not v.__module__.startswith("cosim.")]
    raise ScenarioError(f"{where} has no block '{wanted}'" + did_you_mean(wanted, parts))
