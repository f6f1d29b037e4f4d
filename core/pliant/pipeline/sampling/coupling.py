"""How strongly the axes of a module depend on each other, from states of the piece that has them all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.pipeline.sampling.targets import FULL, MAIN, Sampled


def coupling(solved: Sequence[Sampled], axes: Sequence[str], main_axis: str) -> dict[str, Any]:
    """Largest off-diagonal slope, asymmetry of the slopes, and how well the two pieces agree.

    `largest` is max |∂τ_i/∂u_j| / √|∂τ_i/∂u_i ∂τ_j/∂u_j| over states and pairs, `between` its pair and
    `actuation`, `deformation` its state; `largest_asymmetry` is max |K − Kᵀ| / max |K|, which an energy makes
    zero. `pieces_differ` compares the free angle at the largest common actuation on both pieces.
    """
    full = [one.state for one in solved if one.target.piece == FULL]
    if not full:
        return {}
    K = np.array([state.dtau_du for state in full])
    diagonal = np.abs(np.einsum("sii->si", K))
    relative = np.abs(K) / np.sqrt(diagonal[:, :, None] * diagonal[:, None, :])
    relative[:, np.arange(len(axes)), np.arange(len(axes))] = 0.0
    s, i, j = np.unravel_index(int(np.argmax(relative)), relative.shape)
    skew = np.abs(K - np.swapaxes(K, 1, 2)).max(axis=(1, 2)) / np.abs(K).max(axis=(1, 2))
    return {
        "n_states": len(full),
        "largest": float(relative[s, i, j]),
        "between": [axes[int(i)], axes[int(j)]],
        "actuation": full[int(s)].actuation,
        "deformation": full[int(s)].deformation.tolist(),
        "largest_asymmetry": float(skew.max()),
        "pieces_differ": _pieces_differ(solved, list(axes).index(main_axis)),
    }


def _pieces_differ(solved: Sequence[Sampled], main: int) -> float | None:
    """Relative difference of the free angle between the pieces, or None without a common actuation."""
    free = {
        piece: {
            one.state.actuation: one.state
            for one in solved
            if one.target.piece == piece and one.target.branch == "free"
        }
        for piece in (MAIN, FULL)
    }
    common = max(set(free[MAIN]) & set(free[FULL]), default=0.0)
    if common == 0.0:
        return None
    full = float(free[FULL][common].deformation[main])
    return abs(free[MAIN][common].angle_rad - full) / abs(full)
