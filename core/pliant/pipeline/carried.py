"""Parts of a study's model that files for other programs can contain: the chain under its task, most static effects."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.config.study import Study
from pliant.interfaces.effect import Effect, Model
from pliant.interfaces.task import SceneTask, Task
from pliant.pipeline.study import build_study_chain
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel


@dataclass(frozen=True)
class Carried:
    """The chain with the task's loads and the effects that can be exported, and why the others cannot."""

    chain: ChainModel
    left_out: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on what a file of this chain does not contain."""
        said = []
        if self.left_out:
            said.append(f"Effects that are not in it: {', '.join(self.left_out)}.")
        if any(law.states_error for law in self.chain.laws):
            said.append(
                "The law's error bar is not used by it: 'pliant simulate' with 'uncertainty' shows it."
            )
        if not any(body.mass_kg for body in self.chain.bodies):
            said.append(
                "Its modules have no mass, so that no step of a dynamics engine is short enough for their law: "
                "give chain.module_mass."
            )
        return tuple(said)


def carried_chain(context: RunContext, study: Study, mounted: bool = False) -> Carried:
    """Return the study's chain as files contain it, after all earlier stages. `mounted`: see `build_study_chain`."""
    chain = build_study_chain(context, study, mounted).chain
    if study.task is not None:
        task: Task | SceneTask = context.build("task", study.task)
        chain = task.prepare(chain)
    model, left_out = Model(chain), []
    for config in study.effects:
        effect: Effect = context.build("effect", config)
        after = effect.apply(model)
        reason = _reason(model, after)
        if reason:
            left_out.append(f"{config.kind} ({reason})")
        else:
            model = after
    return Carried(model.chain, tuple(left_out))


def _reason(before: Model, after: Model) -> str:
    """Return why the change by an effect cannot be exported; "" if it can."""
    added = after.chain.terms[len(before.chain.terms) :]
    if any(term.needs_time for term in added):
        return "it has a memory, or needs time"
    if added:
        return "it is a term of its own in every joint"
    if len(after.inputs) > len(before.inputs):
        return "it changes the input before the chain"
    if len(after.outputs) > len(before.outputs):
        return "it changes what sensors say"
    if any(law.scalar() is None for law in after.chain.laws):
        return "its law has no plain form"
    return ""
