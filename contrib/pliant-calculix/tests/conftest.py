"""Shared fixtures: the box, the sample rubber, and whether ccx is installed."""

from __future__ import annotations

import shutil
from typing import Any

import pytest

from pliant.interfaces.material import Material
from pliant.records.fem import ModuleProblem
from pliant.registry.discovery import discover
from pliant.testing.box import box_problem

RUBBER = {"kind": "neo_hookean", "shear_modulus": "100 kPa", "poisson_ratio": 0.3}


@pytest.fixture
def needs_ccx() -> None:
    if shutil.which("ccx") is None:
        pytest.skip("needs the program ccx: apt install calculix-ccx")


@pytest.fixture(scope="session")
def box() -> ModuleProblem:
    return box_problem()


def built(interface: str, **block: Any) -> Any:
    """Return a component of this environment."""
    registry = discover()
    model = registry.get(interface, block["kind"]).config_model()
    return registry.build(interface, model.model_validate(block))


@pytest.fixture(scope="session")
def build() -> Any:
    return built


@pytest.fixture(scope="session")
def rubber() -> Material:
    material: Material = built("material", **RUBBER)
    return material
