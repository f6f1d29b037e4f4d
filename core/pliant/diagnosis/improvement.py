"""Compare → diagnose → extend, until the noise floor or an honest stop.

Two questions are answered apart. Whether the model predicts better decides about a step: it is taken as long as runs,
conditions or blocks that are left out of the fit are predicted better by more than the uncertainty of that, with one
run and few readings too. Which cause it is, the verdict says: where it leaves that open the step says what it is for.
`named_only` takes steps only where a verdict names an effect or a group of look-alikes.

Runs that are put aside at the start are never looked at by a choice: they are only reported. All decisions (verdicts,
the order of effects, whether a step is kept, when to stop) rest on the training runs. The floor that errors are
divided by at the end is that of all runs, as the final model's residuals show it: repeats that were put aside say how
the bench scatters, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pliant.config.study import Study
from pliant.diagnosis.bands import bands
from pliant.diagnosis.diagnosis import Diagnosis, diagnose, explanation
from pliant.diagnosis.evidence_table import NOTHING, Kinds
from pliant.diagnosis.extension import Extension, Ground, extend
from pliant.diagnosis.learned_forms import KIND as LEARNED
from pliant.diagnosis.learned_term import LearnedTerm, learn
from pliant.diagnosis.learned_words import depends_on, described
from pliant.diagnosis.left_out import blocks_of, condition_of_runs
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.readings import score
from pliant.diagnosis.search import Tick
from pliant.diagnosis.steps import (
    Cause,
    Improvement,
    Step,
    StepProposal,
    change_in_words,
    named_step,
    predicting_step,
)
from pliant.diagnosis.test_split import TrainTestSplit, lock
from pliant.diagnosis.unseen import SURE, block_squares, prediction_gain
from pliant.diagnosis.verdict import UNDECIDED
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.comparison import compare, interpret
from pliant.evidence.excess import Excess
from pliant.evidence.places import Residuals
from pliant.evidence.prediction import Predictor
from pliant.execution.executors import Workers
from pliant.experiments.experiment_catalogue import own_runs
from pliant.formatting import percent
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.beginnings import with_known_states
from pliant.measurements.repeats import repeat_groups
from pliant.pipeline.workbench import Workbench
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark

MOST_STEPS = 6
# A set of effects is kept if it lowers the error on training runs left out of the fit by this share.
LEAST_GAIN = 0.01
# What is said at the end: where the error that is left is small, where it is clearly above the noise, and where
# nothing tells the noise.
RIGHT = "The model is right to {left} times the noise"
CLOSINGS = {
    "nothing_missing": (
        "What is left is noise, {left} times its floor: no listed effect lowers the error of the training runs any "
        "further.",
        "No listed effect lowers the error of the training runs any further, and yet it is {left} times the noise.",
        "No listed effect lowers the error of the training runs any further; nothing tells how much of what is left is "
        "noise.",
    ),
    "unknown_effect": (
        f"{RIGHT}; no listed effect explains the rest ({{gain}}).",
        "Something is missing, and it is not in the list: the error is {left} times the noise, and no listed effect, "
        "nor a few of them together, brings it down.",
        "Something is missing, and it is not in the list: no listed effect, nor a few of them together, explains the "
        "error.",
    ),
    "law_off": (
        "What is left is noise, {left} times its floor. No listed effect lowers the error of the training runs any "
        "further; the law itself is off{law}.",
        "No listed effect lowers the error of the training runs any further; the law itself is off{law}, and the "
        "error is {left} times the noise.",
        "No listed effect lowers the error of the training runs any further; the law itself is off{law}.",
    ),
    "ambiguous": (f"{RIGHT} ({{gain}}). {UNDECIDED}", UNDECIDED, UNDECIDED),
}


@dataclass(frozen=True, eq=False)
class _Draft:
    """A step before the floor is known: residuals of all runs, and of training runs left out."""

    added: tuple[str, ...]
    effects: tuple[EffectConfig, ...]
    why: str
    residuals: Residuals
    left_out: Residuals
    stands_for: Kinds = ()
    cause: Cause = ""
    learned: LearnedTerm | None = None


def improve(
    bench: Workbench,
    study: Study,
    measurement: Measurement,
    *,
    kinds: Sequence[str] | None = None,
    most_steps: int = MOST_STEPS,
    learned: bool = False,
    named_only: bool = False,
    tick: Tick | None = None,
    workers: Workers = 1,
    split: TrainTestSplit | None = None,
) -> Improvement:
    """Walk the whole loop.

    Args:
        bench, study, measurement: the model and what the bench recorded.
        kinds: candidates; all effects by default.
        most_steps: effects at most.
        learned: whether a learned term may be the last step.
        named_only: add nothing whose cause no verdict names.
        tick: called with the name of each hypothesis when it has been fitted.
        workers: who fits hypotheses, as for `diagnose`.
        split: which runs are put aside, where that was decided before; by `lock` otherwise.

    Raises:
        UserError: no reading can be used, or an engine that cannot follow histories.
    """
    walk = _Walk(bench, study, measurement, kinds, tick, workers, split)
    stop, reason = walk.go(most_steps, named_only)
    final = walk.final()
    if not walk.correct_law(named_only) and learned:
        walk.learn()
    return walk.scored(stop, reason, final)


class _Walk:
    """The model so far."""

    def __init__(
        self,
        bench: Workbench,
        study: Study,
        measurement: Measurement,
        kinds: Sequence[str] | None,
        tick: Tick | None,
        workers: Workers,
        split: TrainTestSplit | None,
    ) -> None:
        measurement, self.unknown = with_known_states(measurement)
        self.bench, self.study, self.measurement = bench, study, measurement
        self.locked = lock(measurement) if split is None else split
        self.kinds, self.tick, self.workers = kinds, tick, workers
        self.ground = Ground.of(bench, study, self.locked.training)
        self.effects = study.effects
        self.added: list[str] = []
        self.forms: set[str] = set()
        self.last: Diagnosis | None = None
        self.mistakes: tuple[Mistake, ...] | None = None  # of the record, by the model as it came
        plain = self.ground.residuals(self.effects)
        whole = self.ground.residuals(self.effects, measurement)
        self.drafts = [_Draft((), self.effects, self._seen(), whole, plain)]

    def go(self, most_steps: int, named_only: bool) -> tuple[str, str]:
        """Take steps; returns what stopped it, and the reason where it is not a verdict."""
        while True:
            found = self._diagnose()
            proposals = [named_step(found), None if named_only else predicting_step(found, self.added)]
            refused: tuple[str, str] = (found.verdict, "")
            for proposal in filter(None, proposals):
                refused = self._refused(proposal, most_steps)
                if not refused[0]:
                    break
            else:
                return refused

    def _refused(self, proposal: StepProposal, most_steps: int) -> tuple[str, str]:
        """Take the steps of a proposal; what speaks against it and why, both empty where they were taken."""
        order, alike = proposal.order, {*proposal.order, *proposal.stands_for}
        again = [k for d in self.drafts for k in d.added if not {k, *d.stands_for}.isdisjoint(alike)]
        if proposal.cause != "open" and again:
            return "same_effect", (
                f"What is left looks like more of {again[0]}, which is in the model already: its equation is an "
                "idealisation that these readings see through. A form of your own may fit better."
            )
        if len(self.added) + len(order) > most_steps:
            return "most_steps", f"{most_steps} effects are the most that are added in one go."
        forms = self.forms | set(proposal.forms)
        whole = extend(self.ground, self.effects, [*self.added, *order], forms=forms, profiles=False)
        if not self._gains(whole):
            return "no_gain", (
                f"Adding {' and '.join(order)} lowers the error of the runs that it is fitted to, but not that of "
                "runs and conditions left out of the fit: it was not added."
            )
        self.forms = forms
        for kind in order:
            self._take(kind, proposal)
        return "", ""

    def final(self) -> Extension | None:
        """The last fit once more, with profile intervals; the last step has its values."""
        if not self.added:
            return None
        found = extend(self.ground, self.effects, self.added, forms=self.forms)
        last = self.drafts.pop()
        residuals = self.ground.residuals(found.effects, self.measurement)
        left = found.left_out_runs
        self.drafts.append(replace(last, effects=found.effects, residuals=residuals, left_out=left))
        self.effects = found.effects
        return found

    def correct_law(self, named_only: bool) -> bool:
        """Add the law's own error where the last diagnosis shows one and runs left out are predicted better with it."""
        found = self.last
        if found is None or found.law_off is None or found.explained != NOTHING:
            return False
        if named_only and found.verdict != "law_off":
            return False
        off, term = found.law_off, found.law_off.term
        if not (term.sure > SURE and term.after < (1.0 - LEAST_GAIN) * term.before):
            return False
        effects = (*self.effects, term.effect)
        residuals = self.ground.residuals(effects, self.measurement)
        why = (
            f"The law itself is off {off.words}, {percent(off.size)} of its torque range: a smooth surface over "
            "actuation and deformation corrects it where these runs went, and nowhere else. It takes the error on "
            f"{term.on} from {term.before:.2f} to {term.after:.2f} times the noise."
        )
        whole = [len(run) for run in found.measurement.runs] == [
            len(run) for run in self.locked.training.runs
        ]
        left = found.readings.unpack(term.left_out) if whole else self.ground.residuals(effects)
        self.drafts.append(_Draft((LEARNED,), effects, why, residuals, left, cause="law", learned=term))
        return True

    def learn(self) -> None:
        """What no listed effect explains as a learned term, where it predicts training runs left out better."""
        predictor = self._predictor()
        readings = self.ground.readings(self.effects)
        noise = noise_view(
            self.locked.training, self.ground.residuals(self.effects), readings.scales, self.ground.groups
        )
        condition = condition_of_runs(readings.n_runs, [group.runs for group in self.ground.groups])
        alone = len(np.unique(readings.run)) == 1
        folds = blocks_of(readings) if alone else readings.fold
        found = learn(predictor, readings, noise, condition[readings.run], folds)
        if found is None:
            return
        effects = (*self.effects, found.effect)
        residuals = self.ground.residuals(effects, self.measurement)
        fall = (
            f"It takes the error on {found.on} from {found.before:.2f} to {found.after:.2f} times the noise."
        )
        why = f"{described(found)[:1].upper() + described(found)[1:]} {fall}"
        left = readings.unpack(found.left_out)
        self.drafts.append(_Draft((LEARNED,), effects, why, residuals, left, cause="learned", learned=found))

    def _predictor(self) -> Predictor:
        """The model as it is, driven by the training runs."""
        study = self.study.model_copy(update={"effects": self.effects})
        return Predictor.of_study(self.bench, study, self.locked.training)

    def _diagnose(self) -> Diagnosis:
        study = self.study.model_copy(update={"effects": self.effects})
        predictor = self._predictor()
        own = own_runs(study, predictor.chain, predictor.measurement)
        self.last = diagnose(predictor, kinds=self.kinds, runs=own, tick=self.tick, workers=self.workers)
        self.mistakes = self.last.bookkeeping if self.mistakes is None else self.mistakes
        return self.last

    def _gains(self, whole: Extension) -> bool:
        """Better on runs left out beyond the uncertainty of that, and no worse on conditions left out.

        Where one condition alone shows an effect it stays in their fit.
        """
        floors, usual = whole.noise.floors, self.ground.readings(self.effects).scales
        scales = {k: floors[k].value if floors[k].value > 0.0 else scale for k, scale in usual.items()}
        before = block_squares(self.drafts[-1].left_out, scales)
        gain = prediction_gain(before, block_squares(whole.left_out_runs, scales))
        conditions = block_squares(whole.left_out or whole.residuals, scales).sum()
        no_worse = conditions < (1.0 + LEAST_GAIN) ** 2 * before.sum()
        return gain.share > 1.0 - (1.0 - LEAST_GAIN) ** 2 and gain.sure > 1.0 and no_worse

    def _take(self, kind: str, proposal: StepProposal) -> None:
        found = extend(
            self.ground,
            self.effects,
            [*self.added, kind],
            forms=self.forms & {*self.added, kind},
            profiles=False,
        )
        self.effects = found.effects
        self.added.append(kind)
        before, after = (
            score(left, found.noise.floors) for left in (self.drafts[-1].left_out, found.left_out_runs)
        )
        alone = len(self.locked.training.runs) == 1
        on = "blocks of the run that are" if alone else "training runs that are"
        fall = f"It takes the error of {on} left out of the fit {change_in_words(before, after)}."
        residuals = self.ground.residuals(self.effects, self.measurement)
        known = proposal.why(kind, self.bench.registry)
        why = f"{known} {fall} {self._seen()}"
        group = proposal.stands_for
        self.drafts.append(
            _Draft((kind,), self.effects, why, residuals, found.left_out_runs, group, proposal.cause)
        )

    def _seen(self) -> str:
        """Where the model fails on the training runs now."""
        return interpret(compare(self.locked.training, self.ground.predictor.predict(self.effects)))

    def scored(self, stop: str, reason: str, final: Extension | None) -> Improvement:
        """Errors of all steps over one floor."""
        last, locked = self.drafts[-1], self.locked
        scales = self.ground.readings(last.effects).scales
        noise = noise_view(self.measurement, last.residuals, scales, repeat_groups(self.measurement))
        steps = []
        for draft in self.drafts:
            training = score(draft.left_out, noise.floors)
            aside = score(draft.residuals, noise.floors, locked.runs) if locked.runs else training
            share = aside.n / max(score(draft.residuals, noise.floors).n, 1)
            read = {name: noise.floors[name] for name in aside.rmse}
            se = Excess.of(aside.over_floor, read, noise.n_effective * share).se
            unseen = score(draft.residuals, noise.floors, locked.unseen) if locked.unseen else None
            steps.append(
                Step(
                    draft.added,
                    draft.effects,
                    draft.why,
                    aside,
                    se,
                    unseen,
                    training,
                    draft.stands_for,
                    draft.cause,
                    draft.learned,
                )
            )
        listed_last = steps[-2] if last.learned is not None else steps[-1]
        reason = self._closing(stop, reason, listed_last, noise)
        if last.learned is not None:
            what = "describes what is left" if last.cause == "learned" else "corrects the law"
            reason += f" The last step is a learned term over {depends_on(last.learned)}: it {what}."
        not_tried = self.last.not_tried if self.last is not None else ()
        remarks = [
            *(Remark(mistake.sentence, Rank.UNIT) for mistake in self.mistakes or ()),
            *self.measurement.remarks,
            *self.unknown,
            *self.ground.predictor.remarks,
            *not_tried,
            locked.why,
        ]
        remarks += [*_rises(steps), *_still_wrong(steps[-1], stop)]
        single = "blocks of the one run, left out one after another, not of a run that nothing has seen"
        several = "runs left out one after another, not of runs that nothing has seen"
        if not locked.runs:
            remarks.append(f"Errors are those of {single if len(locked.training.runs) == 1 else several}.")
        if not noise.judged:
            remarks.append(
                Remark(
                    "Without repeats or a stated sigma the floor holds fast noise only: an error above it may still be "
                    "noise.",
                    Rank.FLOOR,
                )
            )
        next_run = None if self.last is None else self.last.next_run
        return Improvement(
            tuple(steps),
            stop,
            reason,
            locked,
            noise.floors,
            noise.judged,
            final,
            tuple(remarks),
            next_run,
            None
            if final is None or last.learned
            else bands(self.ground.predictor, final.posterior, final.scatter),
        )

    def _closing(self, stop: str, reason: str, last: Step, noise: NoiseView) -> str:
        """The reason in sentences, by the error that is left: the larger one where training runs show more."""
        left = Excess(last.locked.over_floor, last.locked_se)
        training = Excess.of(last.training.over_floor, noise.floors, noise.n_effective)
        left = training if left.small and not training.small else left
        small = noise.judged and left.small
        found = self.last
        if reason or found is None:
            return f"{RIGHT.format(left=left)}. {reason}" if small else reason
        if stop in CLOSINGS:
            words = CLOSINGS[stop][0 if small else 1 if np.isfinite(left.ratio) else 2]
            first = words.format(
                left=left, gain=left.gain, contenders=found.judgement.contenders, law=found.judgement.law
            )
        elif stop == "insufficient_data" and self.added:
            first = "Whether more is missing these data cannot tell."
        else:
            first = found.judgement.sentence
        if stop in ("nothing_missing", "law_off"):
            return first
        if self.drafts[-1].learned is not None:
            found = replace(found, learned=None)  # it is in the model: nothing to offer
        of_verdict = stop != "unknown_effect"  # said by the closing with the error that is left at the end
        return " ".join([first, *explanation(found, self.bench.registry, of_verdict)])


def _still_wrong(last: Step, stop: str) -> list[str]:
    """The training runs show nothing more, and yet the runs put aside do."""
    left = Excess(last.locked.over_floor, last.locked_se)
    if stop != "nothing_missing" or left.small or not np.isfinite(left.ratio):
        return []
    unseen = last.unseen
    where = f" ({unseen.over_floor:.2f} where their condition was in no other run)" if unseen else ""
    return [
        f"On the runs put aside the error is still {last.locked.over_floor:.2f} ± {last.locked_se:.2f} times the noise"
        f"{where}: something is missing or wrong that the training runs do not show. Extend the model with "
        "all runs, or measure more conditions."
    ]


def _rises(steps: Sequence[Step]) -> list[str]:
    """Steps after which the error on runs put aside was larger: reported, never acted upon."""
    return [
        f"With {' + '.join(now.added)} the error on the runs put aside rose from {before.locked.over_floor:.2f} to "
        f"{now.locked.over_floor:.2f} times the noise, although it fell on training runs left out: do not "
        "trust this step without further runs."
        for before, now in pairwise(steps)
        if now.locked.over_floor > before.locked.over_floor
    ]
