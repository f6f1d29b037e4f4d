"""torch and ngsolve in one process: the order in which they are loaded."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType

import pytest

from pliant.errors import MissingDependencyError, UserError
from pliant_plugins.native import load_torch

BOTH = """
from pliant_plugins.fem.ngsolve.library import ngs
import torch
m = torch.ones(5, 300, 60, dtype=torch.float64)
print(float((m.mT @ m)[0, 0, 0]))
"""


@pytest.mark.slow
def test_torch_products_survive_ngsolve() -> None:
    pytest.importorskip("torch")
    pytest.importorskip("pliant_plugins.fem.ngsolve.library", exc_type=ImportError)
    done = subprocess.run([sys.executable, "-c", BOTH], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout.strip()) == (0, "300.0"), done.stderr[-500:]


def test_ngsolve_loaded_first_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ngsolve", ModuleType("ngsolve"))
    monkeypatch.delitem(sys.modules, "torch", raising=False)
    with pytest.raises(UserError, match="needs torch, and this process has loaded ngsolve before it"):
        load_torch("it needs torch")


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "ngsolve", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingDependencyError, match=r"it needs torch: pip install 'pliant\[neural\]'"):
        load_torch("it needs torch")
