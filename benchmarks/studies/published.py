"""Figures of the published studies, and what these repetitions are to reach.

Yao, Howard, Maiolino, Generalized Task-Driven Design of Soft Robots via Reduced-Order FEM-based Surrogate Modeling,
Advanced Intelligent Systems 2026, doi 10.1002/aisy.70406. What it does not state is under `our_estimates`: its number
of simulations times the seconds of one of its simulations.
"""

from __future__ import annotations

from typing import Any

SOURCE = "Yao, Howard, Maiolino 2026, doi 10.1002/aisy.70406"

SHAPE: dict[str, Any] = {
    "source": SOURCE,
    "rmse_m": 4.51e-3,
    "e_max_m": 8.46e-3,
    "verified": {"rmse_m": 5.05e-3, "e_max_m": 8.19e-3},
    "our_estimates": {"evaluations_wall_s": 10 * 3600.0, "generations_wall_s": 110 * 3600.0},
}
GRIPPER: dict[str, Any] = {
    "source": SOURCE,
    "grasps": 14_400,
    "stable": 60,
    "trials": 60,
    "engines": 1,
    "law_rmse_of_largest": 0.0321,
    "our_estimates": {"wall_s": 30 * 3600.0},
}

# Targets: m, s, shares, counts.
SHAPE_BARS = {
    "polished": {"rmse_m": 0.5e-3, "e_max_m": 1e-3},
    "free": {"rmse_m": 1.5e-3, "e_max_m": 3e-3},
    "fixed": {"rmse_m": 3.5e-3, "e_max_m": 7e-3},
    "apart_m": 0.5e-3,
    "predicted_rmse_m": 4e-3,
    "law_worst": 0.03,
    "evaluations_wall_s": 120.0,
    "generations_wall_s": 1200.0,
}
GRIPPER_BARS = {"wall_s": 3600.0, "stable_share": 1.0, "law_rmse_of_largest": 0.01, "seeds": 5}
