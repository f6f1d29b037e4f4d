"""Choice of the next run among all runs that the limits allow, and the first runs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.verdict import named
from pliant.records.measurement import Measurement
from pliant_bench.beliefs import FINAL, Question, exposing, is_poor, question
from pliant_bench.bench import BenchChannel, BenchProtocol
from pliant_bench.choice import Choice, SearchEffort
from pliant_bench.config import ExperimentConfig
from pliant_bench.coverage import COVERED_ALL, Coverage
from pliant_bench.motions import Move, sampled_path
from pliant_bench.plans import CONDITIONS, VALVE
from pliant_bench.protocol_space import STILL_S, ProtocolSpace
from pliant_bench.run_search import RunSearch

# Explanations that are no class are left undecided only after this many runs.
FEWEST_RUNS = 10
NO_FURTHER = "No allowed run would show a further effect of the list."
__all__ = ["Choice", "SearchEffort", "choose_next", "first_runs"]

# Levels of the first condition as shares of the range, and the hold at the higher one.
FIRST_LEVELS, FIRST_HOLD_S, FIRST_PACE = (0.35, 0.7), 6.0, 0.5


def first_runs(
    settings: ExperimentConfig, channels: Sequence[BenchChannel] = ()
) -> tuple[BenchProtocol, ...]:
    """Return repeats of a first condition in the middle of the range, to learn the noise; loads stay at rest.

    Args:
        settings: the block `experiment`.
        channels: inputs of the bench; without them those of the study.
    """
    space = ProtocolSpace.from_settings(settings, channels)
    driven = [axis for axis in space.axes if axis.channel.name not in (*CONDITIONS, VALVE)] or space.axes
    moves = []
    for axis in driven:
        name, rest = axis.channel.name, axis.channel.rest
        for end in (axis.high, axis.low):
            for share, hold_s in zip(FIRST_LEVELS, (0.0, FIRST_HOLD_S), strict=True):
                if end != rest:
                    level = rest + share * (end - rest)
                    moves += [Move({name: level}, FIRST_PACE, hold_s), Move({name: rest}, FIRST_PACE)]
    clock, commands, _ = sampled_path(moves, space.axes, space.period_s, space.longest_s, STILL_S)
    words = "cycles of every input to a third and two thirds of its range"
    return tuple(
        BenchProtocol(f"run {k + 1}", words, clock, commands, dict(space.settings[0]))
        for k in range(settings.first_repeats)
    )


def choose_next(
    opened: api.OpenStudy,
    measurement: Measurement,
    diagnosis: Diagnosis,
    settings: ExperimentConfig,
    done: Sequence[BenchProtocol],
    *,
    channels: Sequence[BenchChannel] = (),
    minutes_left: float = np.inf,
    effort: SearchEffort | None = None,
    coverage: Coverage | None = None,
    met: Collection[str] | None = None,
) -> Choice:
    """Return the allowed run with the most expected information per minute.

    Where a model predicts poorly, where nothing is left to decide, and where no run would decide, the run goes to the
    ends of ranges that no run has reached.

    Args:
        opened: the study.
        measurement: all runs so far.
        diagnosis: of these runs.
        settings: the block `experiment`.
        done: protocols of the runs so far; the conditions of the last one are the present setting.
        channels: inputs of the bench; without them those of the study.
        minutes_left: remaining bench time.
        effort: how many runs are predicted.
        coverage: ends of ranges that no run has reached.
        met: of a stable verdict, the further effects that runs since then would have shown; only a run that shows
            another one, or that adds to the coverage, is then returned.
    """
    space = ProtocolSpace.from_settings(settings, channels)
    last = done[-1].conditions if done else {}
    standing = {name: last.get(name, value) for name, value in settings.standing.items()}
    if diagnosis.verdict == "not_repeatable":
        return _repeated(done, settings, standing)
    search = RunSearch(
        api.predictor(opened, measurement), diagnosis, space, settings, done, standing, minutes_left
    )
    effort = effort or SearchEffort(seed=len(done))
    registry, coverage = opened.context.registry, coverage or COVERED_ALL
    if met is not None:
        excited = {kind for kinds in diagnosis.fits for kind in kinds} - set(diagnosis.not_excited)
        unexcited = exposing(diagnosis, registry, {*met, *excited})
        return _still_to_meet(search, exposing(diagnosis, registry, met), unexcited, effort, coverage)
    asked = question(diagnosis, registry)
    covering = replace(search, coverage=coverage)
    if coverage.missing and (asked.purpose == "expose" or is_poor(diagnosis)):
        choice = covering.best(asked, effort)
        if choice is not None:
            return choice
    choice = search.best(asked, effort)
    if choice is None and asked.purpose == "decide":  # once more, among other random runs
        choice = search.best(asked, replace(effort, random=2 * effort.random, seed=effort.seed + 1000))
    if choice is None and coverage.missing:
        choice = covering.best(asked, effort)
    if choice is not None:
        return choice
    if asked.purpose == "decide":
        is_early = not diagnosis.judgement.selected_class and len(done) < FEWEST_RUNS
        if is_early and (more := search.more_readings(effort)) is not None:
            return more
        words = " or ".join(named(kinds) for kinds in asked.contenders)
        why = f"No allowed run would decide between the explanations that are left: {words}."
        return Choice(None, "decide", why, splits=False)
    if diagnosis.verdict not in FINAL and (more := search.more_readings(effort)) is not None:
        return more
    return Choice(None, "expose", NO_FURTHER)


def _still_to_meet(
    search: RunSearch, asked: Question, unexcited: Question, effort: SearchEffort, coverage: Coverage
) -> Choice:
    """Return a run that a verdict has to meet before the experiment ends; without a protocol where none is left.

    `unexcited` asks about the effects that no run so far excites.
    """
    if coverage.missing:
        choice = replace(search, coverage=coverage).best(asked, effort)
        if choice is not None:
            return choice
    choice = search.best(asked, effort)
    if choice is not None and choice.exposes:
        return choice
    if unexcited.beliefs:
        choice = replace(search, unexcited=True).best(unexcited, effort)
        if choice is not None:
            return choice
    untried = f" No run went to {coverage}: none fits into what is left." if coverage.missing else ""
    return Choice(None, "expose", f"{NO_FURTHER}{untried}")


def _repeated(
    done: Sequence[BenchProtocol], settings: ExperimentConfig, standing: Mapping[str, float]
) -> Choice:
    """Return the longest run in the present setting again."""
    whole = [one for one in done if _ends_as_it_began(one)] or done
    here = [one for one in whole if all(one.conditions.get(n) == v for n, v in standing.items())] or whole
    longest = max(here, key=lambda one: one.duration_s)
    again = replace(longest, name=f"run {len(done) + 1}", new_specimen=False)
    why = "The runs with the same inputs differ by more than noise; a further repeat shows what moves between them."
    return Choice(again, "repeat", why, 0.0, settings.set_up_minutes + again.duration_s / 60.0)


def _ends_as_it_began(protocol: BenchProtocol) -> bool:
    """Return whether a run was not cut short."""
    return all(len(values) and values[0] == values[-1] for values in protocol.commands.values())
