"""The choice of a next run, and how much is searched for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pliant_bench.bench import BenchProtocol


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
        exposes: further effects that the run is expected to show if they were missing.
    """

    protocol: BenchProtocol | None
    purpose: Literal["decide", "expose", "repeat"]
    why: str
    expected_nats: float = 0.0
    minutes: float = 0.0
    splits: bool = True
    to_set: Mapping[str, float] = field(default_factory=dict)
    then: tuple[BenchProtocol, ...] = ()
    exposes: tuple[str, ...] = ()
