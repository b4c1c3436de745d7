"""Other tools are imported from their wheels alone; an error in one line names a missing one."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from cosim import CosimError
from fmus.packaging import other_tools
from scenarios import controller_in_ssp
from tests.others import tool


@pytest.mark.parametrize(
    ("load", "module", "package"),
    [(other_tools.ecospy, "ecospy", "ecospy"), (other_tools.opensees, "openseespy.opensees", "openseespy")],
)
def test_a_tool_that_is_missing_is_named_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, load: Callable[[], ModuleType], module: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)  # Python's way of refusing an import
    with pytest.raises(CosimError, match=rf"^{module} cannot be imported .*pip install {package}"):
        load()
    with pytest.raises(pytest.skip.Exception, match="cannot be imported"):
        tool(load)


def test_the_library_of_the_wheel_is_loaded_first_and_visible_to_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """On any machine: the library is loaded first, then the module is imported."""
    calls: list[object] = []
    monkeypatch.delitem(sys.modules, "ecospy", raising=False)
    monkeypatch.setattr(
        other_tools, "files", lambda name: [Path(name) / "libtbb.so", Path(name) / "libtbb.so.12"]
    )
    monkeypatch.setattr(Path, "locate", lambda self: "/wheel" / self, raising=False)
    monkeypatch.setattr(ctypes, "CDLL", lambda path, mode: calls.append((path, mode)))
    monkeypatch.setattr(other_tools.importlib, "import_module", lambda name: calls.append(name))
    other_tools.ecospy()
    assert calls == [("/wheel/tbb/libtbb.so.12", ctypes.RTLD_GLOBAL), "ecospy"]


def test_a_table_without_ecos_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "ecospy", None)
    rows = controller_in_ssp.table(ssp=tmp_path / "loop.ssp")
    assert [row["loop"] for row in rows] == ["here, late", "here"]
    assert "ecospy cannot be imported" in capsys.readouterr().out


@pytest.mark.skipif(sys.platform != "linux", reason="the extra `test` has both tools on Linux only")
def test_both_tools_live_in_one_process() -> None:
    """In a separate process, since OpenSees writes a line when its process ends."""
    code = "from fmus.packaging.other_tools import *; print(ecospy().__name__, opensees().__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.split()[:2] == ["ecospy", "openseespy.opensees"], done.stderr
