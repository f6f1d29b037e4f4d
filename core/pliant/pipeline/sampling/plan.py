"""Plan of a module's sampling: which states are solved, in which order, and how a sampling resumes.

On the piece that moves about all axes, a lateral axis is prescribed at angles up to `lateral_angle` while the main
axis follows its free branch, as in a laboratory test; states are chosen as on the main axis. A module with mirror
planes has an energy that is even in its lateral angles. This is tested, not configured: the far corner is solved on
both sides, and if they agree the states at −u are copies. The coupling states prescribe all axes at points of a
scrambled Sobol sequence (Owen 1998), so that a coupled law can be fitted, or the uncoupled one assessed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from pliant.execution.progress import Progress
from pliant.interfaces.fem import LATERAL_CHECKS, LATERAL_FREE_LEVELS, FemConfig
from pliant.interfaces.study_loads import StudyLoads
from pliant.pipeline.sampling.adaptive import Box, check_error, refine
from pliant.pipeline.sampling.strategies import (
    SeveralPlan,
    angle_range,
    check_targets,
    free_actuations,
    free_adaptive,
    free_levels,
    grid,
    ladders,
    study_states,
    trusted_box,
)
from pliant.pipeline.sampling.walk import (
    FULL,
    MAIN,
    Sampled,
    SamplingRun,
    StateCache,
    StateTarget,
    Subproblem,
    levels,
)
from pliant.records.actuation import Levels
from pliant.records.fem import FemState, Role

# States to fit that an adaptive main axis usually needs: free branch, corners, chosen ones.
USUAL_STATES = 24
MIRROR_TOLERANCE = 1e-3  # of τ and of u: tolerance for equal sides


@dataclass(frozen=True)
class Sampling:
    """All solved states, the failed targets with their causes, and a summary of the choice of states.

    Attributes:
        solved: in the order of solution.
        failed: one record for each target that did not converge.
        mirrored: axes about which the module was found symmetric, so that states at −u equal those at u.
        summary: JSON values for the report.
    """

    solved: tuple[Sampled, ...]
    failed: tuple[dict[str, object], ...]
    mirrored: tuple[str, ...] = ()
    summary: Mapping[str, object] = field(default_factory=dict)


def sample(
    pieces: Sequence[Subproblem],
    config: FemConfig,
    limit: Levels,
    partial: Path,
    progress: Progress,
    loads: Mapping[str, StudyLoads] | None = None,
) -> Sampling:
    """Choose and solve the states of a module, each from the nearest solved one of the same piece.

    Args:
        pieces: that of the main axis and, for a module of several axes, that of all axes.
        config: its key `sampling` names the strategy.
        limit: the largest actuation, Pa or N; (m,) of several.
        partial: folder of finished states.
        progress: notified of the states.
        loads: by axis, of `sampling: study`.

    Raises `NotReachedError` if the free branch cannot be followed or does not bend, since all ranges are scaled
    by it.
    """
    saved = StateCache(partial, progress.note)
    by_name = {piece.name: piece for piece in pieces}
    several = np.ndim(limit) > 0
    plan = SeveralPlan(config, limit) if several else _Plan(config, limit, loads or {}, by_name)
    bar = progress.begin("FEM states", max(plan.estimate(), len(saved)), done=len(saved))
    walk = SamplingRun(
        by_name, saved, bar, passing=config.self_contact == "pass", inputs=len(limit) if several else 1
    )
    try:
        summary = plan.carry_out(walk)
        bar.expect(len(saved))
    finally:
        bar.finish()
    for note in walk.notes:
        progress.note(note)
    mirrored = [axis for axis, one in summary["axes"].items() if one.get("symmetric")]
    return Sampling(tuple(walk.solved), tuple(walk.failed), tuple(mirrored), summary)


def _within(closed: tuple[float, float], box: tuple[float, float], walk: SamplingRun) -> tuple[float, float]:
    """Return the part of a box of angles in which rigid parts do not touch; a note names the keys that it overrides."""
    low, high = max(box[0], closed[0]), min(box[1], closed[1])
    if (low, high) != box:
        walk.notes.append(
            f"fem.angle_low and fem.angle_high ask for {box[0]:.3g} to {box[1]:.3g} rad; the data end at {low:.3g} and "
            f"{high:.3g} rad, where rigid parts of the module touch."
        )
    return low, high


@dataclass(frozen=True)
class _Plan:
    """The strategy that a config names."""

    config: FemConfig
    limit: float
    loads: Mapping[str, StudyLoads]
    pieces: Mapping[str, Subproblem]

    @property
    def main(self) -> str:
        return self.pieces[MAIN].main_axis

    @property
    def lateral(self) -> list[str]:
        """The lateral axes."""
        axes = self.pieces[FULL].axes if FULL in self.pieces else ()
        return [axis for axis in axes if axis != self.main]

    def estimate(self) -> int:
        """Estimate the total number of states."""
        config = self.config
        of_main = {
            "adaptive": min(USUAL_STATES, config.max_states),
            "grid": config.pressures * (1 + config.angles),
            "study": study_states(self.loads[self.main], self.limit) if self.loads else 0,
        }
        return of_main[config.sampling] + config.check_states + self._later()

    def _later(self, done: int = 0) -> int:
        """Estimate the number of states of the other axes, without the first `done` of them."""
        each = self.config.lateral_states + 1 + min(LATERAL_CHECKS, self.config.check_states)
        axes = len(self.lateral) - done
        free = LATERAL_FREE_LEVELS if done == 0 else 0
        return free + axes * each + self.config.coupling_states if self.lateral else 0

    def carry_out(self, walk: SamplingRun) -> dict[str, Any]:
        """Solve all states and return the summary."""
        walk.rest(explored=self.main)
        box, record = self._main_axis(walk)
        summary: dict[str, Any] = {
            "kind": self.config.sampling,
            "seed": self.config.seed,
            "axes": {self.main: record},
        }
        if not self.lateral:
            return summary
        # All other states of the full piece start from its free branch.
        walk.rest(FULL)
        free_levels(walk, levels(0.0, self.limit, LATERAL_FREE_LEVELS)[1:], "", FULL)
        reach = self.config.lateral_angle_rad
        for done, axis in enumerate(self.lateral, start=1):
            if self.config.sampling == "study":
                ladders(walk, self.loads[axis], self.limit, axis, FULL, (-reach, reach))
                summary["axes"][axis] = {}
            else:
                summary["axes"][axis] = self._lateral_axis(walk, axis, _expect(walk, self._later(done)))
        self._couple(walk, box)
        summary["coupling"] = coupling(walk.solved, self.pieces[FULL].axes, self.main)
        return summary

    def _main_axis(self, walk: SamplingRun) -> tuple[tuple[float, float], dict[str, Any]]:
        """Sample the main axis; return its box and the record of its law's accuracy."""
        config, limit, axis = self.config, self.limit, self.main
        record: dict[str, Any] = {}
        if config.sampling == "grid":
            low, high = grid(walk, config, limit, axis)
        elif config.sampling == "study":
            free_levels(walk, free_actuations(self.loads[axis], limit), axis)
            low, high = angle_range(walk, config)
            ladders(walk, self.loads[axis], limit, axis, MAIN, (low, high))
        else:
            free_adaptive(walk, limit, axis)
            low, high = angle_range(walk, config)
            if walk.passing:  # the box ends at rigid parts, not at overlaps
                low, high = _within(self.pieces[MAIN].contact_range, (low, high), walk)
            low, high = trusted_box(walk, axis, limit, low, high)
            where = Box(axis, MAIN, (0.0, limit), (low, high))
            walk.reach_new(where.corners())
            expect = _expect(walk, config.check_states + self._later())
            verdict = refine(walk, where, config.error, config.max_states, expect)
            record = {"n_states": len(walk.solved), **verdict}
        for target in check_targets(limit, low, high, config.check_states, config.seed, axis):
            walk.solve(target)
        if config.sampling == "adaptive":
            record["check_error"] = check_error(walk, where)
        return (low, high), record

    def _lateral_axis(self, walk: SamplingRun, axis: str, expect: Callable[[int], None]) -> dict[str, Any]:
        """Sample one lateral axis; return the record of its law's accuracy."""
        config, reach = self.config, self.config.lateral_angle_rad
        symmetric, apart = self._mirror_test(walk, axis)
        box = Box(axis, FULL, (0.0, self.limit), (-reach, reach), symmetric)
        walk.reach_new(box.corners())
        most = LATERAL_FREE_LEVELS + config.lateral_states * (1 if symmetric else 2)
        verdict = refine(walk, box, config.error, most, expect)
        high, count = 0.0 if symmetric else reach, min(LATERAL_CHECKS, config.check_states)
        for target in check_targets(self.limit, -reach, high, count, config.seed, axis, FULL):
            walk.solve(target)
        return {
            "n_states": sum(one.target.explored == axis for one in walk.piece_states(FULL)),
            **verdict,
            "check_error": check_error(walk, box),
            "symmetric": symmetric,
            "difference_of_sides": apart,
        }

    def _couple(self, walk: SamplingRun, main_box: tuple[float, float]) -> None:
        """Solve states that prescribe all axes, over the box of all axes."""
        count, reach, axes = (
            self.config.coupling_states,
            self.config.lateral_angle_rad,
            self.pieces[FULL].axes,
        )
        if count == 0:
            return
        sides = [(0.0, self.limit), *(main_box if axis == self.main else (-reach, reach) for axis in axes)]
        sequence = scipy.stats.qmc.Sobol(len(sides), scramble=True, seed=self.config.seed)
        points = sequence.random_base2(int(np.ceil(np.log2(count))))[:count]
        low, high = np.array(sides).T
        for point in low + (high - low) * points:
            held = {axis: float(u) for axis, u in zip(axes, point[1:], strict=True)}
            walk.solve(StateTarget("constrained", float(point[0]), held, piece=FULL))

    def _mirror_test(self, walk: SamplingRun, axis: str) -> tuple[bool, float | None]:
        """Return whether the states at ±u under the largest actuation are mirror images, and their difference."""
        k, reach = self.pieces[FULL].axes.index(axis), self.config.lateral_angle_rad

        def corner(angle: float, role: Role) -> FemState | None:
            return walk.solve(StateTarget("constrained", self.limit, {axis: angle}, {}, role, axis, FULL))

        right, left = corner(reach, "fit"), corner(-reach, "check")
        if right is None or left is None:
            return False, None
        size = max(abs(float(right.tau[k])), abs(float(left.tau[k])), 1e-300)
        in_effort = abs(float(right.tau[k] + left.tau[k])) / size
        followed = np.abs(np.delete(right.deformation, k)) - np.abs(np.delete(left.deformation, k))
        apart = max(in_effort, float(np.abs(followed).max()) / reach)
        return apart <= MIRROR_TOLERANCE, apart


