"""A search in words: the answer as a sentence, what limits it, what a reader must be warned of."""

from __future__ import annotations

import math

import numpy as np

from pliant.formatting import percent, unbroken
from pliant.records.search import FoundDesign, Robustness, SearchResult
from pliant.report.document import Warned
from pliant.report.fem_view import LISTED
from pliant.report.search_view import Objective, SearchView

FAR = 0.1  # of the predicted objective: a verified one further off is warned of
OFTEN = 0.2  # of the candidates: more failures are warned of
LATE = 0.9  # of the search: a best design that came later may not be the last


def answer(read: SearchView) -> str:
    """The best design's objective, predicted and verified; or that there is none."""
    result = read.result
    if not result.best:
        broken = int(read.broken.sum())
        return (
            f"No design was found among {count(len(result.history), 'candidate')}: {sum(result.refused.values())} "
            f"refused, {sum(result.failed.values())} failed"
            f"{f', {broken} simulated that break a constraint on metrics' if broken else ''}."
        )
    of = f"of {count(result.evaluations, 'evaluated design')}"
    if read.shape == "contextual":
        values = [float(d.objectives[read.objective.name]) for d in result.best]
        text = (
            f"one design for each of {len(values)} conditions, {read.objective.label} from "
            f"{read.objective.text(min(values))} to {read.objective.text(max(values))}, learned from "
            f"{count(result.evaluations, 'evaluated design')}"
        )
    elif read.shape == "front":
        text = f"a front of {count(len(result.best), 'compromise')} {of}: "
        text += "; ".join(_over_front(read, objective) for objective in read.objectives)
    else:
        first = result.best[0]
        text = f"the best {of}: {read.objective.label} {read.objective.text(first.objectives[read.objective.name])}"
        text += (
            " as the search predicts it"
            if result.verification is not None
            else ", predicted and not verified"
        )
    text += _verified(read)
    return unbroken(text[0].upper() + text[1:] + ".")


def _over_front(read: SearchView, objective: Objective) -> str:
    values = [float(d.objectives[objective.name]) for d in read.result.best]
    return f"{objective.label} {objective.text(min(values))} to {objective.text(max(values))}"


def _verified(read: SearchView) -> str:
    """The verified objective in each engine; the direct FEM is named where there was one."""
    found, name = read.result.verification, read.objective_metric
    if found is None or read.shape not in ("one", "front"):
        return ""
    how = "verified by direct FEM" if found.laws else "checked again"
    values = [
        f"{read.objective.text(m[name])} in {engine}" for engine, m in found.verified.items() if name in m
    ]
    return f"; {how}: {', '.join(values)}" if values else ""


def measure_words(found: Robustness) -> str:
    """The measure in words."""
    if found.measure == "cvar":
        return f"mean of the worst {100 * (1 - found.level):.3g} %"
    return {"mean": "mean", "worst": "worst"}[found.measure]


def points(read: SearchView) -> list[str]:
    """What limits the best design, then what robustness costs."""
    found = [unbroken(sentence) for sentence in read.result.limits]
    if read.result.robustness is not None:
        found.append(price(read))
    return found


def price(read: SearchView) -> str:
    """What robustness costs without deviations, and what it gains with them."""
    found = read.result.robustness
    assert found is not None
    a, b, c, d = (read.objective.text(value) for value in _four(found))
    measure = measure_words(found)
    if read.result.nominal_is_robust:
        return unbroken(
            f"The best nominal design is the most robust one that was found: {d} as the {measure} over "
            f"{count(found.samples, 'scenario')}, {b} where nothing deviates."
        )
    worse = -1.0 if read.objective.maximised else 1.0
    cost = worse * (found.nominal_of_robust - found.nominal_of_nominal)
    gain = worse * (found.robust_of_nominal - found.robust_of_robust)
    size = f"{_size(read, cost)} of {read.objective.label}" if cost > 0 else "nothing"
    change = "improves" if gain > 0 else "does not improve"
    by = f" by {_size(read, gain)}" if gain > 0 else ""
    return unbroken(
        f"Being robust costs {size} where nothing deviates ({a} of the nominal design, {b} of the robust one) and "
        f"{change} the {measure} over {count(found.samples, 'scenario')}{by} ({c} against {d})."
    )


def _four(found: Robustness) -> tuple[float, float, float, float]:
    return found.nominal_of_nominal, found.nominal_of_robust, found.robust_of_nominal, found.robust_of_robust


def _size(read: SearchView, difference: float) -> str:
    return read.objective.unit.text(abs(difference), 3)


def warned(read: SearchView) -> list[Warned]:
    """What the numbers do not say, the gravest first."""
    result, found = read.result, []
    if result.best and result.verification is None:
        found.append(Warned("Nothing was verified: every number rests on the laws that the search used."))
    if result.verification is not None:
        found += _disagreement(read)
        found += [Warned(note) for note in result.verification.notes]
    if (failures := sum(result.failed.values())) > OFTEN * max(result.evaluations, 1):
        text = (
            f"{failures} of {count(result.evaluations, 'evaluation')} failed; good designs may be among them."
        )
        causes = [f"{cause}: {n}" for cause, n in list(result.failed.items())[:LISTED]]
        found.append(Warned(text, tuple(causes)))
    if late(read):
        found.append(
            Warned(
                "The best design came in the last tenth of a search that its budget ended: a longer one may do better."
            )
        )
    if tied := sum(1 for s in result.slopes if s.at_bound):
        verb = "stands on its bound" if tied == 1 else "stand on their bounds"
        found.append(
            Warned(f"{count(tied, 'variable')} of the best design {verb}: a wider range may do better.")
        )
    return found


def late(read: SearchView) -> bool:
    """Whether the best single design came at the end of its search, which only the budget ended."""
    best, result = read.best, read.result
    if best is None or read.shape != "one" or result.stopped != "budget" or not len(read.order()):
        return False
    own = np.flatnonzero(np.asarray(result.history.branch) == best.branch)
    row = int(read.order()[0])
    return len(own) >= 10 and int(np.searchsorted(own, row)) >= LATE * len(own)


def _disagreement(read: SearchView) -> list[Warned]:
    found, name, warnings = read.result.verification, read.objective_metric, []
    assert found is not None
    for engine, metrics in found.verified.items():
        pair = (found.predicted.get(engine, {}).get(name, math.nan), metrics.get(name, math.nan))
        if not np.isfinite(pair).all():
            continue
        off = abs(pair[1] - pair[0]) / max(abs(pair[0]), 1e-12)
        if off > FAR:
            warnings.append(
                Warned(unbroken(f"In {engine} the verified {read.objective.label} is {read.objective.text(pair[1])}, "
                                f"{percent(off)} off the predicted {read.objective.text(pair[0])}."))
            )  # fmt: skip
    return warnings


def stopped_words(result: SearchResult) -> str:
    """Why the search ended."""
    return {
        "budget": "the budget was spent",
        "until": "what was asked for was reached",
        "exhausted": "nothing was left to try",
    }.get(result.stopped, result.stopped)


def found_where(read: SearchView, design: FoundDesign) -> str:
    """Where a design stands in the history, in words."""
    where = "recommended by the optimizer" if design.number < 0 else f"candidate {design.number + 1}"
    if design.first:
        where += f", {read.objective.text(design.first[read.objective.name])} before it was tried again"
    if len(read.result.branches) > 1:
        where += f" of the search {read.branch_names()[design.branch]}"
    return where


def count(number: int, noun: str) -> str:
    """``1 design``, ``1200 designs``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
