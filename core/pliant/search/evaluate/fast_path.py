"""From a study to its task's result in memory: what `simulate_study` does, with nothing written to the store.

Laws and modules of designs are kept in memory; they equal those of `pliant.pipeline.study` to the bit.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.task import SceneTask, Task
from pliant.mechanics.law_draws import draws
from pliant.pipeline.chain import NO_SHAPES, Module, RigidPiece, build_chain, family_module
from pliant.pipeline.engine_checks import check_capabilities
from pliant.pipeline.meta_model.designs import (
    MATERIAL,
    NO_PART_IN_THE_LAW,
    SourcedDesigns,
    solved_designs,
    values_of,
)
from pliant.pipeline.meta_model.stage import MetaModelStage, meta_model_stage
from pliant.pipeline.segments import DesignSpec, DesignStages, chain_segments, distinct_designs
from pliant.pipeline.simulate import run_task
from pliant.pipeline.study import needs_fem, own_law, physics_of_study
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.workbench import Workbench
from pliant.records.chain import ChainModel
from pliant.records.law import JointLaw
from pliant.records.rollout import TaskResult

# Laws and modules of so many designs, and drawn laws of so many, are kept.
MOST_DESIGNS, MOST_DRAWN, MOST_ENGINES = 512, 64, 8
NO_LAW = tuple(f"{MATERIAL}{name}" for name in NO_PART_IN_THE_LAW)
DEARER = (
    "the search changes what modules are made of, and without a 'meta_model' every such candidate waits for FEM of "
    "its own; a 'sweep' and a 'meta_model' give laws of unseen designs within milliseconds."
)
T = TypeVar("T")
# Called with the name of a part of the work and what does it; a benchmark measures here.
Timer = Callable[[str, Callable[[], T]], T]


def untimed(part: str, work: Callable[[], T]) -> T:
    """A `Timer` that measures nothing: the result of the work."""
    return work()


class Recent(Generic[T]):
    """Remembers the `most` results that were asked for last."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[Hashable, T] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The result of this key, made now if it is not known; what `make` raises is not remembered."""
        if key not in self._kept:
            self._kept[key] = make()
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


@dataclass(frozen=True)
class LawDraw:
    """The draw `index` out of `count` of every law, by one seed."""

    index: int
    count: int
    seed: int


class CachedLaws:
    """Laws by design, for the studies that candidates come to.

    The meta-model is that of the study that is searched, fitted or found in the store when it is first needed. Laws
    that take none (stated ones, those of tables, those of FEM) go through the usual stages once for each design.
    """

    def __init__(self, bench: Workbench, study: Study) -> None:
        self._bench, self._study = bench, study
        self._solved: Recent[SourcedDesigns] = Recent(4)
        self._metas: Recent[MetaModelStage] = Recent(4)
        self._own: Recent[DesignStages] = Recent(MOST_DESIGNS)
        self._laws: Recent[JointLaw] = Recent(MOST_DESIGNS)
        self._drawn: Recent[tuple[JointLaw, ...]] = Recent(MOST_DRAWN)
        self._fem_of: set[str] = set()
        self.drawn = False  # whether any law stated an error to draw from

    def stages(self, study: Study, draw: LawDraw | None = None) -> list[DesignStages]:
        """Each distinct design of the study with its law, or with a law drawn from its error bar.

        Laws that state no error are not drawn. Draws of one meta-model's laws share their random numbers, since
        neighbouring designs are off alike; draws of other laws are independent of each other.

        Raises:
            UserError: among others, a design for which the meta-model does not hold.
        """
        found = []
        for number, design in enumerate(distinct_designs(study)):
            if study.meta_model is not None and design.meta_model is not None and design.family is not None:
                law, stream = self._by_parameters(study, design.family, draw is not None), 0
            else:
                law, stream = self._once(study, design), 1 + number
            if draw is not None and law.error is not None:
                law, self.drawn = self._draw(law, draw, (draw.seed + 1_000_003 * stream) % 2**32), True
            found.append(DesignStages(design, None, LawStage(law, None, None, None)))
        return found

    def check_varied(self, names: Mapping[str, str]) -> None:
        """See that the meta-model can follow what is varied: its parameter (`wall_m`) → the key (`family.wall`).

        Raises:
            UserError: all its solved designs share one of them.
        """
        if self._study.meta_model is None or not names:
            return
        known = self._solved_designs(self._study).designs.names
        for name, key in names.items():
            if name not in known and name not in NO_LAW:
                raise UserError(
                    f"search.robust.vary: '{key}' cannot be varied, since all solved designs of the meta-model share "
                    "it; solve a sweep over it, or put an effect into 'effects' (wall_thickness, stiffness, …) and "
                    "vary that instead: effects.0.ratio."
                )

    def _base(self, study: Study) -> Study:
        # The designs are those of the study that is searched, whatever the candidate's own parameters are.
        return self._study.model_copy(update={"meta_model": study.meta_model})

    def _solved_designs(self, study: Study) -> SourcedDesigns:
        return self._solved.get(
            repr(study.meta_model), lambda: solved_designs(self._bench, self._base(study))
        )

    def _by_parameters(self, study: Study, family: FamilyConfig, with_error: bool) -> JointLaw:
        block = study.meta_model
        meta = self._metas.get(
            repr(block), lambda: meta_model_stage(self._bench, self._base(study), self._solved_designs(study))
        )
        designs = meta.designs
        assert block is not None
        values = values_of(
            designs.names, designs.box, designs.fixed, family, study.material, block.extrapolate
        )
        key = (repr(block), values.tobytes(), with_error)
        # The error bar takes longer than the law and changes no simulation.
        return self._laws.get(key, lambda: meta.law(values) if with_error else meta.laws.law(values))

    def _once(self, study: Study, design: DesignSpec) -> JointLaw:
        waits = needs_fem(self._bench, design)
        key = design.name + (repr((study.material, study.fem)) if waits else "")
        if waits and key not in self._fem_of:
            self._fem_of.add(key)
            if len(self._fem_of) == 1 + len(distinct_designs(self._study)):
                self._bench.progress.note(DEARER)
        return self._own.get(key, lambda: own_law(self._bench, study, design)).law.law

    def _draw(self, law: JointLaw, draw: LawDraw, seed: int) -> JointLaw:
        # The law is kept with its draws, so that its identity stays its own.
        kept = self._drawn.get((id(law), draw.count, seed), lambda: (law, *draws(law, draw.count, seed)))
        return kept[1 + draw.index]


