"""Simulation of a study's task in memory: as `simulate_study`, without writing to the store.

Laws and modules of designs are kept in memory; they equal those of `pliant.pipeline.study` to the bit.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from pliant.config.design_parameters import MATERIAL, NO_PART_IN_THE_LAW
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.physics import PhysicsBackend, SceneBackend
from pliant.interfaces.task import SceneTask, Task
from pliant.mechanics.law_draws import draws
from pliant.pipeline.chain import NO_SHAPES, Module, RigidPiece, build_chain, family_module
from pliant.pipeline.engine_checks import check_capabilities
from pliant.pipeline.segments import DesignSpec, DesignStages, chain_segments, distinct_designs
from pliant.pipeline.simulate import run_task
from pliant.pipeline.study import needs_fem, own_law, study_physics
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel
from pliant.records.law import JointLaw
from pliant.records.rollout import TaskResult
from pliant_designs.solved_designs import SourcedDesigns, design_values, solved_designs
from pliant_designs.stage import MetaModelStage, meta_model_stage

# Number of designs whose laws and modules are kept, and of drawn laws.
MOST_DESIGNS, MOST_DRAWN, MOST_ENGINES = 512, 64, 8
NO_LAW = tuple(f"{MATERIAL}{name}" for name in NO_PART_IN_THE_LAW)
DEARER = (
    "the search changes what modules are made of, and without a 'meta_model' every such candidate waits for FEM of "
    "its own; a 'sweep' and a 'meta_model' give laws of unseen designs within milliseconds."
)
T = TypeVar("T")
# Called with the name of a part of the work and the function that does it; benchmarks measure here.
Timer = Callable[[str, Callable[[], T]], T]


def untimed(part: str, work: Callable[[], T]) -> T:
    """Return the result of the work without measuring its time."""
    return work()


class Recent(Generic[T]):
    """Cache of the `most` results that were used last."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[Hashable, T] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the result of this key, calling `make` if it is not cached; exceptions are not cached."""
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
    """Laws of the designs in candidates' studies, cached by design.

    The meta-model is that of the searched study; it is fitted or loaded from the store on first use. Laws without a
    meta-model (stated laws, tables, FEM) go through the usual stages once for each design.
    """

    def __init__(self, context: RunContext, study: Study) -> None:
        self._bench, self._study = context, study
        self._solved: Recent[SourcedDesigns] = Recent(4)
        self._metas: Recent[MetaModelStage] = Recent(4)
        self._own: Recent[DesignStages] = Recent(MOST_DESIGNS)
        self._laws: Recent[JointLaw] = Recent(MOST_DESIGNS)
        self._drawn: Recent[tuple[JointLaw, ...]] = Recent(MOST_DRAWN)
        self._fem_of: set[str] = set()
        self.drawn = False  # whether any law states an error to draw from

    def stages(self, study: Study, draw: LawDraw | None = None) -> list[DesignStages]:
        """Return each distinct design of the study with its law, or with a law drawn from its error bar.

        Laws that state no error are not drawn. Draws of one meta-model's laws share their random numbers, since the
        errors of neighbouring designs are correlated; draws of other laws are independent of each other.

        Raises:
            UserError: among others, a design outside the meta-model's range.
        """
        found = []
        for number, design in enumerate(distinct_designs(study)):
            if design.source == "meta_model" and design.family is not None:
                law, stream = self._by_parameters(study, design.family, draw is not None), 0
            else:
                law, stream = self._once(study, design), 1 + number
            if draw is not None and law.states_error:
                law, self.drawn = self._draw(law, draw, (draw.seed + 1_000_003 * stream) % 2**32), True
            found.append(DesignStages(design, None, LawStage(law, None, None, None)))
        return found

    def check_varied(self, names: Mapping[str, str]) -> None:
        """Check that the meta-model depends on the varied parameters: parameter (`wall_m`) → key (`family.wall`).

        Raises:
            UserError: all its solved designs have the same value of one parameter.
        """
        if self._study.block("meta_model") is None or not names:
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
        # The designs are those of the searched study, whatever the candidate's own parameters.
        return self._study.model_copy(update={"meta_model": study.block("meta_model")})

    def _solved_designs(self, study: Study) -> SourcedDesigns:
        return self._solved.get(
            repr(study.block("meta_model")), lambda: solved_designs(self._bench, self._base(study))
        )

    def _by_parameters(self, study: Study, family: FamilyConfig, with_error: bool) -> JointLaw:
        block = study.block("meta_model")
        meta = self._metas.get(
            repr(block), lambda: meta_model_stage(self._bench, self._base(study), self._solved_designs(study))
        )
        designs = meta.designs
        assert block is not None
        values = design_values(
            designs.names, designs.box, designs.fixed, family, study.material, block.extrapolate
        )
        key = (repr(block), values.tobytes(), with_error)
        # The error bar costs more than the law and does not affect the simulation.
        return self._laws.get(key, lambda: meta.law(values) if with_error else meta.laws.law(values))

    def _once(self, study: Study, design: DesignSpec) -> JointLaw:
        waits = needs_fem(self._bench, study, design)
        # a family's law may be a closed form in its material
        key = design.name + (repr((study.material, study.fem)) if waits or design.family else "")
        if waits and key not in self._fem_of:
            self._fem_of.add(key)
            if len(self._fem_of) == 1 + len(distinct_designs(self._study)):
                self._bench.progress.note(DEARER)
        return self._own.get(key, lambda: own_law(self._bench, study, design)).law.law

    def _draw(self, law: JointLaw, draw: LawDraw, seed: int) -> JointLaw:
        # The law is kept with its draws, so that its `id` is not reused.
        kept = self._drawn.get((id(law), draw.count, seed), lambda: (law, *draws(law, draw.count, seed)))
        return kept[1 + draw.index]


