"""Unidentifiable directions of a posterior: parameter changes that the data do not constrain, in words."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pliant.diagnosis.posterior import Posterior
from pliant.formatting import display_unit, listed, whole_percent
from pliant.records.design import Array

# A direction is unidentifiable if the data contain less information on it than the prior.
BLIND = 1.0
# Parameters that move along it by at least this share of the largest move belong to it.
PART = 0.3
# Two parameters are entangled from this correlation on.
ENTANGLED = 0.95
# Exponents of a product, or shares of a sum, that differ by at most this factor are called equal.
ALIKE = 1.35


@dataclass(frozen=True)
class BlindDirection:
    """Parameters of which the data constrain only a combination, or nothing.

    Attributes:
        parameters: names ``kind.parameter``.
        move: how each moves along the direction by one posterior standard deviation, in its own unit.
        seen: the data's information on it, in units of the prior's information.
        words: the same in a sentence.
    """

    parameters: tuple[str, ...]
    move: tuple[float, ...]
    seen: float
    words: str


def unidentifiable_directions(posterior: Posterior) -> tuple[BlindDirection, ...]:
    """Return directions with less information than the prior, then pairs of strongly correlated parameters."""
    found = []
    for seen, direction in zip(posterior.seen[0], posterior.seen[1].T, strict=True):
        if seen < BLIND:
            size = np.abs(direction)
            parts = [int(k) for k in np.flatnonzero(size >= PART * size.max())]
            move = direction * posterior.rates / np.sqrt(1.0 + max(seen, 0.0))
            found.append(_direction(posterior, parts, move, float(max(seen, 0.0))))
    stated = [set(one.parameters) for one in found]
    names, sd, correlation = posterior.names, posterior.sd, posterior.correlation
    for a, b in combinations(range(len(names)), 2):
        r = float(correlation[a, b])
        if abs(r) >= ENTANGLED and not any({names[a], names[b]} <= one for one in stated):
            move = np.zeros(len(names))
            move[a], move[b] = sd[a], np.sign(r) * sd[b]
            found.append(_entangled(posterior, (a, b), move, r))
    return tuple(found)


def _direction(posterior: Posterior, parts: list[int], move: Array, seen: float) -> BlindDirection:
    names = tuple(posterior.names[k] for k in parts)
    if len(parts) == 1:
        words = (
            f"The data contain little information on {names[0]}: its estimate is mainly its prior "
            f"({whole_percent(seen / (1.0 + seen))} of the information is from the data)."
        )
    else:
        known = _combination(posterior, parts, move)
        what = f"the {known}" if known else "a combination"
        words = (
            f"Only {what} of {listed(list(names))} is known: {_moves(posterior, parts, move)} reads the same."
        )
    return BlindDirection(names, tuple(float(move[k]) for k in parts), seen, words)


def _entangled(posterior: Posterior, pair: tuple[int, int], move: Array, r: float) -> BlindDirection:
    a, b = pair
    names = (posterior.names[a], posterior.names[b])
    known = _combination(posterior, list(pair), move)
    what = f"their {known} is" if known else "they are"
    sure = "" if known else " together"
    words = (
        f"{names[0]} and {names[1]} can hardly be determined separately (correlation {r:.2f}): "
        f"{what} known better{sure}; {_moves(posterior, list(pair), move)} reads nearly the same."
    )
    spread = move / np.where(posterior.rates == 0.0, 1.0, posterior.rates)
    unit = spread / np.linalg.norm(spread)
    information = np.linalg.inv(posterior.covariance) - np.eye(len(unit))
    seen = float(unit @ information @ unit)
    return BlindDirection(names, (float(move[a]), float(move[b])), max(seen, 0.0), words)


def _combination(posterior: Posterior, parts: list[int], move: Array) -> str:
    """Return a short name of the combination of two parameters that is constant along the move, or an empty text."""
    if len(parts) != 2:
        return ""
    a, b = parts
    declared = [posterior.candidate.parameters[k].declared for k in parts]
    if all(one.neutral == 0.0 and one.prior == "normal" for one in declared):
        if declared[0].unit == declared[1].unit and _alike(move[a], move[b]):
            return "sum" if move[a] * move[b] < 0.0 else "difference"
        return ""
    values = posterior.values
    if values[a] == 0.0 or values[b] == 0.0:
        return ""
    first, second = move[a] / values[a], move[b] / values[b]
    if not _alike(first, second):
        return ""
    return "product" if first * second < 0.0 else "ratio"


def _alike(first: float, second: float) -> bool:
    if first == 0.0 or second == 0.0:
        return False
    return bool(1.0 / ALIKE < abs(first / second) < ALIKE)


def _moves(posterior: Posterior, parts: list[int], move: Array) -> str:
    texts = []
    for k in parts:
        unit = posterior.candidate.parameters[k].declared.unit
        size = display_unit("" if unit == "1" else unit).text(abs(float(move[k])), 2)
        texts.append(f"{posterior.names[k]} {size} {'up' if move[k] * move[parts[0]] > 0 else 'down'}")
    return listed(texts)
