"""Effects at single places: whether one joint is meant or all alike is a question to the readings.

The effects of a user's own model act at all places of their kind alike. Those among the leading ones are tried at each
place alone, too, as hypotheses of their own: first to first order (Rao's score test, 1948), and the best are fitted.
"""

from __future__ import annotations

from pliant.diagnosis.evidence_table import NOTHING, log_evidence
from pliant.diagnosis.excitation import Excitation, applicable, excitations, explained_by
from pliant.diagnosis.search import HypothesisSearch
from pliant.evidence.measured_model import MeasuredModel
from pliant.execution.executors import Executor

# Leading kinds whose places are tried, and how many kinds at single places are fitted.
LEADING, MOST_FITTED = 4, 8


def kinds_at_places(
    search: HypothesisSearch, model: MeasuredModel, executor: Executor
) -> tuple[list[str], dict[str, Excitation]]:
    """Return kinds at single places that may explain more than all places alike, and their excitations.

    Args:
        search: with the fits of all single effects.
        model: names the places of a kind.
        executor: does the simulations.
    """
    evidence = log_evidence(search.table(), search.thresholds)
    singles = sorted((k for k in search.fits if len(k) == 1), key=lambda key: -evidence[key])
    asked: list[str] = []
    for (kind,) in [key for key in singles if model.places_of_kind(key[0])][:LEADING]:
        asked += model.places_of_kind(kind)
    if not asked:
        return [], {}
    nothing = search.fits[NOTHING]
    kinds, _ = applicable(search.registry, search.fitter, asked, executor)
    shown = excitations(search.registry, search.fitter, nothing, kinds, executor)
    gains = {kind: explained_by(nothing.residual, one) for kind, one in shown.items()}
    chosen = sorted(gains, key=lambda kind: -gains[kind])[:MOST_FITTED]
    return chosen, {kind: shown[kind] for kind in chosen}
