"""Iterative improvement: compare → diagnose → extend, until the noise floor or a justified stop.

Prediction and cause are decided separately. Whether the model predicts better decides about a step: it is taken as long
as runs, conditions or blocks that are left out of the fit are predicted better by more than the uncertainty of the
gain, also with one run and few readings. The verdict decides which cause it is: if it is open, the step states what it
is for. `named_only` takes steps only if a verdict names an effect or a group of look-alikes.

Test runs, held out at the start, never influence a choice: they are only reported. All decisions (verdicts, the order
of effects, whether a step is kept, when to stop) depend on the training runs. The floor that errors are divided by at
the end is that of all runs, from the final model's residuals, because repeats among the test runs also inform about the
scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pliant.config.study import Study
from pliant.diagnosis.bands import bands
from pliant.diagnosis.data_split import TrainTestSplit, split_runs
from pliant.diagnosis.diagnosis import Diagnosis, diagnose, explanation
from pliant.diagnosis.evidence_table import NOTHING, Kinds
from pliant.diagnosis.extension import Extension, Ground, extend
from pliant.diagnosis.learned_forms import KIND as LEARNED
from pliant.diagnosis.learned_term import LearnedTerm, learn
from pliant.diagnosis.learned_words import depends_on, described
from pliant.diagnosis.left_out import assign_blocks, condition_indices
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
from pliant.diagnosis.unseen import SURE, block_squares, prediction_gain
from pliant.diagnosis.verdict import UNDECIDED
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.comparison import compare
from pliant.evidence.comparison_sentences import located
from pliant.evidence.error_bins import Residuals
from pliant.evidence.excess import Excess
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.opening import measured_model
from pliant.evidence.prediction import Predictor
from pliant.execution.executors import Workers
from pliant.experiments.experiment_catalogue import own_runs
from pliant.formatting import percent
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.repeats import repeat_groups
from pliant.measurements.thinning import downsample
from pliant.pipeline.workbench import RunContext
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark
from pliant.registry.residual_model import require_residual_model

MOST_STEPS = 6
# A set of effects is kept if it lowers the error on left-out training runs by this share.
LEAST_GAIN = 0.01
# A correction of the law may raise the error of no output by more than this share.
MOST_RISE = 0.02
# Placeholder in the reason of a step for its fall of the error, which is filled in when all steps have one floor.
FALL = "{fall}"
# Closing sentences: if the remaining error is small, if it is clearly above the noise, and if the noise is unknown.
RIGHT = "The model is right to {left} times the noise"
CLOSINGS = {
    "nothing_missing": (
        "The error that is left is {left} times the noise, which noise alone may leave: no listed effect lowers the "
        "error of the training runs any further.",
        "No listed effect lowers the error of the training runs any further, and yet it is {left} times the noise.",
        "No listed effect lowers the error of the training runs any further; it is unknown how much of what is left "
        "is noise.",
    ),
    "unknown_effect": (
        f"{RIGHT}; no listed effect explains the rest ({{gain}}).",
        "Something is missing, and it is not in the list: the error is {left} times the noise, and no listed effect, "
        "nor a few of them together, explains all of it.",
        "Something is missing, and it is not in the list: no listed effect, nor a few of them together, explains the "
        "error.",
    ),
    "law_off": (
        "The error that is left is {left} times the noise, which noise alone may leave. No listed effect lowers the "
        "error of the training runs any further; the law itself is off{law}.",
        "No listed effect lowers the error of the training runs any further; the law itself is off{law}, and "
        "{which} is {left} times the noise.",
        "No listed effect lowers the error of the training runs any further; the law itself is off{law}.",
    ),
    "ambiguous": (f"{RIGHT} ({{gain}}). {UNDECIDED}", UNDECIDED, UNDECIDED),
}


@dataclass(frozen=True, eq=False)
class _Draft:
    """A step before the floor is known: residuals of all runs, and of left-out training runs and specimens.

    `on`: the runs on which the step's fall of the error is reported, once all steps have one floor; empty for none.
    """

    added: tuple[str, ...]
    effects: tuple[EffectConfig, ...]
    why: str
    residuals: Residuals
    left_out: Residuals
    left_out_specimens: Residuals
    stands_for: Kinds = ()
    cause: Cause = ""
    learned: LearnedTerm | None = None
    on: str = ""


def improve(
    context: RunContext,
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
    """Run the whole loop.

    Args:
        context, study, measurement: the model and the recorded runs.
        kinds: candidates; all effects by default.
        most_steps: maximum number of effects.
        learned: whether a learned term may be the last step.
        named_only: add nothing whose cause is not named by a verdict.
        tick: called with the name of each hypothesis when it has been fitted.
        workers: where hypotheses are fitted, as for `diagnose`.
        split: the test runs, if they were chosen before; by `split_runs` otherwise.

    Raises:
        UserError: no reading can be used, or an engine that cannot simulate histories.
        MissingDependencyError: `learned`, and no package that learns a term is installed.
    """
    if learned:
        require_residual_model()
    walk = _Walk(context, study, measurement, kinds, tick, workers, split)
    stop, reason = walk.go(most_steps, named_only)
    final = walk.final()
    corrected = walk.law_is_off and walk.correct_law(named_only)
    if not corrected and not (learned and walk.learn()) and stop != "most_steps":
        walk.correct_law(named_only)
    return walk.scored(stop, reason, final)


class _Walk:
    """The state of the loop: the model so far."""

    def __init__(
        self,
        context: RunContext,
        study: Study,
        measurement: Measurement,
        kinds: Sequence[str] | None,
        tick: Tick | None,
        workers: Workers,
        split: TrainTestSplit | None,
    ) -> None:
        measurement, self.unknown = measured_model(context, study, measurement).with_known_states()
        self.context, self.study, self.measurement = context, study, measurement
        self.locked = split_runs(measurement) if split is None else split
        self.kinds, self.tick, self.workers = kinds, tick, workers
        training = self.locked.training
        self.unthinned = Ground.from_study(context, study, training)
        short, _ = downsample(training, self.unthinned.predictor.spatial)
        self.ground = self.unthinned if short is training else Ground.from_study(context, study, short)
        self.effects = study.effects
        self.added: list[str] = []
        self.forms: set[str] = set()
        self.last: Diagnosis | None = None
        self.mistakes: tuple[Mistake, ...] | None = None  # of the record, by the original model
        plain = self.ground.residuals(self.effects)
        whole = self._residuals(self.effects)
        self.drafts = [_Draft((), self.effects, self._seen(), whole, plain, plain)]

    def go(self, most_steps: int, named_only: bool) -> tuple[str, str]:
        """Take steps; return the verdict that stopped them, and the reason if it is not a verdict."""
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
        """Take the steps of a proposal; return the objection and its reason, both empty if the steps were taken."""
        order, alike = proposal.order, {*proposal.order, *proposal.stands_for}
        again = [k for d in self.drafts for k in d.added if not {k, *d.stands_for}.isdisjoint(alike)]
        if proposal.cause != "open" and again:
            return "same_effect", (
                f"What is left looks like more of {again[0]}, which is in the model already: its equation is an "
                "idealisation that these readings contradict. A form of your own may fit better."
            )
        if len(self.added) + len(order) > most_steps:
            return "most_steps", f"{most_steps} effects are the most that are added in one go."
        forms = self.forms | set(proposal.forms)
        whole = extend(self.ground, self.effects, [*self.added, *order], forms=forms, profiles=False)
        # of chains every effect of a set that predicts better is kept, as their published results were
        own_model = not isinstance(self.ground.predictor, Predictor)
        sure = SURE if own_model and proposal.cause == "open" else 1.0
        if not self._gains(whole, sure):
            return "no_gain", (
                f"Adding {' and '.join(order)} lowers the error of the runs that it is fitted to, but not that of "
                "runs and conditions left out of the fit: it was not added."
            )
        self.forms = forms
        for number, kind in enumerate(order):
            found = whole if len(order) == 1 else self._with(kind)
            if number and own_model and not self._gains(found, sure):
                break  # the set earns itself by its first effects
            self._take(kind, proposal, found)
        return "", ""

    def _with(self, kind: str) -> Extension:
        """Return the fit of the present model with one more effect."""
        forms = self.forms & {*self.added, kind}
        return extend(self.ground, self.effects, [*self.added, kind], forms=forms, profiles=False)

    def final(self) -> Extension | None:
        """Return the last fit repeated with profile intervals; the last step has its values."""
        if not self.added:
            return None
        found = extend(self.ground, self.effects, self.added, forms=self.forms)
        last = self.drafts.pop()
        residuals = self._residuals(found.effects)
        left, specimens = found.left_out_runs, found.left_out_specimens or found.left_out_runs
        new = replace(last, effects=found.effects, residuals=residuals, left_out=left)
        self.drafts.append(replace(new, left_out_specimens=specimens))
        self.effects = found.effects
        return found

    @property
    def law_is_off(self) -> bool:
        """Return whether the last diagnosis shows an error of the law and prefers no effect."""
        return self.last is not None and self.last.law_off is not None and self.last.explained == NOTHING

    def correct_law(self, named_only: bool) -> bool:
        """Add a correction of the law if left-out training runs are predicted better with it.

        The last diagnosis may also prefer an effect that did not predict better: the correction names no cause then.
        """
        found = self.last
        if found is None or found.law_alone is None or (named_only and found.verdict != "law_off"):
            return False
        off, term = found.law_alone, found.law_alone.term
        if not (term.sure > SURE and term.after < (1.0 - LEAST_GAIN) * term.before):
            return False
        effects = (*self.effects, term.effect)
        residuals = self._residuals(effects)
        if _worsened(self.ground.residuals(self.effects), self.ground.residuals(effects)):
            return False
        size = f"{off.words}, {percent(off.size)} of its torque range"
        if self.law_is_off:
            lead = f"The law itself is off {size}"
        else:
            lead = f"No effect is named for what is left; a law that is changed {size}, predicts better"
        why = (
            f"{lead}: a smooth surface over actuation and deformation corrects it where these runs went, and nowhere "
            f"else. It takes the error on {term.on} from {term.before:.2f} to {term.after:.2f} times the noise."
        )
        whole = [len(run) for run in found.measurement.runs] == [
            len(run) for run in self.ground.measurement.runs
        ]
        left = found.readings.unpack(term.left_out) if whole else self.ground.residuals(effects)
        self.drafts.append(_Draft((LEARNED,), effects, why, residuals, left, left, cause="law", learned=term))
        return True

    def learn(self) -> bool:
        """Add a learned term for what no listed effect explains, if left-out training runs are predicted better."""
        predictor = self._predictor()
        readings = self.ground.readings(self.effects)
        noise = noise_view(
            self.ground.measurement, self.ground.residuals(self.effects), readings.scales, self.ground.groups
        )
        condition = condition_indices(readings.n_runs, [group.runs for group in self.ground.groups])
        alone = len(np.unique(readings.run)) == 1
        folds = assign_blocks(readings) if alone else readings.fold
        found = learn(predictor, readings, noise, condition[readings.run], folds)
        if found is None:
            return False
        effects = (*self.effects, found.effect)
        residuals = self._residuals(effects)
        fall = (
            f"It takes the error on {found.on} from {found.before:.2f} to {found.after:.2f} times the noise."
        )
        why = f"{described(found)[:1].upper() + described(found)[1:]} {fall}"
        left = readings.unpack(found.left_out)
        self.drafts.append(
            _Draft((LEARNED,), effects, why, residuals, left, left, cause="learned", learned=found)
        )
        return True

    def _residuals(self, effects: Sequence[EffectConfig]) -> Residuals:
        """Return the residuals of all runs, test runs too, by the model that is aligned to the training runs."""
        return self.unthinned.residuals(effects, self.measurement)

    def _predictor(self) -> MeasuredModel:
        """Return the present model, driven by the training runs."""
        study = self.study.model_copy(update={"effects": self.effects})
        return measured_model(self.context, study, self.ground.measurement)

    def _diagnose(self) -> Diagnosis:
        study = self.study.model_copy(update={"effects": self.effects})
        predictor = self._predictor()
        own = own_runs(study, predictor)
        self.last = diagnose(predictor, kinds=self.kinds, runs=own, tick=self.tick, workers=self.workers)
        self.mistakes = self.last.bookkeeping if self.mistakes is None else self.mistakes
        return self.last

    def _gains(self, whole: Extension, sure: float) -> bool:
        """Return whether left-out runs improve beyond the uncertainty, and no left-out condition or specimen worsens.

        If only one condition shows an effect, it stays in their fit. `sure`: standard errors of the gain; a step whose
        cause no verdict names is the best of many, and needs more.
        """
        floors, usual = whole.noise.floors, self.ground.readings(self.effects).scales
        scales = {k: floors[k].value if floors[k].value > 0.0 else scale for k, scale in usual.items()}
        conditions = whole.left_out or whole.residuals
        last, specimens = self.drafts[-1], whole.left_out_specimens or whole.left_out_runs
        models = (last.left_out, whole.left_out_runs, conditions, last.left_out_specimens, specimens)
        before, after, unseen, known, other = block_squares(models, scales)
        gain = prediction_gain(before, after)
        no_worse = unseen.sum() < (1.0 + LEAST_GAIN) ** 2 * before.sum()
        no_worse = no_worse and other.sum() < (1.0 + LEAST_GAIN) ** 2 * known.sum()
        return gain.share > 1.0 - (1.0 - LEAST_GAIN) ** 2 and gain.sure > sure and no_worse

    def _take(self, kind: str, proposal: StepProposal, found: Extension) -> None:
        """Put an effect into the model, as it was fitted."""
        self.effects = found.effects
        self.added.append(kind)
        alone = len(self.locked.training.runs) == 1
        on = "blocks of the run that are" if alone else "training runs that are"
        residuals = self._residuals(self.effects)
        why = f"{proposal.why(kind, self.context.registry)} {FALL} {self._seen()}"
        left, specimens = found.left_out_runs, found.left_out_specimens or found.left_out_runs
        group, cause = proposal.stands_for, proposal.cause
        self.drafts.append(
            _Draft((kind,), self.effects, why, residuals, left, specimens, group, cause, on=on)
        )

    def _seen(self) -> str:
        """Return where the model fails on the training runs now."""
        return located(compare(self.ground.measurement, self.ground.predictor.predict(self.effects)))

    def scored(self, stop: str, reason: str, final: Extension | None) -> Improvement:
        """Return errors of all steps over one floor."""
        last, locked = self.drafts[-1], self.locked
        scales = self.unthinned.readings(last.effects).scales
        noise = noise_view(self.measurement, last.residuals, scales, repeat_groups(self.measurement))
        steps: list[Step] = []
        for draft in self.drafts:
            training = score(draft.left_out, noise.floors)
            aside = score(draft.residuals, noise.floors, locked.runs) if locked.runs else training
            share = aside.n / max(score(draft.residuals, noise.floors).n, 1)
            read = {name: noise.floors[name] for name in aside.rmse}
            se = Excess.from_ratio(aside.over_floor, read, noise.n_effective * share).se
            unseen = score(draft.residuals, noise.floors, locked.unseen) if locked.unseen else None
            why = draft.why
            if draft.on:
                change = change_in_words(steps[-1].training, training)
                why = why.replace(FALL, f"It takes the error of {draft.on} left out of the fit {change}.")
            steps.append(
                Step(
                    draft.added,
                    draft.effects,
                    why,
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
        single = "blocks of the one run, left out one after another, rather than of a run not used in any fit"
        several = "runs left out one after another, rather than of runs not used in any fit"
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
            else bands(self.unthinned.predictor, final.posterior, final.scatter),
        )

    def _closing(self, stop: str, reason: str, last: Step, noise: NoiseView) -> str:
        """Return the reason in sentences, by the remaining error: the larger one if training runs show more."""
        left = Excess(last.locked.over_floor, last.locked_se)
        training = Excess.from_ratio(last.training.over_floor, noise.floors, noise.n_effective)
        left = training if left.small and not training.small else left
        small = noise.judged and left.small
        found = self.last
        if reason or found is None:
            return f"{RIGHT.format(left=left)}. {reason}" if small else reason
        if stop in CLOSINGS:
            words = CLOSINGS[stop][0 if small else 1 if np.isfinite(left.ratio) else 2]
            corrected = self.drafts[-1].cause == "law"
            first = words.format(
                left=left,
                gain=left.gain,
                contenders=found.judgement.contenders,
                law=found.judgement.law,
                which="without its correction the error" if corrected else "the error",
            )
        elif stop == "insufficient_data" and self.added:
            first = "These data do not determine whether more is missing."
        else:
            first = found.judgement.sentence
        if stop in ("nothing_missing", "law_off"):
            return first
        if self.drafts[-1].learned is not None:
            found = replace(found, learned=None)  # it is in the model already
        of_verdict = stop != "unknown_effect"  # stated in the closing sentence with the final error
        return " ".join([first, *explanation(found, self.context.registry, of_verdict)])


def _worsened(before: Residuals, after: Residuals) -> bool:
    """Return whether the error of an output rises: a correction at the cost of another output is wrong."""
    for name in before[0]:
        old, new = (np.concatenate([run[name] for run in some]) for some in (before, after))
        there = np.isfinite(old) & np.isfinite(new)
        if np.sum(new[there] ** 2) > (1.0 + MOST_RISE) ** 2 * np.sum(old[there] ** 2):
            return True
    return False


def _still_wrong(last: Step, stop: str) -> list[str]:
    """Return a sentence if the test runs still have an error although the training runs show no more."""
    left = Excess(last.locked.over_floor, last.locked_se)
    if stop != "nothing_missing" or left.small or not np.isfinite(left.ratio):
        return []
    unseen = last.unseen
    where = f" ({unseen.over_floor:.2f} where their condition was in no other run)" if unseen else ""
    return [
        f"On the runs held out the error is still {last.locked.over_floor:.2f} ± {last.locked_se:.2f} times the noise"
        f"{where}: something is missing or wrong that the training runs do not show. Extend the model with "
        "all runs, or measure more conditions."
    ]


def _rises(steps: Sequence[Step]) -> list[str]:
    """Return sentences on steps that raised the error on test runs: reported, never acted upon."""
    return [
        f"With {' + '.join(now.added)} the error on the runs held out rose from {before.locked.over_floor:.2f} to "
        f"{now.locked.over_floor:.2f} times the noise, although it fell on training runs left out: confirm "
        "this step by further runs."
        for before, now in pairwise(steps)
        if now.locked.over_floor > before.locked.over_floor
    ]
