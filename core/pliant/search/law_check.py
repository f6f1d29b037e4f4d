"""What the law that a search used misses of direct FEM of the same design."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.pipeline.meta_model.designs import trusted
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw

BAND = 0.9


def law_misses(law: JointLaw, data: ModuleData, name: str = "") -> dict[str, Any]:
    """Errors of a law on all trusted states of a design, fitted or kept for checks, as meta-models are scored.

    Lateral axes count only in states that move them.

    Args:
        law: of the search; its axes are those of the data.
        data: direct FEM of the design.
        name: of the design.

    Returns:
        `rmse_of_largest`, `worst_of_largest`: shares of the largest |τ| of these states, over all axes;
        `rmse_of_range`, `worst_of_range`: shares of max − min of each axis' τ, of the worst axis; `largest_effort`
        (N·m, or N); `n_states`; `n_outside`: those of them outside the law's own domain; `in_band`: share of the
        states inside the law's 90 % band, NaN where it states none; `axes`: axis → its own shares and `n_states`.
    """
    keep = trusted(data)
    order = [data.axes.index(axis) for axis in law.axes]
    p, u, tau = data.actuation[keep], data.deformation[keep][:, order], data.tau[keep][:, order]
    counts = _counted(law, data, keep) & np.isfinite(tau)
    if not counts.any():
        return {"name": name, "n_states": 0, "axes": {}}
    miss = law.evaluate(p, u).tau - tau
    largest = float(np.abs(tau[counts]).max()) or 1.0
    axes = {
        axis: _of_axis(miss[rows, k], tau[rows, k])
        for k, axis in enumerate(law.axes)
        if (rows := counts[:, k]).any()
    }
    return {
        "name": name,
        "n_states": len(p),
        "n_outside": int(np.any(law.domain.excess(p, u) != 0, axis=1).sum()),
        "largest_effort": largest,
        "rmse_of_largest": _rms(miss[counts]) / largest,
        "worst_of_largest": float(np.abs(miss[counts]).max()) / largest,
        "rmse_of_range": max(one["rmse_of_range"] for one in axes.values()),
        "worst_of_range": max(one["worst_of_range"] for one in axes.values()),
        "in_band": _in_band(law, p, u, miss, counts),
        "axes": axes,
    }


def _counted(law: JointLaw, data: ModuleData, keep: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n, k) whether a state tells of an axis: lateral ones only where they are explored or all axes are held."""
    lateral = data.explored[keep] != data.main_axis
    columns = [np.ones(int(keep.sum()), bool) if axis == data.main_axis else lateral for axis in law.axes]
    return np.stack(columns, axis=1)


def _of_axis(miss: Array, tau: Array) -> dict[str, Any]:
    width, largest = float(np.ptp(tau)) or 1.0, float(np.abs(tau).max()) or 1.0
    rmse, worst = _rms(miss), float(np.abs(miss).max())
    return {
        "n_states": len(miss),
        "rmse_of_range": rmse / width,
        "worst_of_range": worst / width,
        "rmse_of_largest": rmse / largest,
        "worst_of_largest": worst / largest,
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _in_band(law: JointLaw, p: Array, u: Array, miss: Array, counts: NDArray[np.bool_]) -> float:
    band = law.band(p, u, BAND)
    return float("nan") if band is None else float(np.mean((np.abs(miss) <= band)[counts]))