class FastPath:
    """Laws, chain, effects, engine and task of many studies that are variants of one study.

    Args:
        context: plugins and store; the store is used for objects that are built once.
        study: the searched study, whose meta-model all variants use.
        timed: see `Timer`.
    """

    def __init__(self, context: RunContext, study: Study, timed: Timer = untimed) -> None:
        self.context, self.laws, self._timed = context, CachedLaws(context, study), timed
        self._modules: Recent[Module] = Recent(MOST_DESIGNS)
        self._engines: Recent[PhysicsBackend] = Recent(MOST_ENGINES)

    def result(self, study: Study, draw: LawDraw | None = None) -> TaskResult:
        """Return the task's result in the study's engine, with its laws or with drawn laws.

        Raises:
            UserError: as `simulate_study`.
        """
        return self.run(study, draw, lambda engine: engine)

    def run(
        self, study: Study, draw: LawDraw | None, engine_in_place: Callable[[PhysicsBackend], PhysicsBackend]
    ) -> TaskResult:
        """Return the `result` in an engine that takes the place of the study's."""
        task: Task | SceneTask = self.context.build("task", study.noisy_task())
        physics = study_physics(self.context, study)
        engine = self._engines.get(repr(physics), lambda: self.context.build("physics", physics))
        chain = self.chain(study, isinstance(task, SceneTask) or isinstance(engine, SceneBackend), draw)
        effects = [self.context.build("effect", effect) for effect in study.effects]
        check_capabilities(engine, chain, engine.config.kind)
        return self._timed("task", lambda: run_task(engine_in_place(engine), task, effects, chain))

    def chain(self, study: Study, shapes: bool = True, draw: LawDraw | None = None) -> ChainModel:
        """Return the study's chain without its effects; without `shapes` there are no collisions."""
        config = study.need("chain", "a simulation")
        stages = self._timed("laws", lambda: self.laws.stages(study, draw))
        segments = self._timed("modules", lambda: chain_segments(self.context, study, stages, self._module))
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
        """Return the module as `family_module` does; masses and shapes are cached, the law is the candidate's."""
        key = (repr(family.config.canonical()), density_kg_m3, *regions.items())
        return replace(
            self._modules.get(key, lambda: family_module(law, family, density_kg_m3, regions)), law=law
        )
