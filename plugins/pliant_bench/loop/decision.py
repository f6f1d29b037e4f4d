"""The end of an experiment: a stable verdict, no allowed run that decides, or a spent budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pliant.formatting import listed, plural
from pliant_bench.config import ExperimentConfig

End = Literal["verdict", "class", "budget", "stopped", "bench"]
# Verdicts that name a cause, or that nothing is missing.
FINAL = ("missing_effect", "nothing_missing", "unknown_effect", "law_off")


@dataclass(frozen=True)
class Ended:
    """Why an experiment ended, in a word and in a sentence."""

    why: End
    sentence: str


def conclusion(verdict: Mapping[str, Any]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return what has to hold: the verdict, its effects, and its class."""
    return (
        verdict["verdict"],
        tuple(sorted(verdict.get("selected", ()))),
        tuple(sorted(verdict.get("selected_class", ()))),
    )


def rounds_held(verdicts: Sequence[Mapping[str, Any]]) -> int:
    """Return for how many of the last diagnoses the conclusion has been the same."""
    if not verdicts:
        return 0
    last, held = conclusion(verdicts[-1]), 0
    for verdict in reversed(verdicts):
        if conclusion(verdict) != last:
            break
        held += 1
    return held


def verdict_holds(verdicts: Sequence[Mapping[str, Any]], settings: ExperimentConfig) -> bool:
    """Return whether a cause has been named for as many rounds as the study asks."""
    return bool(verdicts) and rounds_held(verdicts) >= settings.rounds and verdicts[-1]["verdict"] in FINAL


def verdict_ends(verdicts: Sequence[Mapping[str, Any]], why: str) -> Ended:
    """Return the end with a stable verdict; `why` says what no further run would show."""
    return Ended(
        "verdict", f"The verdict has held for {plural(rounds_held(verdicts), 'round')}. {why}".strip()
    )


def budget_spent(runs: int, minutes: float, settings: ExperimentConfig, holds: bool = False) -> Ended | None:
    """Return the end if no further run is in the budget; `holds`: a verdict is stable and has further runs to meet."""
    more = " The verdict has held, and has not met every run that could contradict it." if holds else ""
    if runs >= settings.runs:
        return Ended("budget", f"The budget of {plural(settings.runs, 'run')} is spent.{more}")
    if minutes + settings.set_up_minutes >= settings.minutes:
        return Ended("budget", f"{minutes:.3g} of {settings.minutes:g} min are spent.{more}")
    return None


def nothing_to_tell(undecided: bool, verdict: Mapping[str, Any]) -> Ended:
    """Return the end without a further informative run; `undecided` if several explanations remain."""
    if not undecided:
        return Ended("verdict", "No run within the limits and the budget would show anything further.")
    left = verdict.get("selected_class") or [
        " + ".join(kinds) or "nothing missing" for kinds in verdict.get("credible_set", [])
    ]
    return Ended("class", f"No run within the limits and the budget decides between {listed(list(left))}.")
