"""Different laws of the same solid give the same module, each by its own code for stress and tangent."""

from __future__ import annotations

from typing import Any

import pytest

from pliant.records.fem import FemState
from pliant.registry.discovery import discover
from pliant_plugins.families.reference import FINGER

REGISTRY = discover()


def made(interface: str, kind: str, **keys: Any) -> Any:
    component = REGISTRY.get(interface, kind)
    return component.build(component.config_model().model_validate({"kind": kind, **keys}))


def bent(kind: str, **keys: Any) -> FemState:
    problem = made("family", "bellow_bending", **FINGER).problem()
    solver = made("fem", "skfem", pressure_max="15 kPa").solver(problem, made("material", kind, **keys))
    state: FemState = solver.free(2e3, solver.rest())
    return state


@pytest.mark.slow
def test_a_module_with_equal_solids_bends_alike() -> None:
    mooney, pair = bent("mooney_rivlin", c10=90e3, c01=30e3), bent("ogden", mu=[180e3, 60e3], alpha=[2, -2])
    assert mooney.angle_rad > 0.05
    assert pair.angle_rad == pytest.approx(mooney.angle_rad, rel=1e-9)
    assert pair.dmoment_du == pytest.approx(mooney.dmoment_du, rel=1e-7)
    assert pair.iterations <= mooney.iterations + 1
