"""Self-check of a study: magnitudes, rest pose, law, engines, keys and defaults that matter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.execution.progress import Silent, open_progress_bar
from pliant.formatting import percent
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.task import SceneTask
from pliant.pipeline.chain import build_chain
from pliant.pipeline.checks import (
    NOT_SETTLED,
    Check,
    DefaultNotChecked,
    DefaultThatMatters,
    SelfCheck,
    doubtful,
)
from pliant.pipeline.equilibrium_tolerance import tolerance_remarks
from pliant.pipeline.remarks import load_remarks, unused_blocks, unusual_numbers
from pliant.pipeline.segments import DesignStages, chain_segments
from pliant.pipeline.sensitivities import OF_THE_LAW, Budget, OwnResult, default_numbers, sensitivities
from pliant.pipeline.simulate import run_task
from pliant.pipeline.study import (
    StudyRun,
    build_study_laws,
    check_study,
    needs_fem,
    study_physics,
)
from pliant.pipeline.workbench import RunContext, content
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult

# Two engines agree within this share of the chain's length.
ENGINES_AGREE = 0.01
# A law is close to FEM below this share of its range, in its worst state that was not fitted.
LAW_CLOSE = 0.05
# A budget from which the progress of the defaults is shown, s.
SHOWN_FROM_S = 5.0
# A rest pose that gravity bends by more is reported.
SAG_RAD = math.radians(10.0)
# Time for sensitivities: of `doctor`, and of a run as a share of its stages' time, with a minimum.
DOCTOR_S = 60.0
OF_A_RUN, AT_LEAST_S = 0.3, 1.0
# A run settles the chain at rest if its task took no longer.
CHEAP_S = 2.0
# Checks whose doubts a run reports elsewhere.
SAID_BY_RUN = ("magnitude", "keys", "task", "payload", "tolerance")


def self_check(context: RunContext, study: Study) -> SelfCheck:
    """Return the checks of a study that an expert would make by hand.

    Args:
        context: plugins, store, progress.
        study: with any blocks; missing blocks are not checked.

    Raises:
        UserError: the study cannot be built.
    """
    notes = _Notes()
    check_study(context, study)
    has_law = study.chain is not None or study.family is not None
    stages = build_study_laws(replace(context, progress=notes), study) if has_law else ()
    checks = [*checks_before_simulation(study, stages)]
    checks += doubtful("law", [note for note in notes.heard if "depend" in note])
    if study.chain is None or study.task is None:
        checks.append(Check("simulation", "not checked", "The study has no chain or no task."))
        return SelfCheck(tuple(checks))
    simulated = SimulatedVariants(context, study, stages)
    result = simulated.simulate(study)
    checks += doubtful("payload", load_remarks(simulated.chain, study.noisy_task()))
    engine = context.build("physics", study_physics(context, study))
    checks += doubtful("tolerance", tolerance_remarks(simulated.chain, [engine]))
    checks += [_task(result), *_rest_pose(simulated), *_engines(simulated, result)]
    budget = Budget(DOCTOR_S, result.final.wall_s, _fem_s(context, study, stages), "it would take minutes")
    return SelfCheck(tuple(checks), *_defaults(simulated, result, {}, budget))


def check_run(context: RunContext, done: StudyRun) -> SelfCheck:
    """Return the cheap checks of a run, and the defaults that matter as far as its time allows.

    Simulations for the checks are stored with the run and reused.
    """
    if done.chain is None or done.engines[0].artifact is None or done.engines[0].result is None:
        return SelfCheck(tuple(checks_before_simulation(done.study, done.designs)))
    first, result = done.engines[0].artifact, done.engines[0].result
    simulated = SimulatedVariants(context, done.study, done.designs, done.chain)
    spread = done.uncertainty.value.get("metrics", {}) if done.uncertainty is not None else {}
    half = {name: (one["high"] - one["low"]) / 2.0 for name, one in spread.items()}
    stages = [
        *(d.fem for d in done.designs),
        *(d.law.artifact for d in done.designs),
        first,
        done.uncertainty,
    ]
    walls = [float(artifact.manifest["wall_s"]) for artifact in stages if artifact is not None]
    budget = Budget(
        max(OF_A_RUN * sum(walls), AT_LEAST_S),
        result.final.wall_s,
        _fem_s(context, done.study, done.designs),
        f"it would take more than {OF_A_RUN:.0%} of the run's time",
    )

    def compute(partial: Path) -> dict[str, Any]:
        rest = list(_rest_pose(simulated)) if result.final.wall_s <= CHEAP_S else [NOT_SETTLED]
        matter, left = _defaults(simulated, result, half, budget)
        return {"rest": _plain(rest), "defaults": _plain(matter), "not_checked": _plain(left)}

    study = done.study
    blocks = {head: content(block) for head in OF_THE_LAW if (block := getattr(study, head)) is not None}
    names = [name for _, _, name in default_numbers(study)]
    made = context.make(
        "checks",
        compute,
        components=[],
        modules=["pliant.pipeline.self_check", "pliant.pipeline.sensitivities"],
        config={"defaults": names, "blocks": blocks, "error_bars": half},
        inputs={"simulate": first.key},
    ).value
    checks = [
        *checks_before_simulation(study, done.designs),
        *(Check(**one) for one in made["rest"]),
        *_engine_checks(done),
    ]
    return SelfCheck(
        tuple(checks),
        tuple(DefaultThatMatters(**one) for one in made["defaults"]),
        tuple(DefaultNotChecked(**one) for one in made["not_checked"]),
    )


def checked_run(context: RunContext, done: StudyRun) -> StudyRun:
    """Return the run with its checks; their doubts are among its remarks."""
    checked = check_run(context, done)
    doubts = [check.sentence for check in checked.doubts if check.subject not in SAID_BY_RUN]
    return replace(done, checked=checked, doubts=(*done.doubts, *doubts))


def model_checks(context: RunContext, study: Study, stages: Sequence[DesignStages]) -> Iterator[Check]:
    """Yield the checks that need no simulation in time, for a model that is compared with a recording."""
    yield from checks_before_simulation(study, stages)
    backend: PhysicsBackend = context.build("physics", study_physics(context, study))
    if study.chain is not None and not backend.capabilities.dynamic:
        yield from _rest_pose(SimulatedVariants(context, study, stages))


def checks_before_simulation(study: Study, stages: Sequence[DesignStages]) -> Iterator[Check]:
    """Yield the checks of a study's numbers, keys and laws that need no simulation."""
    yield from doubtful("magnitude", unusual_numbers(study))
    yield _keys(unused_blocks(study, [stage.fem is not None for stage in stages]))
    yield from (_law(stage.law.report) for stage in stages)


