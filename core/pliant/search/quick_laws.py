"""Laws and modules of candidates, kept in memory: what `pliant.pipeline.study` makes through the store, to the bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.mechanics.law_draws import draws
from pliant.pipeline.chain import NO_SHAPES, Module, RigidPiece, Segment, family_module
from pliant.pipeline.meta_model.designs import Solved, solved_designs
from pliant.pipeline.meta_model.parameters import MATERIAL, NO_PART_IN_THE_LAW, values_of
from pliant.pipeline.meta_model.stage import MetaModelStage, meta_model_stage
from pliant.pipeline.study import Design, DesignStages, chain_segments, distinct_designs, needs_fem, own_law
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.workbench import Workbench
from pliant.records.law import JointLaw
from pliant.search.recent import Recent

# Laws and modules of so many designs, and drawn laws of so many, are kept.
MOST_DESIGNS, MOST_DRAWN = 512, 64
NO_LAW = tuple(f"{MATERIAL}{name}" for name in NO_PART_IN_THE_LAW)
DEARER = (
    "the search changes what modules are made of, and without a 'meta_model' every such candidate waits for FEM of "
    "its own; a 'sweep' and a 'meta_model' give laws of unseen designs within milliseconds."
)


@dataclass(frozen=True)
class LawDraw:
    """The draw `index` out of `count` of every law, by one seed."""

    index: int
    count: int
    seed: int


class QuickLaws:
    """Laws by design, for the studies that candidates come to.

    The meta-model is that of the study that is searched, fitted or found in the store when it is first needed. Laws
    that take none (stated ones, those of tables, those of FEM) go through the usual stages once for each design.
    """

    def __init__(self, bench: Workbench, study: Study) -> None:
        self._bench, self._study = bench, study
        self._solved: Recent[Solved] = Recent(4)
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
                law, seed = self._by_parameters(study, design.family, draw is not None), 0
            else:
                law, seed = self._once(study, design), 1 + number
            if draw is not None and law.error is not None:
                law, self.drawn = self._draw(law, draw, seed), True
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

    def _solved_designs(self, study: Study) -> Solved:
        # The designs are those of the study that is searched, whatever the candidate's own parameters are.
        base = self._study.model_copy(update={"meta_model": study.meta_model})
        return self._solved.get(repr(study.meta_model), lambda: solved_designs(self._bench, base))

    def _meta(self, study: Study) -> MetaModelStage:
        base = self._study.model_copy(update={"meta_model": study.meta_model})
        return self._metas.get(
            repr(study.meta_model), lambda: meta_model_stage(self._bench, base, self._solved_designs(study))
        )

    def _by_parameters(self, study: Study, family: FamilyConfig, with_error: bool) -> JointLaw:
        meta = self._meta(study)
        designs = meta.designs
        assert study.meta_model is not None
        extrapolate = study.meta_model.extrapolate
        values = values_of(designs.names, designs.box, designs.fixed, family, study.material, extrapolate)
        key = (repr(study.meta_model), values.tobytes(), with_error)
        # The error bar takes longer than the law and changes no simulation.
        return self._laws.get(key, lambda: meta.law(values) if with_error else meta.laws.law(values))

    def _once(self, study: Study, design: Design) -> JointLaw:
        waits = needs_fem(self._bench, design)
        solved = repr((study.material, study.fem)) if waits else ""
        key = design.name + solved
        if waits and key not in self._fem_of:
            self._fem_of.add(key)
            if len(self._fem_of) == 1 + len(distinct_designs(self._study)):
                self._bench.progress.note(DEARER)
        return self._own.get(key, lambda: own_law(self._bench, study, design)).law.law

    def _draw(self, law: JointLaw, draw: LawDraw, seed: int) -> JointLaw:
        numbers = (draw.seed + 1_000_003 * seed) % 2**32
        # The law is kept with its draws, so that its identity stays its own.
        kept = self._drawn.get(
            (id(law), draw.count, numbers), lambda: (law, *draws(law, draw.count, numbers))
        )
        return kept[1 + draw.index]


class QuickModules:
    """Modules by design: masses and shapes are made once, the law is the candidate's."""

    def __init__(self) -> None:
        self._kept: Recent[Module] = Recent(MOST_DESIGNS)

    def module(self, family: ActuatorFamily, density_kg_m3: float | None, law: JointLaw) -> Module:
        """As `family_module`."""
        key = (repr(family.config.canonical()), density_kg_m3)
        module = self._kept.get(key, lambda: family_module(law, family, density_kg_m3))
        return replace(module, law=law)

    def segments(
        self, bench: Workbench, study: Study, stages: list[DesignStages], shapes: bool
    ) -> list[Segment]:
        """As `chain_segments`; without `shapes` nothing collides."""
        made = chain_segments(bench, study, stages, self.module)
        return made if shapes else [replace(one, piece=_bare(one.piece)) for one in made]


def _bare(piece: Module | RigidPiece) -> Module | RigidPiece:
    """The piece without what collides."""
    if isinstance(piece, RigidPiece):
        return replace(piece, shapes=())
    return replace(piece, shapes=NO_SHAPES)
