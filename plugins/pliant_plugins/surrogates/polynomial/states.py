"""Selection of the states to fit and to score; problems are reported in one sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.records.actuation import split_actuation_names
from pliant.records.design import Array
from pliant.records.fem import SELF_CONTACT, TRUSTED, FemDataset, ModuleData
from pliant.records.law import Domain

Mask = NDArray[np.bool_]
Data = TypeVar("Data", FemDataset, ModuleData)

# Of one axis; of several, a plane in (p, u_1 … u_k) for each, and as much again to judge it by.
MINIMUM_STATES = 6
MINIMUM_PER_AXIS = 4
HELD_OUT_SHARE = 0.2
HELD_OUT_SEED = 0
# Repeats of a bench test scatter; a tenth of the range is a mistake.
CONTRADICTION = 0.1


@dataclass(frozen=True, eq=False)
class Split(Generic[Data]):
    """States to fit, states to score, the law's domain, the range (k,) of each axis' effort, how they were chosen.

    `excluded` counts the states that are neither fitted nor scored, `in_contact` those that are fitted or
    scored although convolutions touch there: the law then has the stiffness of a module without contact.
    """

    fit: Data
    check: Data
    domain: Domain
    ranges: Array
    held_out: str
    excluded: dict[str, int]
    in_contact: int


@dataclass(frozen=True, eq=False)
class _Columns:
    """The columns of a state: `at` (n, m + k) actuation and deformations, `tau` (n, k), and the names of both."""

    at: Array
    tau: Array
    at_names: tuple[str, ...]
    tau_names: tuple[str, ...]

    @staticmethod
    def from_data(data: FemDataset | ModuleData) -> _Columns:
        if isinstance(data, FemDataset):
            at, tau = np.column_stack([data.actuation, data.angle_rad]), data.moment_n_m[:, None]
            return _Columns(
                at, tau, (*split_actuation_names(data.actuation_name), "angle_rad"), ("moment_n_m",)
            )
        about = [f" of axis {axis}" if len(data.axes) > 1 else "" for axis in data.axes]
        return _Columns(
            np.column_stack([data.actuation, data.deformation]),
            data.tau,
            (*data.actuations, *(f"angle_rad{axis}" for axis in about)),
            tuple(f"moment_n_m{axis}" for axis in about),
        )


def split(data: Data, law: str = "a polynomial law") -> Split[Data]:
    """Check the data, bound the domain by trusted states, choose which states are fitted and which scored.

    The domain is the box of the trusted states of role "fit": it ends where self-contact takes over. Inside it
    states in self-contact are used too, since a corner without data would be extrapolated. States of role
    "check" are scored; data without any hold out a seeded fifth of the states inside the box.
    Raises `UserError` for numbers that are not finite, contradictions and too few states; `law` is its noun.
    """
    columns = _Columns.from_data(data)
    _finite(columns)
    good = np.isin(data.status, TRUSTED)
    converged = good | (data.status == SELF_CONTACT)
    _agreeing(columns, np.flatnonzero(converged))
    trusted = good & (data.role == "fit")
    _enough(data, trusted, law)
    box = np.column_stack([columns.at[trusted].min(axis=0), columns.at[trusted].max(axis=0)])
    m = len(split_actuation_names(data.actuation_name))
    domain = Domain(box[0] if m == 1 else box[:m], box[m:])
    # Outside by more than rounding.
    excess = np.abs(domain.excess(columns.at[:, :m], columns.at[:, m:]))
    outside = np.any(excess > 1e-9 * np.ptp(box, axis=1), axis=1)
    reason = np.where(good, "outside the fitted box", data.status)
    names, counts = np.unique(reason[outside | ~converged], return_counts=True)
    usable = data.rows(converged & ~outside)
    chosen = usable.role == "check"
    held_out = "states of role check"
    if not chosen.any():
        chosen = _hold_out(_Columns.from_data(usable).at)
        held_out = (
            f"no state has role check in the domain: {chosen.sum()} of {len(usable)} held out at random, "
            f"seed {HELD_OUT_SEED}"
        )
        _enough(usable, ~chosen, law)
    return Split(
        usable.rows(~chosen),
        usable.rows(chosen),
        domain,
        effort_ranges(usable),
        held_out,
        {str(name): int(count) for name, count in zip(names, counts, strict=True)},
        int(np.sum(usable.status == SELF_CONTACT)),
    )


def effort_ranges(data: FemDataset | ModuleData) -> Array:
    """Return max − min (k,) of each axis' effort in the states that explore it; in all states if no state does."""
    if isinstance(data, FemDataset):
        return np.array([np.ptp(data.moment_n_m)])
    ranges = []
    for k, axis in enumerate(data.axes):
        own = data.tau[data.explored == axis, k]
        ranges.append(np.ptp(own) if len(own) > 1 and np.ptp(own) > 0 else np.ptp(data.tau[:, k]))
    return np.array(ranges, float)