def _expect(walk: SamplingRun, later: int) -> Callable[[int], None]:
    """Return a callback that sets the bar's total from an axis' remaining states and `later` states after it."""

    def expect(more: int) -> None:
        walk.bar.expect(max(walk.walked + more + later, len(walk.saved)))

    return expect


def coupling(solved: Sequence[Sampled], axes: Sequence[str], main_axis: str) -> dict[str, Any]:
    """Return measures of the coupling between the axes of a module, from states of the piece with all axes.

    `largest` is max |∂τ_i/∂u_j| / √|∂τ_i/∂u_i ∂τ_j/∂u_j| over states and pairs, `between` its pair and
    `actuation`, `deformation` its state; `largest_asymmetry` is max |K − Kᵀ| / max |K|, which is zero for an
    energy. `pieces_differ` compares the free angle at the largest common actuation on both pieces, None without one.
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
    free: dict[str, dict[float, FemState]] = {MAIN: {}, FULL: {}}
    for one in solved:
        if one.target.branch == "free":
            free[one.target.piece][one.state.actuation] = one.state
    common = max(set(free[MAIN]) & set(free[FULL]), default=0.0)
    differ = None
    if common != 0.0:
        angle = float(free[FULL][common].deformation[list(axes).index(main_axis)])
        differ = abs(free[MAIN][common].angle_rad - angle) / abs(angle)
    return {
        "n_states": len(full),
        "largest": float(relative[s, i, j]),
        "between": [axes[int(i)], axes[int(j)]],
        "actuation": full[int(s)].actuation,
        "deformation": full[int(s)].deformation.tolist(),
        "largest_asymmetry": float(skew.max()),
        "pieces_differ": differ,
    }
