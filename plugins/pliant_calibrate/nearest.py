"""Named rubbers with the closest stress to a fitted law's, to compare a result with papers and makers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import MissingDependencyError
from pliant.interfaces.material import Material, MaterialConfig, Preset
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant_calibrate.free_curve import HomogeneousTests
from pliant_calibrate.reading import BenchData

SHOWN = 2
FARTHEST = 2.0  # ratio of stresses


@dataclass(frozen=True)
class NearMaterial:
    """Comparison of a named rubber with a fitted one.

    Attributes:
        preset: the rubber.
        stiffness: its stress over the fitted law's, mean over the data's rows; for a free curve μ over μ.
        distance: root mean square of ln of that ratio.
    """

    preset: Preset
    stiffness: float
    distance: float


def nearest_materials(context: RunContext, material: Material, data: BenchData) -> tuple[NearMaterial, ...]:
    """Return up to `SHOWN` named rubbers within `FARTHEST`, the nearest first."""
    own = _stresses(context, material.config, data)
    candidates = []
    for preset in _presets(context):
        logs = np.log(_stresses(context, preset.config, data) / own)
        candidates.append(
            NearMaterial(preset, float(np.exp(np.mean(logs))), float(np.sqrt(np.mean(logs**2))))
        )
    near = [one for one in candidates if one.distance < np.log(FARTHEST)]
    return tuple(sorted(near, key=lambda one: one.distance)[:SHOWN])


def _presets(context: RunContext) -> list[Preset]:
    presets: list[Preset] = []
    for component in context.registry.by_interface("material"):
        try:
            kind: type[Material] = component.implementation_class()
        except MissingDependencyError:
            continue
        presets += kind.presets()
    return presets


def _stresses(context: RunContext, config: MaterialConfig, data: BenchData) -> Array:
    """Return nominal stresses (n,) of the data's strained rows, incompressible; for a free curve μ (1,)."""
    if data.kind == "free":
        return np.array([context.build("material", config).shear_modulus_pa])
    rows = np.abs(data.x - 1) > 1e-3
    tests = HomogeneousTests(lambda c: context.build("material", c), data.x[rows], data.mode[rows], True)
    stress = tests.predict(config)
    return np.full(int(rows.sum()), np.nan) if stress is None else np.abs(stress)
