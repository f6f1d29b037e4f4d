"""A robust search begins where the nominal one beside it has ended.

What is best when nothing deviates is mostly good when something does, and costs a fraction of the runs: so the robust
search begins there, and the nominal designs take part in its choice. It can then come to no worse a design than the
nominal one; where it comes to no better one either, that design is the most robust that is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pliant.interfaces.optimizer import Space, Trial
from pliant.records.search import SearchResult
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.run.results import Row

# A tenth of every range: deviations move an optimum by little, while a first guess may be anywhere.
SPREAD = 0.1


def warm_started(nominal: SearchResult | None, problem: SearchProblem, space: Space) -> Space:
    """The space with the best nominal design as its start.

    It stays as it is where there is none, where the study begins `anywhere`, and with contexts, which have one best
    design each.
    """
    if nominal is None or not nominal.best or space.contexts or problem.config.start != "study":
        return space
    values = nominal.best[0].values
    return replace(space, start={one.name: values[one.name] for one in space.variables}, spread=SPREAD)


def untried_nominal(nominal: SearchResult | None, rows: Sequence[Row]) -> list[tuple[int, Trial]]:
    """The best nominal designs that the robust search has not tried itself, with their branches."""
    tried = {(branch, row.context, tuple(sorted(row.values.items()))) for branch, row in rows}
    designs = nominal.best if nominal is not None else ()
    return [
        (one.branch, Trial(-1, one.values, one.context))
        for one in designs
        if (one.branch, one.context, tuple(sorted(one.values.items()))) not in tried
    ]
