"""The states of a piece seen from one axis: its law τ(p, u) with the other axes free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.pipeline.sampling.targets import Sampled
from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class LawView:
    """States of one axis: p, u, τ, ∂τ/∂p and ∂τ/∂u, all (n,), slopes with the free axes following."""

    actuation: Array
    deformation: Array
    tau: Array
    dtau_dp: Array
    dtau_du: Array

    def __len__(self) -> int:
        return len(self.actuation)

    def mirrored(self) -> LawView:
        """With the states at −u, which an even energy makes equal but for the sign of τ."""
        away = self.deformation != 0
        signs = (1.0, -1.0, -1.0, -1.0, 1.0)
        columns = (self.actuation, self.deformation, self.tau, self.dtau_dp, self.dtau_du)
        return LawView(*(np.concatenate([c, sign * c[away]]) for c, sign in zip(columns, signs, strict=True)))


def law_view(states: Sequence[Sampled], axis: str, axes: Sequence[str]) -> LawView:
    """The law of `axis` from states in which the other axes are free, or the only ones."""
    k = list(axes).index(axis)
    rows = [_alone(one, k) for one in states]
    return LawView(*np.array(rows, dtype=float).reshape(len(rows), 5).T)


def _alone(one: Sampled, k: int) -> tuple[float, ...]:
    """One state with the other axes condensed: dτ_j = 0 for all j ≠ k."""
    state = one.state
    others = [j for j in range(len(state.deformation)) if j != k]
    by_p, by_u = float(state.dtau_dp[k]), float(state.dtau_du[k, k])
    if others:
        K = state.dtau_du
        follow = np.linalg.solve(
            K[np.ix_(others, others)], np.column_stack([state.dtau_dp[others], K[others, k]])
        )
        by_p -= float(K[k, others] @ follow[:, 0])
        by_u -= float(K[k, others] @ follow[:, 1])
    return state.actuation, float(state.deformation[k]), float(state.tau[k]), by_p, by_u
