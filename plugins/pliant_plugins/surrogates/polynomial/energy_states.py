"""Which states of several axes are fitted and which are scored; what is wrong with them, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import SELF_CONTACT, TRUSTED, ModuleData
from pliant.records.law import Domain

Mask = NDArray[np.bool_]
# A plane in (p, u_1 … u_k) for each axis, and as much again to judge it by.
MINIMUM_PER_AXIS = 4
HELD_OUT_SHARE = 0.2
HELD_OUT_SEED = 0
CONTRADICTION = 0.1


@dataclass(frozen=True, eq=False)
class AxesSplit:
    """States to fit, states to score, their box, the range of each axis' effort (k,), how they were chosen."""

    fit: ModuleData
    check: ModuleData
    domain: Domain
    ranges: Array
    held_out: str
    excluded: dict[str, int]
    in_contact: int


def split_axes(data: ModuleData) -> AxesSplit:
    """The same rules as for one axis (`states.split`): the box of trusted states of role "fit" bounds the law.

    States of role "check" in the box are scored; data without any hold out a seeded fifth. Raises `UserError`.
    """
    _finite(data)
    good = np.isin(data.status, TRUSTED)
    converged = good | (data.status == SELF_CONTACT)
    _agreeing(data, converged)
    trusted = data.rows(good & (data.role == "fit"))
    _enough(trusted)
    domain = _box(trusted)
    size = np.concatenate([[np.ptp(domain.actuation)], np.ptp(domain.deformation, axis=1)])
    outside = np.any(np.abs(domain.excess(data.actuation, data.deformation)) > 1e-9 * size, axis=1)
    reason = np.where(good, "outside the fitted box", data.status)
    names, counts = np.unique(reason[outside | ~converged], return_counts=True)
    usable = data.rows(converged & ~outside)
    chosen = usable.role == "check"
    held_out = "states of role check"
    if not chosen.any():
        chosen = _hold_out(usable)
        held_out = f"no state has role check: {chosen.sum()} of {len(usable)} held out at random, seed {HELD_OUT_SEED}"
        _enough(usable.rows(~chosen))
    return AxesSplit(
        usable.rows(~chosen),
        usable.rows(chosen),
        domain,
        effort_ranges(usable),
        held_out,
        {str(name): int(count) for name, count in zip(names, counts, strict=True)},
        int(np.sum(usable.status == SELF_CONTACT)),
    )


def effort_ranges(data: ModuleData) -> Array:
    """(k,) max − min of each axis' effort in the states that explore it; in all states where there are none."""
    ranges = []
    for k, axis in enumerate(data.axes):
        own = data.tau[data.explored == axis, k]
        ranges.append(
            float(np.ptp(own)) if len(own) > 1 and np.ptp(own) > 0 else float(np.ptp(data.tau[:, k]))
        )
    return np.array(ranges)


def _box(data: ModuleData) -> Domain:
    u = data.deformation
    return Domain(
        np.array([data.actuation.min(), data.actuation.max()]),
        np.column_stack([u.min(axis=0), u.max(axis=0)]),
    )


def _finite(data: ModuleData) -> None:
    for name, label in (
        ("actuation", data.actuation_name),
        ("deformation", "angle_rad"),
        ("tau", "moment_n_m"),
    ):
        values = getattr(data, name).reshape(len(data), -1)
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            row, k = bad[0]
            of_axis = f" of axis {data.axes[k]}" if values.shape[1] > 1 else ""
            raise UserError(
                f"{label}{of_axis} is {values[row, k]} in state {row + 1}: a state needs a finite number"
            )


def _agreeing(data: ModuleData, converged: Mask) -> None:
    index = np.flatnonzero(converged)
    at = np.column_stack([data.actuation, data.deformation])[index]
    order = np.lexsort(at.T)
    same = np.all(np.diff(at[order], axis=0) == 0, axis=1)
    apart = np.abs(np.diff(data.tau[index][order], axis=0)) > CONTRADICTION * np.ptp(data.tau[index], axis=0)
    for place in np.flatnonzero(same & apart.any(axis=1))[:1]:
        first, second = sorted((index[order[place]], index[order[place + 1]]))
        k = int(np.flatnonzero(apart[place])[0])
        raise UserError(
            f"states {first + 1} and {second + 1} contradict each other: at the same {data.actuation_name} and angles "
            f"one has the moment {data.tau[first, k]:g} N·m about {data.axes[k]}, the other {data.tau[second, k]:g} N·m"
        )


def _hold_out(data: ModuleData) -> Mask:
    """A seeded fifth of the states inside the box."""
    at = np.column_stack([data.actuation, data.deformation])
    inside = np.flatnonzero(np.all((at > at.min(axis=0)) & (at < at.max(axis=0)), axis=1))
    wanted = max(1, round(HELD_OUT_SHARE * len(data)))
    candidates = inside if len(inside) >= wanted else np.arange(len(data))
    chosen = np.zeros(len(data), bool)
    chosen[np.random.default_rng(HELD_OUT_SEED).choice(candidates, wanted, replace=False)] = True
    return chosen


def _enough(data: ModuleData) -> None:
    k = len(data.axes)
    wanted = MINIMUM_PER_AXIS * (k + 1)
    if len(data) < wanted:
        raise UserError(
            f"a law of {k} coupled axes needs at least {wanted} trusted states to fit besides those that score it, and "
            f"there are {len(data)}"
        )
    if np.ptp(data.actuation) == 0:
        raise UserError(
            f"all {len(data)} states have the same {data.actuation_name}: a law of it needs two levels"
        )
    for i, axis in enumerate(data.axes):
        if np.ptp(data.deformation[:, i]) == 0:
            raise UserError(
                f"all {len(data)} states have the same angle about {axis}: a law of it needs two levels"
            )
        if np.ptp(data.tau[:, i]) == 0:
            raise UserError(
                f"all {len(data)} states have the same moment about {axis}: add states that hold its angle"
            )
