"""Who imports gymnasium and pliant has the environments; who imports pliant alone waits for nothing."""

from __future__ import annotations

import subprocess
import sys

import pytest


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_importing_both_makes_the_names_known() -> None:
    pytest.importorskip("gymnasium")
    found = run(
        "import gymnasium, pliant; print(sorted(n for n in gymnasium.registry if n[:7] == 'pliant/'))"
    )
    assert "pliant/Grasp-v0" in found
    assert "pliant/FreeBending-v0" in found


def test_pliant_alone_does_not_import_gymnasium() -> None:
    assert run("import sys, pliant; print('gymnasium' in sys.modules)") == "False"


def test_a_broken_package_is_a_warning_and_the_others_stay() -> None:
    pytest.importorskip("gymnasium")
    code = """
import warnings
from importlib.metadata import EntryPoint
import gymnasium
from pliant import environments
real = environments.entry_points
broken = EntryPoint("pliant", "no.such.module:register", environments.GROUP)
environments.entry_points = lambda **k: [broken, *real(**k)]
with warnings.catch_warnings(record=True) as heard:
    warnings.simplefilter("always")
    environments.register_environments()
print("pliant/TipLoad-v0" in gymnasium.registry, [str(w.message) for w in heard if "no.such" in str(w.message)])
"""
    found = run(code)
    assert found.startswith("True")
    assert "are not there: No module named 'no'" in found
