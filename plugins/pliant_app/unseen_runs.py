"""Doubts about added effects, judged by held-out runs, in sentences.

Two models are compared on the same runs block by block (`pliant.diagnosis.unseen`): an effect that does not lower the
error there by more than the uncertainty of that comparison is reported as not supported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pliant.diagnosis.extension import Extension, Ground
from pliant.diagnosis.improvement import LEAST_GAIN
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.readings import score
from pliant.diagnosis.steps import Improvement
from pliant.diagnosis.unseen import SURE, PredictionGain, block_squares, prediction_gain
from pliant.evidence.error_bins import Residuals, run_residuals
from pliant.formatting import listed
from pliant.interfaces.effect import EffectConfig
from pliant_app.open_model import OpenModel
from pliant_app.page_state import Effects

# Relative rise on held-out runs that is reported.
RISE = 0.01
# A fall to this share is reported as one, even if the runs are few.
FALL = 0.9
# Times the noise: effects that leave more do not explain the error, or not alone.
LEFT = 1.2


def aside_gain(
    model: OpenModel, before: Effects, after: Effects, noise: NoiseView
) -> tuple[float, float, PredictionGain] | None:
    """Return two models' errors on the held-out runs, over the floors, and the second's gain; None without runs."""
    floors = _floors(noise)
    if not model.split.runs or not floors:
        return None
    pair = [_aside(model, effects) for effects in (before, after)]
    was, now = (score(residuals, noise.floors).over_floor for residuals in pair)
    return was, now, prediction_gain(*block_squares(pair, floors))


def doubts_aside(
    model: OpenModel, kinds: Sequence[str], before: Effects, after: Effects, noise: NoiseView
) -> list[str]:
    """Return what the held-out runs say against these kinds, which only the second model has."""
    found = aside_gain(model, before, after, noise)
    if found is None or _earns(found[2]):
        return []
    was, now, _ = found
    if now > (1.0 + RISE) * was:
        return [
            f"With {listed(kinds)} the error on the runs held out rises from {was:.2f} to {now:.2f} times the noise: "
            "unseen runs become worse."
        ]
    if now < FALL * was:
        return [
            f"{listed(kinds)}: on the runs held out the error falls from {was:.2f} to {now:.2f} times the noise; "
            "these are too few, or too unlike each other, to be sure of it."
        ]
    return [
        f"{listed(kinds)}: on the runs held out the error goes from {was:.2f} to {now:.2f} times the noise, no fall "
        "of 1 % beyond its uncertainty: unseen runs do not show that it is missing."
    ]


def doubts_by_hand(model: OpenModel, effects: Effects, added: Sequence[str], noise: NoiseView) -> list[str]:
    """Return the doubts about effects set by hand, each against the same model without it."""
    if added and not model.split.runs:
        return [f"No run is held out here, so that only a fit tells whether {listed(added)} is missing."]
    said: list[str] = []
    for kind in added:
        rest = tuple(one for one in effects if one["kind"] != kind)
        said += doubts_aside(model, [kind], rest, effects, noise)
    return said


def doubts_undiagnosed(
    model: OpenModel, effects: Effects, kinds: Sequence[str], noise: NoiseView
) -> list[str]:
    """Return a sentence if these kinds, chosen without a diagnosis, leave an error clearly above the noise."""
    errors = model.errors(model.predicted(effects), noise)
    left = max(errors.fitted, errors.aside or 0.0)
    if not kinds or not left > LEFT:
        return []
    return [
        f"With {listed(kinds)} the error is still {left:.2f} times the noise: something else is missing, beside it or "
        "in its place. 'Diagnose' on the model without it compares all effects."
    ]


def fit_doubts(
    model: OpenModel,
    ground: Ground,
    begun: Sequence[EffectConfig],
    extension: Extension,
    without: Mapping[str, Extension],
) -> list[str]:
    """Return the doubts about effects that were fitted on the training runs.

    Args:
        model: the open model.
        ground: the training runs.
        begun: the effects of the previous model.
        extension: the fit of all kinds.
        without: by kind, the fit of the others; empty for one kind.
    """
    after = tuple(effect.canonical() for effect in extension.effects)
    cases: list[tuple[list[str], Residuals, Effects]] = [
        (
            list(extension.kinds),
            ground.residuals(begun),
            tuple(effect.canonical() for effect in begun),
        )
    ]
    cases += [
        ([kind], other.left_out_runs, tuple(effect.canonical() for effect in other.effects))
        for kind, other in without.items()
    ]
    noise = model.noise(model.predicted(after))
    said: list[str] = []
    for kinds, unseen, before in reversed(
        cases
    ):  # one by one first; all together only if each improves the prediction
        if said and len(kinds) > 1:
            continue
        left_out = _doubt_left_out(extension, kinds, unseen)
        said += left_out
        aside = doubts_aside(model, kinds, before, after, noise)
        said += [one for one in aside if not left_out or "become worse" in one]
    if extension.absent:
        said.append(f"No strength of {listed(extension.absent)} differs from zero in these runs.")
    if not extension.fit.converged:
        said.append("The fit did not converge; its values are less reliable.")
    return said


def step_doubts(model: OpenModel, improvement: Improvement) -> list[str]:
    """Return the doubts about the steps that `pliant improve` took, each against the previous step."""
    if len(improvement.steps) < 2:
        return []
    plain = [tuple(effect.canonical() for effect in step.effects) for step in improvement.steps]
    noise = model.noise(model.predicted(plain[-1]))
    said: list[str] = []
    for step, before, after in zip(improvement.steps[1:], plain[:-1], plain[1:], strict=True):
        said += doubts_aside(model, step.added, before, after, noise) if step.added else []
    return said


def _doubt_left_out(extension: Extension, kinds: Sequence[str], unseen: Residuals) -> list[str]:
    """Return a sentence if runs left out of both fits are not predicted better with these kinds."""
    floors = _floors(extension.noise)
    if not floors or _earns(prediction_gain(*block_squares((unseen, extension.left_out_runs), floors))):
        return []
    was, left = (score(one, extension.noise.floors).over_floor for one in (unseen, extension.left_out_runs))
    return [
        f"{listed(kinds)}: runs left out of the fit are not predicted better beyond chance ({was:.2f} → {left:.2f} "
        "times the noise). A smaller fitted error is what any added number gives; take it out again."
    ]


def _earns(gain: PredictionGain) -> bool:
    """Return whether an effect very probably predicts better, and by the gain that `pliant improve` requires."""
    return gain.sure > SURE and gain.share > 1.0 - (1.0 - LEAST_GAIN) ** 2


def _floors(noise: NoiseView) -> dict[str, float]:
    return {name: floor.value for name, floor in noise.floors.items() if floor.value > 0.0}


def _aside(model: OpenModel, effects: Effects) -> Residuals:
    """Return the residuals on the held-out runs alone."""
    every = run_residuals(model.read, model.predicted(effects))
    return [{name: every[k][name] for name in model.outputs} for k in model.split.runs]
