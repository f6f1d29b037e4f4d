"""The next run if no listed effect explains the error of a user's own model: one that shows where the error comes from.

No hypothesis predicts such a run, so that no expected information ranks the menu. The covariate on which the error
depends most says what to vary alone: one input with the others at rest, its rate, its direction, or time.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from pliant.diagnosis.next_run import NextRun
from pliant.experiments.planned_run import PlannedRun

# Beginning of a covariate's name → the run of `system_catalogue` that varies it alone, and what it shows.
VARIED = (
    ("rate_", "fast_cycles", "the same cycles at another rate show whether the error grows with the speed"),
    ("hold_s", "holds", "a held input shows whether the error fades with time"),
    ("clock_s", "holds", "a held input shows whether the error fades with time"),
    ("direction", "small_loops", "reversals at several levels show whether the error is friction or play"),
    ("past_", "small_loops", "small loops after large ones show what the system remembers"),
)
USUAL = "slow_cycles", "slow cycles leave out what depends on the speed"


def isolating_run(
    runs: tuple[PlannedRun, ...], depends_on: Mapping[str, float], done: Collection[int] = ()
) -> NextRun | None:
    """Return the run of a menu that varies alone what the error depends on; None if all of it was done.

    Args:
        runs: the menu.
        depends_on: share of the error by covariate, the most important first; pairs are joined by " × ".
        done: indices of the runs that were done.
    """
    left = {run.name: run for k, run in enumerate(runs) if k not in done}
    for covariate in [part for name in depends_on for part in name.split(" × ")]:
        name, why = f"only_{covariate}", f"it shows how much of the error comes from {covariate} alone"
        if name not in left:
            name, why = next(((n, w) for start, n, w in VARIED if covariate.startswith(start)), ("", ""))
        if name in left:
            return _asked(left[name], why)
    name, why = USUAL
    if name in left:
        return _asked(left[name], why)
    return _asked(next(iter(left.values())), "it was not recorded yet") if left else None


def _asked(run: PlannedRun, why: str) -> NextRun:
    return NextRun(
        run.words, f"no listed effect explains the error, and {why}", (), run.minutes, run.name, planned=run
    )