def _plain(records: Sequence[Any]) -> list[dict[str, Any]]:
    return [dict(vars(one)) for one in records]


class _Notes(Silent):
    """Progress that keeps its notes."""

    def __init__(self) -> None:
        self.heard: list[str] = []

    def note(self, text: str) -> None:
        self.heard.append(text)


def _keys(unused: Sequence[str]) -> Check:
    if not unused:
        return Check("keys", "fine", "Every block of the study is used.")
    return Check("keys", "doubtful", f"{', '.join(unused)}: no stage of a run reads it.")


def _law(report: Any) -> Check:
    if report is None:
        return Check(
            "law", "not checked", "The law is stated or comes without states that were left out of its fit."
        )
    worst = report.worst_of_range
    said = f"The law is within {percent(worst)} of its range at {report.n_heldout} states that it was not fitted to."
    return Check("law", "fine" if worst <= LAW_CLOSE else "doubtful", said)


def _task(result: TaskResult) -> Check:
    outside = result.final.outside_domain
    if result.not_reached or not result.final.converged:
        return Check("task", "doubtful", result.not_reached or "The chain does not settle under the task.")
    if outside:
        return Check(
            "task", "doubtful", f"{len(outside)} joints end outside the data of their law: {outside[0]}."
        )
    return Check("task", "fine", "The chain settles under the task, inside the data of its laws.")


def _rest_pose(simulated: SimulatedVariants) -> Iterator[Check]:
    """Yield the check of the chain's bending by gravity and payload without actuation."""
    if not np.any(simulated.chain.gravity_m_s2):
        yield Check(
            "gravity", "doubtful", "The chain has no gravity: is it meant to lie on a table or in water?"
        )
        return
    try:
        sag = simulated.bend_at_rest()
    except PliantError as error:
        yield Check("rest pose", "not checked", str(error))
        return
    if sag is None:
        yield Check(
            "rest pose", "doubtful", "Without actuation the chain does not settle under its own weight."
        )
        return
    said = f"Without actuation gravity and payload turn the tip by {math.degrees(sag):.1f}°."
    yield Check("rest pose", "doubtful" if sag > SAG_RAD else "fine", said)


