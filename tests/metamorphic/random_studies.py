"""Random studies of chains with stated laws, and what they simulate."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np

from pliant import api
from pliant.pipeline.simulate import run_task
from pliant.pipeline.study import build_study_chain, study_physics

Raw = dict[str, Any]


def random_study(rng: np.random.Generator) -> Raw:
    """Return a planar chain under pressure, weight, payload and a force at its tip, as a study file says it in SI."""

    def draw(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    coefficients = {
        "k_n": draw(0.5e-6, 2e-6),
        "m_a": draw(-1e-6, 1e-6),
        "m_e": draw(-5e-3, 5e-3),
        "b_e": draw(0.02, 0.06),
    }
    return {
        "pliant": 1,
        "name": "random",
        "surrogate": {"kind": "polynomial", "form": "study", "odd": True, "coefficients": coefficients},
        "chain": {
            "modules": int(rng.integers(2, 8)),
            "module_length_m": draw(5e-3, 15e-3),
            "module_mass_kg": draw(5e-4, 2e-3),
            "module_radius_m": draw(3e-3, 8e-3),
            "payload_kg": draw(0.0, 5e-3),
            "base": {"direction": [[1, 0, 0], [0, 0, -1], [0.6, 0, -0.8]][int(rng.integers(3))]},
        },
        "physics": {"kind": "quasistatic", "tolerance": 1e-12},
        "task": {
            "kind": "tip_load",
            "pressure_pa": draw(1e3, 8e3),
            "tip_force_n": [draw(-0.02, 0.02), 0.0, draw(-0.02, 0.02)],
        },
    }


def settled_tip(raw: Raw, folder: Path) -> np.ndarray:
    """Return the settled tip (3,) of a study, m; NaN where the engine did not converge."""
    path = folder / "study.yaml"
    path.write_text(json.dumps(raw), encoding="utf-8")
    opened = api.open_study(path, store=folder / "store")
    bench, study = opened.context, opened.study
    chain = build_study_chain(bench, study).chain
    effects = [bench.build("effect", effect) for effect in study.effects]
    result = run_task(
        bench.build("physics", study_physics(bench, study)),
        bench.build("task", study.task),
        effects,
        chain,
    )
    return np.asarray(result.final.tip_m) if result.final.converged else np.full(3, np.nan)


def changed(raw: Raw, **blocks: Any) -> Raw:
    """Return a deep copy with keys of blocks set: `chain={"modules": 4}`."""
    other = copy.deepcopy(raw)
    for name, values in blocks.items():
        if isinstance(values, dict) and isinstance(other.get(name), dict):
            other[name].update(copy.deepcopy(values))
        else:
            other[name] = copy.deepcopy(values)
    return other