class FastPath:
    """Laws, chain, effects, engine and task of many studies that differ from one.

    Args:
        bench: plugins and store; the store is used for what is made once.
        study: the study that is searched, whose meta-model all of them take.
        timed: see `Timer`.
    """

    def __init__(self, bench: Workbench, study: Study, timed: Timer = untimed) -> None:
        self.bench, self.laws, self._timed = bench, CachedLaws(bench, study), timed
        self._modules: Recent[Module] = Recent(MOST_DESIGNS)
        self._engines: Recent[PhysicsBackend] = Recent(MOST_ENGINES)

    def result(self, study: Study, draw: LawDraw | None = None) -> TaskResult:
        """The task's result in the study's engine, by its laws or by drawn ones.

        Raises:
            UserError: as `simulate_study`.
        """
        task: Task | SceneTask = self.bench.build("task", study.noisy_task())
        physics = physics_of_study(self.bench, study)
        engine = self._engines.get(repr(physics), lambda: self.bench.build("physics", physics))
        chain = self.chain(study, isinstance(task, SceneTask) or engine.capabilities.contacts, draw)
        effects = [self.bench.build("effect", effect) for effect in study.effects]
        check_capabilities(engine, chain, engine.config.kind)
        return self._timed("task", lambda: run_task(engine, task, effects, chain))

    def chain(self, study: Study, shapes: bool = True, draw: LawDraw | None = None) -> ChainModel:
        """The study's chain without its effects; without `shapes` nothing collides."""
        config = study.need("chain", "a simulation")
        stages = self._timed("laws", lambda: self.laws.stages(study, draw))
        segments = self._timed("modules", lambda: chain_segments(self.bench, study, stages, self._module))
        if not shapes:
            bare = [
                replace(s.piece, shapes=() if isinstance(s.piece, RigidPiece) else NO_SHAPES)
                for s in segments
            ]
            segments = [replace(one, piece=piece) for one, piece in zip(segments, bare, strict=True)]
        return self._timed("chain", lambda: build_chain(config, segments))

    def _module(
        self, law: JointLaw, family: ActuatorFamily, density_kg_m3: float | None, regions: Mapping[str, float]
    ) -> Module:
        """As `family_module`: masses and shapes of a design are made once, the law is the candidate's."""
        key = (repr(family.config.canonical()), density_kg_m3, *regions.items())
        return replace(
            self._modules.get(key, lambda: family_module(law, family, density_kg_m3, regions)), law=law
        )
