"""The evidence table: every hypothesis that was fitted, and how well it explains the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.fitting import Fit
from pliant.diagnosis.noise import NoiseView
from pliant.records.design import Array

Kinds = tuple[str, ...]
NOTHING: Kinds = ()
UNKNOWN: Kinds = ("unknown",)
# Rise of the error on conditions left out that is still rounding and noise.
UNSEEN_RISE = 1.03


@dataclass(frozen=True)
class Row:
    """One hypothesis.

    Attributes:
        kinds: its effects, sorted by name; empty for "nothing is missing".
        n_parameters: fitted numbers.
        mean_square: S, the mean squared residual in units of the floor's square.
        squares: the same by condition, repeats together.
        heldout_square: the same with each run left out of its own fit.
        unseen_square: the same with each condition left out, all its repeats together.
        unseen: sums of squares of each condition left out; nan where a parameter is not known without it.
        at_limit: names of parameters that ended on a bound.
    """

    kinds: Kinds
    n_parameters: int
    mean_square: float
    squares: tuple[float, ...]
    heldout_square: float
    unseen_square: float
    unseen: tuple[float, ...]
    at_limit: tuple[str, ...]


@dataclass(frozen=True)
class EvidenceTable:
    """All rows, the noise that they are weighed against, and the conditions' shares of the readings: 1 in all."""

    rows: Mapping[Kinds, Row]
    noise: NoiseView
    n_readings: int
    shares: tuple[float, ...]

    @property
    def nothing(self) -> Row:
        """The row of the model as it is."""
        return self.rows[NOTHING]

    @property
    def n_candidates(self) -> int:
        """Effects that were fitted by themselves."""
        return sum(len(kinds) == 1 for kinds in self.rows)

    def over_floor(self, square: float) -> float:
        """Root of a mean square over the noise floor; nan where the floor is not known or the data have no noise."""
        floor = self.noise.floor_square
        return float(np.sqrt(square / floor)) if floor > LEAST_SQUARE else np.nan


@dataclass(frozen=True)
class Prices:
    """What a hypothesis must pay before it is believed; calibrated on simulated nulls with model error.

    Attributes:
        effect: log-odds that each further effect costs, beside the ½ ln n_eff of each parameter (Schwarz 1978).
        unknown: log-odds of "an effect outside the list", which may reach the noise floor with any form.
        form: share of what a hypothesis explains that may be left over because its equation is an idealisation:
            a further effect must explain more than that.
        form_unknown: that share beside an effect outside the list, which could have any form.
        temper: log-evidence is divided by this: forms and noise models are never quite right.
        believed: probability above which the first hypothesis is the verdict.
        slip: between / within scatter from which runs do not repeat.
        fewest: n_eff below which no verdict is given.
        excited: change in σ below which an effect cannot be judged: the model's own law may be off by as much, so
            that an effect is paid only for what it explains beyond that.
    """

    effect: float = 4.5
    unknown: float = 30.0
    form: float = 0.03
    form_unknown: float = 0.08
    temper: float = 2.0
    believed: float = 0.9
    slip: float = 1.5
    fewest: float = 12.0
    excited: float = 0.3


PRICES = Prices()
# Mean squares below this, a thousandth of the scales, are those of data without noise.
LEAST_SQUARE = 1e-6


def log_evidence(table: EvidenceTable, prices: Prices) -> dict[Kinds, float]:
    """ln P(data | hypothesis) + ln prior of each row, up to a constant, and of `UNKNOWN` where it can be judged.

    −½ n_eff Σ_c w_c ln S*_c − ½ k ln n_eff − price · effects over the conditions c, which hold the shares w_c of the
    readings. S*_c is the mean squared residual of the condition and an allowance that is the same for all hypotheses
    with as many effects: what a law that is slightly off may explain by itself, and what equations that are slightly
    off leave where they explain most, of these hypotheses and of the simpler ones. Errors of form are alike within a
    condition: weighed condition by condition, one in which they are large does not drown the others.
    """
    n = max(table.noise.n_effective, 2.0)
    found = {}
    for kinds, row in table.rows.items():
        squares = np.maximum(row.squares, LEAST_SQUARE) + _allowance(table, len(kinds), prices)
        found[kinds] = (
            _log_likelihood(table, squares) - 0.5 * row.n_parameters * np.log(n) - prices.effect * len(kinds)
        )
    if table.noise.judged:
        best = max(found, key=lambda kinds: found[kinds])
        reach = table.noise.floor_square + prices.excited**2 + prices.form_unknown * _explained(table, best)
        found[UNKNOWN] = _log_likelihood(table, reach) - prices.unknown
    return found