def _finite(columns: _Columns) -> None:
    for values, names in ((columns.at, columns.at_names), (columns.tau, columns.tau_names)):
        for value, name in zip(values.T, names, strict=True):
            for bad in np.flatnonzero(~np.isfinite(value))[:1]:
                raise UserError(f"{name} is {value[bad]} in state {bad + 1}: a state needs a finite number")


def _agreeing(columns: _Columns, index: NDArray[np.int64]) -> None:
    if index.size < 2:
        return
    at, tau = columns.at[index], columns.tau[index]
    order = np.lexsort((tau[:, 0], *at.T[::-1]))
    same = np.all(np.diff(at[order], axis=0) == 0, axis=1)
    apart = np.abs(np.diff(tau[order], axis=0)) > CONTRADICTION * np.ptp(tau, axis=0)
    for place in np.flatnonzero(same & apart.any(axis=1))[:1]:
        first, second = sorted((index[order[place]], index[order[place + 1]]))
        k = int(np.flatnonzero(apart[place])[0])
        where = " and ".join(
            f"{name} = {value:g}" for name, value in zip(columns.at_names, columns.at[first], strict=True)
        )
        raise UserError(
            f"states {first + 1} and {second + 1} contradict each other: at {where} one has the "
            f"{_effort(columns.tau_names[k])} {columns.tau[first, k]:g} N·m, the other {columns.tau[second, k]:g} N·m"
        )


def _effort(name: str) -> str:
    return name.replace("moment_n_m", "moment")


def _hold_out(at: Array) -> Mask:
    """Return a mask of the held-out states; those on the border of the box stay in the fit."""
    inside = np.flatnonzero(np.all((at > at.min(axis=0)) & (at < at.max(axis=0)), axis=1))
    wanted = max(1, round(HELD_OUT_SHARE * len(at)))
    candidates = inside if len(inside) >= wanted else np.arange(len(at))
    chosen = np.zeros(len(at), bool)
    chosen[np.random.default_rng(HELD_OUT_SEED).choice(candidates, wanted, replace=False)] = True
    return chosen


def _enough(data: FemDataset | ModuleData, fitted: Mask, law: str) -> None:
    columns, count = _Columns.from_data(data), int(fitted.sum())
    k = columns.tau.shape[1]
    wanted = MINIMUM_STATES if k == 1 else MINIMUM_PER_AXIS * (k + 1)
    if count < wanted:
        names, counts = np.unique(data.status[~np.isin(data.status, TRUSTED)], return_counts=True)
        left_out = "".join(
            f"; {n} with status '{name}' are not trusted" for name, n in zip(names, counts, strict=True)
        )
        let_pass = (
            "; 'fem.self_contact: pass' keeps states in which walls go through each other, 'solve' lets their "
            "walls hold each other"
        )
        raise UserError(
            f"{law}{f' of {k} coupled axes' if k > 1 else ''} needs at least {wanted} states to fit besides those that "
            f"score it, and there are {count}{left_out}{let_pass if SELF_CONTACT in names else ''}"
        )
    for value, name in zip(columns.at[fitted].T, columns.at_names, strict=True):
        if np.ptp(value) == 0:
            raise UserError(
                f"all {count} states have the same {name} ({value[0]:g}): a law of it needs two levels"
            )
    for value, name in zip(columns.tau[fitted].T, columns.tau_names, strict=True):
        if np.ptp(value) == 0:
            raise UserError(
                f"all {count} states have the {_effort(name)} {value[0]:g} N·m: add states with an external "
                "moment (the constrained branch)"
            )