def _engines(simulated: SimulatedVariants, result: TaskResult) -> Iterator[Check]:
    """Yield checks of the distance between the equilibria of the other engines and of the study's own."""
    study = simulated.study
    if not study.cross_check:
        yield Check(
            "engines", "not checked", "The study has one engine; 'cross_check: [mujoco]' compares another."
        )
    for other in study.cross_check:
        try:
            there = simulated.simulate(study.model_copy(update={"physics": other}))
        except PliantError as error:
            yield Check("engines", "not checked", f"{other.kind}: {error}")
            continue
        yield _apart(other.kind, there, result, simulated.chain.length_m)


def _engine_checks(done: StudyRun) -> Iterator[Check]:
    """Yield the same checks from finished runs of the engines."""
    first, *others = [(one.kind, one.result) for one in done.engines if one.result is not None]
    for kind, result in others:
        if done.chain is not None and first[1] is not None and result is not None and not result.stills:
            yield _apart(kind, result, first[1], done.chain.length_m)


def _apart(kind: str, there: TaskResult, own: TaskResult, length_m: float) -> Check:
    apart = float(np.linalg.norm(there.final.tip_m - own.final.tip_m)) / length_m
    said = f"The tip in {kind} is {percent(apart)} of the chain's length from that in the study's engine."
    return Check("engines", "fine" if apart <= ENGINES_AGREE else "doubtful", said)


def _fem_s(context: RunContext, study: Study, stages: Sequence[DesignStages]) -> float:
    """Return the time of the FEM behind the study's laws in s; infinite for that of a shared block."""
    if any(stage.design.shared is not None for stage in stages):
        return math.inf
    wall_s = [float(one.fem.manifest["wall_s"]) for one in stages if one.fem is not None]
    return sum(wall_s) if any(needs_fem(context, study, one.design) for one in stages) else 0.0


def _defaults(
    simulated: SimulatedVariants, result: TaskResult, spread: Mapping[str, float], budget: Budget
) -> tuple[tuple[DefaultThatMatters, ...], tuple[DefaultNotChecked, ...]]:
    study = simulated.study
    answer = OwnResult(result.metrics, simulated.chain.length_m, spread)
    progress = simulated.context.progress if budget.total_s > SHOWN_FROM_S else Silent()
    with open_progress_bar(progress, "defaults", len(list(default_numbers(study)))) as bar:
        matter, left = sensitivities(study, answer, simulated.simulate, budget, bar)
    return tuple(matter), tuple(left)


@dataclass(frozen=True)
class SimulatedVariants:
    """Runs of a study and of its variants; their results are not stored.

    Attributes:
        context, study: the study.
        stages: its laws.
        built: its chain, if known.
    """

    context: RunContext
    study: Study
    stages: Sequence[DesignStages]
    built: ChainModel | None = None

    @cached_property
    def chain(self) -> ChainModel:
        """The study's own chain."""
        return self.built if self.built is not None else self._chain(self.study)

    @cached_property
    def _quiet(self) -> RunContext:
        return replace(self.context, progress=Silent())

    def simulate(self, study: Study) -> TaskResult:
        """Return the task's result in the study's engine."""
        context = self._quiet
        same = all(getattr(study, head) is getattr(self.study, head) for head in ("chain", *OF_THE_LAW))
        chain = self.chain if same else self._chain(study)
        effects = [context.build("effect", effect) for effect in study.effects]
        engine = context.build("physics", study_physics(context, study))
        return run_task(engine, context.build("task", study.noisy_task()), effects, chain)

    def bend_at_rest(self) -> float | None:
        """Return the rotation of the tip (rad) without actuation; None if the chain does not settle."""
        context, study = self._quiet, self.study
        task = None if study.task is None else context.build("task", study.noisy_task())
        prepared = self.chain if task is None or isinstance(task, SceneTask) else task.prepare(self.chain)
        with context.build("physics", study_physics(context, study)).build(prepared) as simulation:
            rest = simulation.settle()
        return float(np.linalg.norm(np.sum(rest.joint_angles, axis=0))) if rest.converged else None

    def _chain(self, study: Study) -> ChainModel:
        """Return a variant's chain; laws are solved and fitted again only if their inputs differ."""
        stages = self.stages
        if not all(getattr(study, head) is getattr(self.study, head) for head in OF_THE_LAW):
            stages = build_study_laws(self._quiet, study)
        return build_chain(study.need("chain", "a simulation"), chain_segments(self._quiet, study, stages))