def probabilities(evidence: Mapping[Kinds, float], temper: float) -> dict[Kinds, float]:
    """Normalised exp(evidence / temper), the largest first."""
    top = max(evidence.values())
    weights = {kinds: float(np.exp((value - top) / temper)) for kinds, value in evidence.items()}
    total = sum(weights.values())
    ordered = sorted(weights.items(), key=lambda item: (-item[1], len(item[0]), item[0]))
    return {kinds: weight / total for kinds, weight in ordered}


def credible_set(found: Mapping[Kinds, float], share: float = 0.9) -> tuple[Kinds, ...]:
    """The most probable hypotheses that hold `share` together."""
    chosen: list[Kinds] = []
    total = 0.0
    for kinds, probability in found.items():
        chosen.append(kinds)
        total += probability
        if total >= share:
            break
    return tuple(chosen)


def predicts_unseen(table: EvidenceTable, kinds: Kinds) -> bool:
    """Whether every effect of a set lowers the error on runs that its fit has not seen, and raises it on no
    conditions left out. An effect that one condition alone shows says nothing about that condition.
    """
    row = table.rows[kinds]
    simpler = [tuple(kind for kind in kinds if kind != left) for left in kinds]
    others = [table.rows[part] for part in simpler if part in table.rows]
    return all(row.heldout_square < other.heldout_square and _no_worse_unseen(row, other) for other in others)


def _no_worse_unseen(row: Row, other: Row) -> bool:
    mine, theirs = np.array(row.unseen), np.array(other.unseen)
    both = np.isfinite(mine) & np.isfinite(theirs)
    return bool(mine[both].sum() <= UNSEEN_RISE * theirs[both].sum())


def room_above_floor(table: EvidenceTable, kinds: Kinds, prices: Prices) -> bool:
    """Whether a further effect could pay its price if it reached the noise floor."""
    now = np.maximum(table.rows[kinds].squares, LEAST_SQUARE) + _allowance(table, len(kinds), prices)
    floor = table.noise.floor_square if np.isfinite(table.noise.floor_square) else 0.0
    left = prices.excited**2 + prices.form * (_explained(table, kinds) + _explained_by(table, len(kinds)))
    gain = _log_likelihood(table, np.maximum(floor + left, 1e-12)) - _log_likelihood(table, now)
    return bool(gain > prices.effect + 0.5 * np.log(max(table.noise.n_effective, 2.0)))


def sorted_kinds(kinds: Sequence[str]) -> Kinds:
    """Kinds in one order, so that a pair has one name."""
    return tuple(sorted(kinds))


def at_limit(fit: Fit) -> tuple[str, ...]:
    """Parameters of a fit that ended on a bound."""
    return tuple(knob.name for knob, there in zip(fit.candidate.knobs, fit.at_limit, strict=True) if there)


def _log_likelihood(table: EvidenceTable, squares: Array) -> float:
    """−½ n_eff Σ_c w_c ln S_c; minus infinity where one is infinite."""
    return float(
        -0.5 * max(table.noise.n_effective, 2.0) * np.sum(np.asarray(table.shares) * np.log(squares))
    )


def _explained(table: EvidenceTable, kinds: Kinds) -> Array:
    """(c,) mean squares that a hypothesis takes off the model as it is, by condition."""
    taken = np.asarray(table.nothing.squares) - np.asarray(table.rows[kinds].squares)
    return np.maximum(np.nan_to_num(taken, neginf=0.0), 0.0)


def _explained_by(table: EvidenceTable, size: int) -> Array:
    """(c,) the same, of the best hypothesis with so many effects; 0 where there is none."""
    of_size = [kinds for kinds in table.rows if len(kinds) == size]
    if not size or not of_size:
        return np.zeros(len(table.shares))
    return _explained(table, min(of_size, key=lambda kinds: table.rows[kinds].mean_square))


def _allowance(table: EvidenceTable, size: int, prices: Prices) -> Array:
    """(c,) what a law and equations that are slightly off may leave: no merit of any effect."""
    if not size:
        return np.zeros(len(table.shares))
    return prices.excited**2 + prices.form * (_explained_by(table, size) + _explained_by(table, size - 1))
