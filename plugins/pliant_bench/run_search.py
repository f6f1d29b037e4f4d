"""Search of the run with the most expected information per minute.

Candidates are the runs of the default menu and random members of the space, in the present setting and in those that a
person could set. The best one's free numbers are then improved by a small evolution strategy, whose generations are
predicted together. Setting a condition costs time, so that settings are compared by their two best runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.diagnosis.catalogue_view import CatalogueView, seconds_per_reading
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.next_run import NextRun, next_runs
from pliant.diagnosis.verdict import named
from pliant.evidence.measured_model import MeasuredModel
from pliant_bench.beliefs import SETTLED, Question
from pliant_bench.bench import BenchProtocol
from pliant_bench.choice import Choice, SearchEffort
from pliant_bench.config import ExperimentConfig
from pliant_bench.coverage import COVERED_ALL, Coverage
from pliant_bench.menu import menu_protocols
from pliant_bench.plans import planned_from_protocol
from pliant_bench.protocol_space import ProtocolSpace, SpaceMember, changed

# Settings with less than this share of the largest information are not chosen for being quick to set.
TELLING = 0.5
# A run shows an effect if it is expected to tell this share of the question whether it is missing, at even odds.
SHOWN = 0.5 * math.log(2.0)
# The same for an effect that no run so far excites: without such a run it is never judged.
FIRST_SHOWN = 0.3 * math.log(2.0)
# Minutes that a run is charged in the comparison beside its own, by purpose: a verdict on little data is less reliable
# than its probability says, and a lone explanation should meet a run of many parts before it is believed. A run to the
# ends of ranges is charged as the first.
PER_ROUND = {"decide": 1.0, "expose": 3.0}


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A run that may be chosen; runs of the menu have no free numbers."""

    protocol: BenchProtocol
    member: SpaceMember | None


@dataclass(frozen=True, eq=False)
class _Sequence:
    """The best runs of a setting, with the information of each, the minutes of all, and a reason."""

    candidates: tuple[_Candidate, ...]
    nats: tuple[float, ...]
    minutes: float
    why: str

    @property
    def rate(self) -> float:
        """Return the information per minute."""
        return sum(self.nats) / self.minutes


