"""Choice of the next run among all runs that the limits allow: the most expected information per minute.

Candidates are the runs of the default menu and random members of the space, in the present setting and in those that a
person could set. The best one's free numbers are then improved by a small evolution strategy, whose generations are
predicted together. Setting a condition costs time, so that settings are compared by their two best runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from pliant import api
from pliant.diagnosis.catalogue_view import CatalogueView
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.next_run import NextRun, next_runs, seconds_per_reading
from pliant.diagnosis.verdict import named
from pliant.evidence.measured_model import MeasuredModel
from pliant.formatting import number
from pliant.records.measurement import Measurement
from pliant_bench.beliefs import Question, question
from pliant_bench.bench import BenchChannel, BenchProtocol
from pliant_bench.config import ExperimentConfig
from pliant_bench.menu import menu_protocols
from pliant_bench.motions import Move, sampled_path
from pliant_bench.plans import CONDITIONS, VALVE, planned_from_protocol
from pliant_bench.protocol_space import STILL_S, ProtocolSpace, SpaceMember, changed

# Settings with less than this share of the largest information are not chosen for being quick to set.
TELLING = 0.5
# Minutes that every run is charged in the comparison beside its own: longer runs tell more per diagnosis, and a verdict
# on little data is less reliable than its probability says.
PER_ROUND = 1.0
# Levels of the first condition as shares of the range, and the hold at the higher one.
FIRST_LEVELS, FIRST_HOLD_S, FIRST_PACE = (0.35, 0.7), 6.0, 0.5


@dataclass(frozen=True)
class SearchEffort:
    """How many runs are predicted for a choice.

    Attributes:
        random: random members in the present setting.
        elsewhere: random members in each other setting, of which `settings` are tried.
        parents, children, generations: of the evolution strategy.
        sizes: standard deviation of the changes of free numbers in the first and the last generation.
        seed: of the random members.
    """

    random: int = 40
    elsewhere: int = 12
    settings: int = 6
    parents: int = 2
    children: int = 8
    generations: int = 3
    sizes: tuple[float, float] = (0.25, 0.08)
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Choice:
    """The next run.

    Attributes:
        protocol: the run; None if no allowed run would tell anything.
        purpose: decide between explanations, expose what the only one lacks, or repeat a run.
        why: the reason, in a sentence.
        expected_nats: expected information; where the purpose is to expose, if something were missing with even odds.
        minutes: of the run, with setting up and with a person's work.
        splits: whether an allowed run would split the explanations that are left; true where one is left.
        to_set: conditions that a person has to set before the run, SI.
        then: runs that were planned with it because they need the same setting.
    """

    protocol: BenchProtocol | None
    purpose: Literal["decide", "expose", "repeat"]
    why: str
    expected_nats: float = 0.0
    minutes: float = 0.0
    splits: bool = True
    to_set: Mapping[str, float] = field(default_factory=dict)
    then: tuple[BenchProtocol, ...] = ()


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
) -> Choice:
    """Return the allowed run with the most expected information per minute.

    Args:
        opened: the study.
        measurement: all runs so far.
        diagnosis: of these runs.
        settings: the block `experiment`.
        done: protocols of the runs so far; the conditions of the last one are the present setting.
        channels: inputs of the bench; without them those of the study.
        minutes_left: bench time that is left.
        effort: how many runs are predicted.
    """
    space = ProtocolSpace.from_settings(settings, channels)
    last = done[-1].conditions if done else {}
    standing = {name: last.get(name, value) for name, value in settings.standing.items()}
    if diagnosis.verdict == "not_repeatable":
        return _repeated(done, settings, standing)
    search = _Search(
        api.predictor(opened, measurement), diagnosis, space, settings, done, standing, minutes_left
    )
    effort = effort or SearchEffort(seed=len(done))
    asked = question(diagnosis, opened.context.registry)
    choice = search.best(asked, effort)
    if choice is None and asked.purpose == "decide":  # once more, among other random runs
        choice = search.best(asked, replace(effort, random=2 * effort.random, seed=effort.seed + 1000))
    if choice is not None:
        return choice
    if asked.purpose == "decide":
        words = " or ".join(named(kinds) for kinds in asked.belief.contenders)
        why = f"No allowed run would decide between the explanations that are left: {words}."
        return Choice(None, "decide", why, splits=False)
    return Choice(None, "expose", "No allowed run would show a further effect of the list.")


def _repeated(
    done: Sequence[BenchProtocol], settings: ExperimentConfig, standing: Mapping[str, float]
) -> Choice:
    """Return the longest run in the present setting again."""
    here = [one for one in done if all(one.conditions.get(n) == v for n, v in standing.items())] or done
    longest = max(here, key=lambda one: one.duration_s)
    again = replace(longest, name=f"run {len(done) + 1}", new_specimen=False)
    why = "The runs with the same inputs differ by more than noise; a further repeat shows what moves between them."
    return Choice(again, "repeat", why, 0.0, settings.set_up_minutes + again.duration_s / 60.0)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A run that may be chosen; runs of the menu have no free numbers."""

    protocol: BenchProtocol
    member: SpaceMember | None


@dataclass(frozen=True, eq=False)
class _Sequence:
    """The best runs of a setting, and the information of the first and of all."""

    candidates: tuple[_Candidate, ...]
    nats: tuple[float, ...]
    minutes: float
    chosen: tuple[NextRun, ...]

    @property
    def rate(self) -> float:
        """Return the information per minute."""
        return sum(self.nats) / self.minutes


