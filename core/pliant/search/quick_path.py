"""From a study to its task's result in memory: what `simulate_study` does, with nothing written to the store."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from pliant.config.study import Study
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.task import SceneTask, Task
from pliant.pipeline.chain import build_chain
from pliant.pipeline.simulate import check_capabilities, run_task
from pliant.pipeline.study import physics_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.search.quick_laws import LawDraw, QuickLaws, QuickModules
from pliant.search.recent import Recent

MOST_ENGINES = 8
T = TypeVar("T")
# Called with the name of a part of the work and what does it; a benchmark measures here.
Timer = Callable[[str, Callable[[], T]], T]


def untimed(part: str, work: Callable[[], T]) -> T:
    """Just do it."""
    return work()


class QuickPath:
    """Laws, chain, effects, engine and task of many studies that differ from one.

    Args:
        bench: plugins and store; the store is used for what is made once.
        study: the study that is searched, whose meta-model all of them take.
        timed: see `Timer`.
    """

    def __init__(self, bench: Workbench, study: Study, timed: Timer = untimed) -> None:
        self.bench, self.laws, self.modules = bench, QuickLaws(bench, study), QuickModules()
        self._engines: Recent[PhysicsBackend] = Recent(MOST_ENGINES)
        self._timed = timed

    def result(self, study: Study, draw: LawDraw | None = None) -> TaskResult:
        """The task's result in the study's engine, by its laws or by drawn ones.

        Raises:
            UserError: as `simulate_study`.
        """
        task: Task | SceneTask = self.bench.build("task", study.noisy_task())
        engine = self._engine(study)
        chain = self.chain(study, isinstance(task, SceneTask) or engine.capabilities.contacts, draw)
        effects = [self.bench.build("effect", effect) for effect in study.effects]
        check_capabilities(engine, chain, engine.config.kind)
        return self._timed("task", lambda: run_task(engine, task, effects, chain))

    def chain(self, study: Study, shapes: bool = True, draw: LawDraw | None = None) -> ChainModel:
        """The study's chain without its effects; without `shapes` nothing collides."""
        config = study.need("chain", "a simulation")
        stages = self._timed("laws", lambda: self.laws.stages(study, draw))
        segments = self._timed("modules", lambda: self.modules.segments(self.bench, study, stages, shapes))
        return self._timed("chain", lambda: build_chain(config, segments))

    def _engine(self, study: Study) -> PhysicsBackend:
        config = physics_of_study(self.bench, study)
        return self._engines.get(repr(config), lambda: self.bench.build("physics", config))
