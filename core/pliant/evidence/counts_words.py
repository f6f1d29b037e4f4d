"""A comparison of counts in sentences, and as the JSON object of `pliant compare`."""

from __future__ import annotations

from typing import Any

from pliant.evidence.counts import ConditionResult, CountComparison
from pliant.formatting import number, whole_percent

OUTPUT = "success"
NAMED = 4


def interpret_counts(found: CountComparison) -> str:
    """What the comparison says, the bench's own contradictions first."""
    sentences = []
    if found.contradictory:
        sentences.append(_contradiction(found))
    if found.disagreeing:
        sentences.append(_disagreement(found))
    else:
        sentences.append(
            "No condition differs from the model by more than chance; with "
            f"{_trials(found)} simulated trials each, smaller differences would not show."
        )
    if found.log_likelihood < found.log_likelihood_own:
        sentences.append(
            "Over all conditions the model predicts these counts worse than one that says nothing about any of them."
        )
    return " ".join(sentences)


def counted(count: tuple[int, int]) -> str:
    """``29/30``."""
    return f"{count[0]}/{count[1]}"


def counts_json(found: CountComparison) -> dict[str, Any]:
    """The contract's keys (`outputs.success`, `runs`, `worst`, `n_samples`), and what belongs to counts."""
    return {
        "outputs": {
            OUTPUT: {
                "rmse": found.rmse,
                "unit": "1",
                "noise_floor": found.noise_floor,
                "floor_source": "binomial",
                "ratio_to_floor": found.ratio_to_floor,
                "bias": found.bias,
                "log_likelihood": found.log_likelihood,
                "deviance": found.deviance,
                "n": found.n_samples,
                "n_effective": found.n_effective,
            }
        },
        "rmse_over_floor": found.ratio_to_floor,
        "log_likelihood": found.log_likelihood,
        "log_likelihood_own": found.log_likelihood_own,
        "deviance": found.deviance,
        "interpretation": interpret_counts(found),
        "judged": True,
        "runs": [
            {
                "run": one.name,
                "words": result.condition.words,
                "successes": one.successes,
                "trials": one.trials,
                "line": one.line,
            }
            for result in found.conditions
            for one in result.condition.sets
        ],
        "conditions": [_condition(one) for one in found.conditions],
        "worst": [
            {
                "condition": one.condition.words,
                "share_of_error": one.share_of_error,
                "z": one.z,
                "output": OUTPUT,
                "significant": one.disagrees,
            }
            for one in sorted(found.conditions, key=lambda one: -one.deviance)
            if one.deviance > 0
        ],
        "repeats": {
            "conditions": found.n_repeated,
            "overdispersion": found.overdispersion,
            "p_overdispersion": found.p_overdispersion,
            "contradictory": [one.condition.words for one in found.contradictory],
        },
        "n_samples": found.n_samples,
        "n_effective": found.n_effective,
        "remarks": list(found.remarks),
    }


def _condition(one: ConditionResult) -> dict[str, Any]:
    return {
        "condition": one.condition.words,
        "set": dict(one.condition.changes),
        "successes": one.measured[0],
        "trials": one.measured[1],
        "interval": list(one.interval),
        "simulated_successes": one.simulated[0],
        "simulated_trials": one.simulated[1],
        "log_likelihood": one.log_likelihood,
        "deviance": one.deviance,
        "log_bayes_factor": one.log_bayes_factor,
        "p": one.p,
        "p_adjusted": one.p_adjusted,
        "z": one.z,
        "share_of_error": one.share_of_error,
        "disagrees": one.disagrees,
        "p_repeats": one.p_repeats,
        "p_repeats_adjusted": one.p_repeats_adjusted,
        "contradictory": one.contradictory,
    }


def _contradiction(found: CountComparison) -> str:
    first = found.contradictory[0]
    sets = " and ".join(counted((one.successes, one.trials)) for one in first.condition.sets[:NAMED])
    more = len(found.contradictory) - 1
    others = f" (and {more} more conditions)" if more else ""
    return (
        f"The repeats contradict each other: {first.condition.words} gave {sets}{others}, more than chance allows. "
        "Find out what differed between the sets before believing anything about the model."
    )


def _disagreement(found: CountComparison) -> str:
    worst = found.disagreeing[0]
    n, of = len(found.disagreeing), f"of {len(found.conditions)}"
    which = f"{n} {of} conditions differ" if n > 1 else f"One {of} conditions differs"
    return (
        f"{which} from the model by more than chance. Most: {worst.condition.words}, measured "
        f"{counted(worst.measured)}, simulated {counted(worst.simulated)} "
        f"({whole_percent(worst.share_of_error)} of the deviance, z {number(worst.z, 2)})."
    )


def _trials(found: CountComparison) -> int:
    return min(one.simulated[1] for one in found.conditions)