@dataclass(frozen=True, eq=False)
class RunSearch:
    """The search after the runs `done`, in the setting `standing`, within the minutes that are left.

    With `coverage` only runs that go to its missing ends are searched, in the present setting. With `unexcited` the
    question is about effects that no run so far excites, and only runs that show one of them are searched.
    """

    model: MeasuredModel
    diagnosis: Diagnosis
    space: ProtocolSpace
    settings: ExperimentConfig
    done: Sequence[BenchProtocol]
    standing: Mapping[str, float]
    minutes_left: float
    coverage: Coverage = COVERED_ALL
    unexcited: bool = False

    def best(self, asked: Question, effort: SearchEffort) -> Choice | None:
        """Return the best run; None if none is expected to help."""
        rng = np.random.default_rng(effort.seed)
        others = [one for one in self.space.settings if changed(one, self.standing)]
        order = [] if self.coverage.missing else sorted(others, key=lambda one: changed(one, self.standing))
        found = []
        for setting in (self.standing, *order[: effort.settings]):
            count = effort.random if setting == self.standing else effort.elsewhere
            members = [self._random(rng, setting, asked) for _ in range(count)]
            menu = menu_protocols(self.model, self.space, setting)
            candidates = [_Candidate(one, None) for one in menu if not self._was_done(one)]
            candidates += [_Candidate(self.space.protocol(one, ""), one) for one in members]
            one = self._sequence(self._covering(candidates), asked)
            if one is not None:
                found.append(one)
        if not found:
            return None
        enough = TELLING * max(sum(one.nats) for one in found)
        chosen = max((one for one in found if sum(one.nats) >= enough), key=lambda one: one.rate)
        return self._choice(self._refined(chosen, asked, effort, rng), asked)

    def _random(self, rng: np.random.Generator, setting: Mapping[str, float], asked: Question) -> SpaceMember:
        if self.coverage.missing:
            return self.space.covering(rng, setting, self.coverage.inputs)
        return self.space.random(rng, setting, asked.purpose == "expose")

    def _covering(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Return the candidates that go to the most of the missing ends."""
        ends = [self.coverage.added_by(one.protocol) for one in candidates]
        return [one for one, n in zip(candidates, ends, strict=True) if n == max(ends)]

    def _was_done(self, protocol: BenchProtocol) -> bool:
        return any(
            one.words == protocol.words and dict(one.conditions) == dict(protocol.conditions)
            for one in self.done
        )

    def _is_idle(self, protocol: BenchProtocol) -> bool:
        """Return whether nothing moves, in a setting in which the beginnings of earlier runs were at rest already."""
        still = all(np.ptp(values) == 0.0 for values in protocol.commands.values())
        return still and any(dict(one.conditions) == dict(protocol.conditions) for one in self.done)

    def _minutes(self, protocol: BenchProtocol) -> float:
        return self.settings.set_up_minutes + protocol.duration_s / 60.0

    def _visits(self, protocol: BenchProtocol) -> float:
        return self.settings.manual_minutes * changed(protocol.conditions, self.standing)

    def _sequence(self, candidates: Sequence[_Candidate], asked: Question) -> _Sequence | None:
        """Return the best runs of one setting; None if none helps."""
        allowed = [
            one
            for one in candidates
            if self._minutes(one.protocol) + self._visits(one.protocol) <= self.minutes_left
            and not self._is_idle(one.protocol)
        ]
        if not allowed:
            return None
        purpose = "decide" if self.coverage.missing else asked.purpose
        view = self._view(allowed, PER_ROUND[purpose])
        visits = self._visits(allowed[0].protocol)
        if asked.purpose == "expose":
            return self._most_exposing(allowed, view, asked, visits)
        left = self.minutes_left - visits + 2.0 * PER_ROUND["decide"]
        chosen = next_runs(view, asked.beliefs[0], 2, left)
        if not chosen:
            return self._quickest(allowed, visits) if self.coverage.missing else None
        nats = tuple(_nats(one)[one.name] for one in chosen)
        minutes = sum(one.minutes for one in chosen) + visits
        return _Sequence(tuple(allowed[int(one.name)] for one in chosen), nats, minutes, chosen[0].why)

    def _most_exposing(
        self, allowed: Sequence[_Candidate], view: CatalogueView, asked: Question, visits: float
    ) -> _Sequence | None:
        """Return the run with the most information on all groups of further effects per minute."""
        total: dict[str, float] = {}
        shown = self._shown(view, asked) if self.unexcited else None
        for belief in asked.beliefs:
            for chosen in next_runs(view, belief, 1):
                for name, nats in _nats(chosen).items():
                    if shown is None or name in shown:
                        total[name] = total.get(name, 0.0) + max(nats, 0.0) / len(asked.beliefs)
        if not total:
            return self._quickest(allowed, visits) if self.coverage.missing else None
        minutes = {run.name: run.minutes + visits for run in view.runs}
        best = max(total, key=lambda name: total[name] / minutes[name])
        words = named(self.diagnosis.explained)
        why = (
            f"the explanation so far is {words}; of all allowed runs this one shows best what else is missing"
        )
        return _Sequence((allowed[int(best)],), (total[best],), minutes[best], why)

    def _quickest(self, allowed: Sequence[_Candidate], visits: float) -> _Sequence:
        """Return the shortest run, where all tell nothing about the explanations that are left."""
        first = min(allowed, key=lambda one: one.protocol.duration_s)
        return _Sequence((first,), (0.0,), self._minutes(first.protocol) + visits, "")

    def more_readings(self, effort: SearchEffort) -> Choice | None:
        """Return a rich run in the present setting, for more readings; None where none fits into the budget."""
        rng = np.random.default_rng([effort.seed, 1])
        protocol = self.space.protocol(
            self.space.random(rng, self.standing, True), f"run {len(self.done) + 1}"
        )
        minutes = self._minutes(protocol)
        if minutes > self.minutes_left or len(self.done) >= self.settings.runs:
            return None
        why = "No verdict is reached yet, and no run is expected to tell more than others: more readings are needed."
        return Choice(protocol, "expose", why, 0.0, minutes)

    def _view(self, candidates: Sequence[_Candidate], per_round: float) -> CatalogueView:
        """Return the model driven through the candidates, which are named by their index."""
        measured = self.model.measurement
        inputs = [channel.name for channel in self.model.inputs]
        body = measured.runs[-1].history.specimen
        runs = []
        for k, one in enumerate(candidates):
            protocol = replace(one.protocol, name=str(k))
            runs.append(planned_from_protocol(protocol, inputs, per_round + self._minutes(protocol), body))
        scales, independent = self.diagnosis.scales, self.diagnosis.noise.n_effective
        slow = seconds_per_reading(measured, len(scales), independent)
        view = CatalogueView.from_predictor(self.model, runs, scales, slow)
        return view.with_law_error(self.diagnosis.law)

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
            found = self._sequence(self._covering([*best.candidates, *children]), asked)
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
        then = tuple(rest) if to_set else ()
        why, shown = self._why(chosen.why), self._exposed(chosen.candidates[0], asked)
        return Choice(first, asked.purpose, why, nats, minutes, True, to_set, then, shown)

    def _why(self, reason: str) -> str:
        sentence = f"{reason[:1].upper()}{reason[1:]}." if reason else ""
        if not self.coverage.missing:
            return sentence
        untried = (
            f"No run has taken {self.coverage} yet, and a model that is right elsewhere may be wrong there."
        )
        return f"{untried} {sentence}".strip()

    def _exposed(self, candidate: _Candidate, asked: Question) -> tuple[str, ...]:
        """Return the further effects that the run is expected to show, each added to the explanation."""
        if asked.purpose != "expose":
            return ()
        return tuple(self._shown(self._view([candidate], 0.0), asked).get("0", ()))

    def _shown(self, view: CatalogueView, asked: Question) -> dict[str, list[str]]:
        """Return the further effects that the runs are expected to show, by the names of those that show any."""
        base = self.diagnosis.explained
        least = FIRST_SHOWN if self.unexcited else SHOWN
        shown: dict[str, list[str]] = {}
        for belief in asked.beliefs:
            for kinds in belief.contenders:
                further = [kind for kind in kinds if kind not in base]
                if not further:
                    continue
                alone = replace(belief, probability={base: SETTLED, kinds: 1.0 - SETTLED})
                for chosen in next_runs(view, alone, 1):
                    for name, nats in _nats(chosen).items():
                        if nats >= least:
                            shown.setdefault(name, []).extend(further)
        return shown


def _nats(chosen: NextRun) -> dict[str, float]:
    """Return the expected information of every candidate, in addition to the runs chosen before, by its name."""
    return {one.name: one.gain_per_minute * one.minutes for one in chosen.ranked}
