"""Importing gymnasium and pliant registers the environments; importing pliant alone loads nothing for them."""

from __future__ import annotations

import subprocess
import sys

import pytest


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_pliant_configs_and_models_that_torch_trains_import_nothing_heavy() -> None:
    """Torch and gymnasium are imported only where something is trained."""
    names = ("pliant", "pliant_search.optimizers.config", "pliant_ppo.config")
    names += ("pliant_designs.meta_models.neural", "pliant_designs.meta_models.coefficients")
    heavy = ("torch", "stable_baselines3", "gymnasium")
    assert run(f"import sys, {', '.join(names)}; print([m for m in {heavy} if m in sys.modules])") == "[]"


def test_importing_both_makes_the_names_known_and_a_broken_package_is_a_warning() -> None:
    pytest.importorskip("gymnasium")
    code = """
import warnings
import gymnasium, pliant
print(*sorted(name for name in gymnasium.registry if name[:7] == "pliant/"))
import importlib.metadata as metadata
real = metadata.entry_points
broken = metadata.EntryPoint("pliant", "no.such.module:register", "gymnasium.envs")
metadata.entry_points = lambda **k: [broken, *real(**k)]
with warnings.catch_warnings(record=True) as heard:
    warnings.simplefilter("always")
    pliant.register_environments()
print("pliant/TipLoad-v0" in gymnasium.registry, [str(w.message) for w in heard if "no.such" in str(w.message)])
"""
    names, after = run(code).splitlines()
    assert {"pliant/Grasp-v0", "pliant/FreeBending-v0"} <= set(names.split())
    assert after.startswith("True")
    assert "are not there: No module named 'no'" in after
