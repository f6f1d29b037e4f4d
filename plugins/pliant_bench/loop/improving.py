"""The improved study at the end of an experiment: what it adds, and which of this the verdict does not name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant import api
from pliant.cli.session import Session
from pliant.diagnosis.evidence_table import LAW
from pliant.diagnosis.extension import write_extended_study
from pliant.diagnosis.search import Tick
from pliant.diagnosis.steps import Improvement, Step
from pliant.diagnosis.verdict import named
from pliant.execution.executors import Workers
from pliant.formatting import listed
from pliant.report.extension import cited
from pliant.report.improvement import origin, stands_for
from pliant_bench.loop.folder import ExperimentFolder

IMPROVABLE = ("missing_effect", "unknown_effect", "law_off", "ambiguous")
BESIDE = "; not named by the experiment's verdict"


@dataclass(frozen=True)
class AddedBlock:
    """A block of effects that `improve` added to the study.

    Attributes:
        name: its effects, or what it corrects.
        in_verdict: whether the verdict names it, or a class that it represents.
        why: the reason for it, in sentences.
    """

    name: str
    in_verdict: bool
    why: str


@dataclass(frozen=True)
class ImprovedStudy:
    """What the improvement gave.

    Attributes:
        path: of the improved study; None if no step was justified.
        added: its blocks, in their order.
        left_out: effects of the verdict that it does not have.
        stopped: why no further step was taken.
    """

    path: Path | None
    added: tuple[AddedBlock, ...]
    left_out: tuple[str, ...]
    stopped: str

    @property
    def sentences(self) -> tuple[str, ...]:
        """Return what the improved study contains in addition to the verdict, and what it lacks of it."""
        if self.path is None:
            return (f"No improved study was written. {self.stopped}".strip(),)
        by_verdict = [one.name for one in self.added if one.in_verdict]
        beside = [one for one in self.added if not one.in_verdict]
        said = [f"{self.path.name} has {listed(by_verdict)}, which the verdict names."] if by_verdict else []
        said += [
            f"{self.path.name} also has {one.name}, which the verdict does not name. {one.why}"
            for one in beside
        ]
        if beside:
            said.append("Remove its block from 'effects' to hold to the verdict.")
        if self.left_out:
            said.append(
                f"It does not have {listed(self.left_out)}, which the verdict names. {self.stopped}".strip()
            )
        return tuple(said)

    def json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "study": None if self.path is None else str(self.path),
            "added": [{"name": one.name, "in_verdict": one.in_verdict, "why": one.why} for one in self.added],
            "left_out": list(self.left_out),
            "stopped": self.stopped,
        }


def improve_study(
    session: Session,
    opened: api.OpenStudy,
    study: Path,
    folder: ExperimentFolder,
    verdict: Mapping[str, Any],
    kinds: Sequence[str],
    tick: Tick,
    workers: Workers,
) -> ImprovedStudy:
    """Improve the model with all recordings, and write it into the folder of the report where a step is justified."""
    data = folder.recordings()
    measurement = api.read_measurement(opened, data)
    steps = api.improve(opened, measurement, kinds=kinds, tick=tick, workers=workers)
    added = added_blocks(steps, verdict)
    has = {kind for step in steps.steps for kind in step.added}
    left_out = tuple(kind for kind in verdict["selected"] if kind not in has)
    if steps.final is None and steps.learned is None:
        return ImprovedStudy(None, (), left_out, steps.reason)
    target = folder.path / "improved.yaml"
    notes = {
        kind: stands_for(step) + ("" if is_of(step, verdict) else BESIDE)
        for step in steps.steps
        for kind in step.added
    }
    write_extended_study(
        study,
        target,
        opened.study,
        session.overrides,
        steps.final,
        origin(steps, cited(measurement)),
        session.installed,
        notes_by_kind=notes,
        learned=steps.learned,
        data=data,
    )
    return ImprovedStudy(target, added, left_out, steps.reason)


def added_blocks(steps: Improvement, verdict: Mapping[str, Any]) -> tuple[AddedBlock, ...]:
    """Return what each step adds; the first step is the study's own model."""
    return tuple(
        AddedBlock(step.named or named(step.added), is_of(step, verdict), step.why)
        for step in steps.steps
        if step.added
    )


def is_of(step: Step, verdict: Mapping[str, Any]) -> bool:
    """Return whether the verdict names what a step adds: the effect, its class, or the law's own error."""
    if step.cause == "law":
        return verdict["verdict"] == "law_off" or LAW in verdict["selected_class"]
    if step.learned is not None:
        return False
    known = {*verdict["selected"], *verdict.get("selected_class", ()), *verdict.get("beside_class", ())}
    return bool(step.added) and set(step.added) <= known
