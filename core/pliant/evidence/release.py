"""Released runs: the end moment that deflects a chain at the start of a run and is zero from the next sample on.

A released run (`History.let_go`) begins at rest under a moment m about the main axis for which the bend equals the
stated one, or the first reading; after m is removed the chain oscillates with its own inertia and damping. m depends on
the model and is solved for each by the secant method on the equilibrium of the first sample.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import HistoryBackend
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History, LetGo

# Readings of a bend about the main axis, and whether they are divided by the chain's length.
READ = {"angle_rad": False, "angle_y_rad": False, "curvature_1_per_m": True, "curvature_y_1_per_m": True}
FIRST_N_M = 1e-6
MOST_STEPS, CLOSE_RAD = 20, 1e-9


def first_bend(stated: LetGo, outputs: Mapping[str, Array], length_m: float, run: str) -> float:
    """Return the initial bend of a released run, rad.

    Raises:
        UserError: its first reading of a bend is missing.
    """
    if stated.bend_rad is not None:
        return stated.bend_rad
    for name, over_length in READ.items():
        if name in outputs and np.isfinite(outputs[name][0]):
            return float(outputs[name][0]) * (length_m if over_length else 1.0)
    raise UserError(
        f"run '{run}' was let go, and its first row has no reading of {', '.join(READ)} that says from where; "
        f"write 'let_go: {{{run}: {{bend: 0 deg}}}}'."
    )


def released(
    backend: HistoryBackend, chain: ChainModel, history: History, bend_rad: float, main: int
) -> History:
    """Return the history that begins at rest with this bend, under an end moment until its release.

    Args:
        backend: the engine.
        chain: with the terms of its effects.
        history: the inputs that act on the chain.
        bend_rad: sum of the joints' main coordinates at the first sample.
        main: index of a joint's main coordinate.
    """
    first = history.at_samples(np.array([0]))

    def bend(moment: float) -> float:
        path = backend.follow(chain, [first.with_(moment_n_m=first.moment_n_m + moment)])[0][0]
        return float(path.joint_angles[0, :, main].sum()) if path.converged[0] else np.nan

    before, here = 0.0, FIRST_N_M
    missed, miss = bend(before) - bend_rad, bend(here) - bend_rad
    for _ in range(MOST_STEPS):
        if abs(miss) < CLOSE_RAD or miss == missed or not np.isfinite(miss):
            break
        after = here - miss * (here - before) / (miss - missed)
        before, missed, here = here, miss, after
        miss = bend(here) - bend_rad
        while not np.isfinite(miss) and abs(here - before) > 1e-12:  # too far: halve the step
            here = 0.5 * (here + before)
            miss = bend(here) - bend_rad
    assert history.let_go is not None
    moment, until = history.moment_n_m.copy(), history.let_go.until_s
    moment[0] += here
    if until is not None and history.time_s is not None:
        moment[1:][history.time_s[1:] <= until] += here
    return history.with_(moment_n_m=moment)
