"""Loading FMUs: by many threads at once, and FMUs whose tool is not installed."""

from __future__ import annotations

import ctypes
import os
import re
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from cosim import FMU, FMUError, System, simulate
from cosim.cli.inspection import inspection
from tests.cosim.fmi.metronome import metronome
from tests.cosim.fmi.probe import changed, probe


def test_threads_load_one_at_a_time(tmp_path, monkeypatch):
    """FMPy changes the folder of the process while it loads: two at once would leave another folder."""
    paths = [probe(tmp_path / f"{i}.fmu", version) for i, version in enumerate(["2.0", "3.0"] * 4)]
    load = ctypes.cdll.LoadLibrary

    def slowly(path):
        time.sleep(0.02)
        return load(path)

    monkeypatch.setattr(ctypes.cdll, "LoadLibrary", slowly)
    before = os.getcwd()

    def run(path):
        return list(simulate(System({"p": FMU(path)}), step=0.25, stop=1.0)["p.x"])

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(run, paths)) == [[0.0, 0.25, 0.5, 0.75, 0.0]] * 8
    assert os.getcwd() == before


def test_an_fmu_that_needs_its_tool_says_so(tmp_path):
    path = metronome(tmp_path / "m.fmu", tool="Wonderlab 7")
    assert "needs its tool" in inspection(path)
    words = r"m \(m\.fmu\) failed to instantiate: .*\nm\.fmu needs its tool \(Wonderlab 7\) to run"
    with pytest.raises(FMUError, match=words):
        simulate(System({"m": FMU(path)}), step=0.25, stop=1.0)


def test_variables_other_than_reals_are_discrete_by_default(tmp_path):
    """pythonfmu omits the variability, which FMI 2.0 forbids and FMI 3.0 allows; it must be "discrete"."""
    whole = probe(tmp_path / "whole.fmu", "2.0")

    def without(name, old):
        if name != "modelDescription.xml":
            return old
        signal = rb'(<ScalarVariable[^>]*causality="(?:in|out)put"[^>]*?) variability="discrete"'
        text, left_out = re.subn(signal + rb"([^>]*>\s*<(?!Real))", rb"\1\2", old)
        assert left_out >= 6  # inputs and outputs of three types
        return text

    path = changed(tmp_path / "p.fmu", whole, without)
    given, left = (FMU(p).description.modelVariables for p in (whole, path))
    assert [v.variability for v in left] == [v.variability for v in given]
