"""Which states of a module are solved, in which order, and how an interrupted sampling goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.execution.progress import Progress
from pliant.interfaces.fem import FemConfig
from pliant.interfaces.study_loads import StudyLoads
from pliant.pipeline.sampling.adaptive import Box, check_error, corners, refine
from pliant.pipeline.sampling.coupling import coupling
from pliant.pipeline.sampling.edges import trusted_box
from pliant.pipeline.sampling.free import free_adaptive, free_levels
from pliant.pipeline.sampling.grid import box, check_targets, grid
from pliant.pipeline.sampling.lateral import Lateral
from pliant.pipeline.sampling.saved import Saved
from pliant.pipeline.sampling.study import free_actuations, ladders, study_axis, study_states
from pliant.pipeline.sampling.targets import FULL, MAIN, Sampling
from pliant.pipeline.sampling.walk import Piece, Walk

# States to fit that an adaptive main axis usually takes: free branch, corners, chosen ones.
USUAL_STATES = 24


def sample(
    pieces: Sequence[Piece],
    config: FemConfig,
    limit: float,
    partial: Path,
    progress: Progress,
    loads: Mapping[str, StudyLoads] | None = None,
) -> Sampling:
    """Choose and solve the states of a module, each from the nearest solved one of the same piece.

    Args:
        pieces: that of the main axis and, for a module of several axes, that of all axes.
        config: `sampling` names the strategy.
        limit: the largest actuation, Pa or N.
        partial: finished states are kept there.
        progress: hears of the states.
        loads: by axis, of `sampling: study`.

    Raises `NotReachedError` when the free branch cannot be followed or does not bend, since all else is scaled
    by it.
    """
    saved = Saved(partial, progress.note)
    by_name = {piece.name: piece for piece in pieces}
    plan = _Plan(config, limit, loads or {}, by_name)
    bar = progress.begin("FEM states", max(plan.estimate(), len(saved)), done=len(saved))
    walk = Walk(by_name, saved, bar, passing=config.self_contact == "pass")
    try:
        summary = plan.carry_out(walk)
        bar.expect(len(saved))
    finally:
        bar.finish()
    mirrored = [axis for axis, one in summary["axes"].items() if one.get("symmetric")]
    return Sampling(tuple(walk.solved), tuple(walk.failed), tuple(mirrored), summary)


@dataclass(frozen=True)
class _Plan:
    """The strategy that a config names."""

    config: FemConfig
    limit: float
    loads: Mapping[str, StudyLoads]
    pieces: Mapping[str, Piece]

    @property
    def main(self) -> str:
        return self.pieces[MAIN].main_axis

    @property
    def lateral(self) -> Lateral | None:
        if FULL not in self.pieces:
            return None
        return Lateral(self.pieces[FULL].axes, self.main, self.limit, self.config)

    def estimate(self) -> int:
        """About how many states there will be."""
        config = self.config
        of_main = {
            "adaptive": min(USUAL_STATES, config.max_states),
            "grid": config.pressures * (1 + config.angles),
            "study": study_states(self.loads[self.main], self.limit) if self.loads else 0,
        }
        return of_main[config.sampling] + config.check_states + self._later()

    def _later(self) -> int:
        """About how many states the other axes will take."""
        return self.lateral.estimate() if self.lateral else 0

    def carry_out(self, walk: Walk) -> dict[str, Any]:
        """Solve everything; returns the summary."""
        walk.rest(explored=self.main)
        low, high, record = self._main_axis(walk)
        summary: dict[str, Any] = {
            "kind": self.config.sampling,
            "seed": self.config.seed,
            "axes": {self.main: record},
        }
        lateral = self.lateral
        if lateral is None:
            return summary
        lateral.start(walk)
        others = [axis for axis in lateral.axes if axis != self.main]
        for done, axis in enumerate(others):
            left = (len(others) - 1 - done) * lateral.estimate_of_axis() + self.config.coupling_states
            summary["axes"][axis] = self._other_axis(walk, lateral, axis, left)
        lateral.couple(walk, (low, high))
        summary["coupling"] = coupling(walk.solved, lateral.axes, self.main)
        return summary

    def _main_axis(self, walk: Walk) -> tuple[float, float, dict[str, Any]]:
        """Box of the main axis and the record of how well its law is known."""
        config, limit, axis = self.config, self.limit, self.main
        record: dict[str, Any] = {}
        if config.sampling == "grid":
            low, high = grid(walk, config, limit, axis)
        elif config.sampling == "study":
            free_levels(walk, free_actuations(self.loads[axis], limit), axis)
            low, high = box(walk, config)
            ladders(walk, self.loads[axis], limit, axis, MAIN, (low, high))
        else:
            free_adaptive(walk, limit, axis)
            low, high = box(walk, config)
            if walk.passing:  # no overlap ends the box; rigid parts do
                closed = self.pieces[MAIN].contact_range
                low, high = max(low, closed[0]), min(high, closed[1])
            low, high = trusted_box(walk, axis, limit, low, high)
            where = Box(axis, MAIN, (0.0, limit), (low, high))
            for target in corners(where):
                if not walk.knows(target):
                    walk.reach(target)
            expect = _expect(walk, config.check_states + self._later())
            verdict = refine(walk, where, config.error, config.max_states, expect)
            record = verdict.record(len(walk.solved))
        for target in check_targets(limit, low, high, config.check_states, config.seed, axis):
            walk.reach(target)
        if config.sampling == "adaptive":
            record["check_error"] = check_error(walk, where)
        return low, high, record

    def _other_axis(self, walk: Walk, lateral: Lateral, axis: str, left: int) -> dict[str, Any]:
        if self.config.sampling != "study":
            return lateral.explore(walk, axis, _expect(walk, left))
        reach = self.config.lateral_angle_rad
        study_axis(walk, self.loads[axis], self.limit, axis, FULL, (-reach, reach))
        return {}


def _expect(walk: Walk, later: int) -> Callable[[int], None]:
    """Tells the bar its total from what an axis still needs, `later` states coming after it."""

    def expect(more: int) -> None:
        walk.bar.expect(max(walk.walked + more + later, len(walk.saved)))

    return expect