@dataclass(frozen=True, eq=False)
class _Search:
    model: MeasuredModel
    diagnosis: Diagnosis
    space: ProtocolSpace
    settings: ExperimentConfig
    done: Sequence[BenchProtocol]
    standing: Mapping[str, float]
    minutes_left: float

    def best(self, asked: Question, effort: SearchEffort) -> Choice | None:
        """Return the best run; None if none is expected to help."""
        rng = np.random.default_rng(effort.seed)
        others = [one for one in self.space.settings if changed(one, self.standing)]
        order = sorted(others, key=lambda one: changed(one, self.standing))
        found = []
        for setting in (self.standing, *order[: effort.settings]):
            count = effort.random if setting == self.standing else effort.elsewhere
            members = [self.space.random(rng, setting) for _ in range(count)]
            menu = menu_protocols(self.model, self.space, setting)
            candidates = [_Candidate(one, None) for one in menu if not self._was_done(one)]
            candidates += [_Candidate(self.space.protocol(one, ""), one) for one in members]
            one = self._sequence(candidates, asked, 2)
            if one is not None:
                found.append(one)
        if not found:
            return None
        enough = TELLING * max(sum(one.nats) for one in found)
        chosen = max((one for one in found if sum(one.nats) >= enough), key=lambda one: one.rate)
        return self._choice(self._refined(chosen, asked, effort, rng), asked)

    def _was_done(self, protocol: BenchProtocol) -> bool:
        return any(
            one.words == protocol.words and dict(one.conditions) == dict(protocol.conditions)
            for one in self.done
        )

    def _minutes(self, protocol: BenchProtocol) -> float:
        return self.settings.set_up_minutes + protocol.duration_s / 60.0

    def _visits(self, protocol: BenchProtocol) -> float:
        return self.settings.manual_minutes * changed(protocol.conditions, self.standing)

    def _sequence(self, candidates: Sequence[_Candidate], asked: Question, count: int) -> _Sequence | None:
        """Return up to `count` runs, each the best in addition to those before; None if none helps."""
        allowed = [
            one
            for one in candidates
            if self._minutes(one.protocol) + self._visits(one.protocol) <= self.minutes_left
        ]
        if not allowed:
            return None
        left = self.minutes_left - self._visits(allowed[0].protocol) + PER_ROUND * count
        chosen = next_runs(self._view(allowed), asked.belief, count, left)
        if not chosen:
            return None
        runs = tuple(allowed[int(one.name)] for one in chosen)
        nats = tuple(
            next(rated.gain_per_minute * rated.minutes for rated in one.ranked if rated.name == one.name)
            for one in chosen
        )
        minutes = sum(one.minutes for one in chosen) + self._visits(runs[0].protocol)
        return _Sequence(runs, nats, minutes, chosen)

    def _view(self, candidates: Sequence[_Candidate]) -> CatalogueView:
        """Return the model driven through the candidates, which are named by their index."""
        measured = self.model.measurement
        inputs = [channel.name for channel in self.model.inputs]
        body = measured.runs[-1].history.specimen
        runs = []
        for k, one in enumerate(candidates):
            protocol = replace(one.protocol, name=str(k))
            runs.append(planned_from_protocol(protocol, inputs, PER_ROUND + self._minutes(protocol), body))
        scales, independent = self.diagnosis.scales, self.diagnosis.noise.n_effective
        slow = seconds_per_reading(measured, len(scales), independent)
        return CatalogueView.from_predictor(self.model, runs, scales, slow)

    def _refined(
        self, start: _Sequence, asked: Question, effort: SearchEffort, rng: np.random.Generator
    ) -> _Sequence:
        """Return the sequence with its first run improved by changes of its free numbers."""
        best, parents = start, [one for one in start.candidates if one.member is not None]
        for size in np.linspace(*effort.sizes, effort.generations).tolist():
            children = []
            for one in parents[: effort.parents]:
                assert one.member is not None
                numbers = one.member.numbers
                changes = size * rng.standard_normal((effort.children, len(numbers)))
                members = [one.member.with_numbers(numbers + change) for change in changes]
                children += [_Candidate(self.space.protocol(member, ""), member) for member in members]
            if not children:
                return best
            found = self._sequence([*best.candidates, *children], asked, 2)
            if found is None:
                return best
            best = found
            parents = [one for one in best.candidates if one.member is not None] or parents
        return best

    def _choice(self, chosen: _Sequence, asked: Question) -> Choice:
        number_of = len(self.done) + 1
        first, *rest = (
            replace(one.protocol, name=f"run {number_of + k}") for k, one in enumerate(chosen.candidates)
        )
        to_set = {n: v for n, v in first.conditions.items() if n in self.standing and v != self.standing[n]}
        nats, minutes = chosen.nats[0], self._minutes(first) + self._visits(first)
        if asked.purpose == "decide":
            why = chosen.chosen[0].why
            why = f"{why[:1].upper()}{why[1:]}."
        else:
            words = " + ".join(self.diagnosis.explained) or "nothing"
            why = (
                f"If more than {words} is missing, this run shows it best: {number(nats, 2)} nats in "
                f"{number(minutes, 2)} min."
            )
        then = tuple(rest) if to_set else ()
        return Choice(first, asked.purpose, why, nats, minutes, True, to_set, then)
