"""Which states are fitted and which are scored; what is wrong with them is said in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.records.fem import SELF_CONTACT, TRUSTED, FemDataset
from pliant.records.law import Domain

Mask = NDArray[np.bool_]

MINIMUM_STATES = 6
HELD_OUT_SHARE = 0.2
HELD_OUT_SEED = 0
# Repeats of a bench test scatter; a tenth of the range is a mistake.
CONTRADICTION = 0.1


@dataclass(frozen=True, eq=False)
class Split:
    """States to fit, states to score, the law's domain, the range of the effort, how they were chosen.

    `excluded` counts the states that are neither fitted nor scored, `in_contact` those that are fitted or
    scored although convolutions touch there: the law then has the stiffness of a module without contact.
    """

    fit: FemDataset
    check: FemDataset
    domain: Domain
    effort_range: float
    held_out: str
    excluded: dict[str, int]
    in_contact: int


def split(data: FemDataset, law: str = "a polynomial law") -> Split:
    """Check the data, bound the domain by trusted states, choose which states are fitted and which scored.

    The domain is the box of the trusted states of role "fit": it ends where self-contact takes over. Inside it
    states in self-contact are used too, since a corner without data would be extrapolated. States of role
    "check" are scored; data without any hold out a seeded fifth of the states inside the box.
    Raises `UserError` for numbers that are not finite, contradictions and too few states; `law` is its noun.
    """
    _finite(data)
    good = np.isin(data.status, TRUSTED)
    converged = good | (data.status == SELF_CONTACT)
    _agreeing(data, converged)
    trusted = data.rows(good & (data.role == "fit"))
    _enough(trusted, data, law)
    domain = _box(trusted)
    outside = _outside(domain, data)
    usable = data.rows(converged & ~outside)
    reason = np.where(good, "outside the fitted box", data.status)
    names, counts = np.unique(reason[outside | ~converged], return_counts=True)
    excluded = {str(name): int(count) for name, count in zip(names, counts, strict=True)}
    fit, check = usable.rows(usable.role == "fit"), usable.rows(usable.role == "check")
    held_out = "states of role check"
    if len(check) == 0:
        chosen = _hold_out(fit)
        fit, check = fit.rows(~chosen), fit.rows(chosen)
        held_out = (
            f"no state has role check in the domain: {len(check)} of {len(usable)} held out at random, "
            f"seed {HELD_OUT_SEED}"
        )
        _enough(fit, data, law)
    contact = int(np.sum(usable.status == SELF_CONTACT))
    return Split(fit, check, domain, float(np.ptp(usable.moment_n_m)), held_out, excluded, contact)


def _box(data: FemDataset) -> Domain:
    p, u = data.actuation, data.angle_rad
    return Domain(np.array([p.min(), p.max()]), np.array([[u.min(), u.max()]]))


def _outside(domain: Domain, data: FemDataset) -> Mask:
    """States outside the box by more than rounding."""
    excess = np.abs(domain.excess(data.actuation, data.angle_rad[:, None]))
    size = np.array([np.ptp(domain.actuation), np.ptp(domain.deformation[0])])
    return np.any(excess > 1e-9 * size, axis=1)


def _finite(data: FemDataset) -> None:
    for name, label in (
        ("actuation", data.actuation_name),
        ("angle_rad", "angle_rad"),
        ("moment_n_m", "moment_n_m"),
    ):
        bad = np.flatnonzero(~np.isfinite(getattr(data, name)))
        if bad.size:
            value = getattr(data, name)[bad[0]]
            raise UserError(f"{label} is {value} in state {bad[0] + 1}: a state needs a finite number")


def _agreeing(data: FemDataset, trusted: Mask) -> None:
    index = np.flatnonzero(trusted)
    if index.size < 2:
        return
    p, u, moment = data.actuation[index], data.angle_rad[index], data.moment_n_m[index]
    order = np.lexsort((moment, u, p))
    same = (np.diff(p[order]) == 0) & (np.diff(u[order]) == 0)
    apart = np.flatnonzero(same & (np.diff(moment[order]) > CONTRADICTION * np.ptp(moment)))
    if apart.size:
        first, second = sorted((index[order[apart[0]]], index[order[apart[0] + 1]]))
        raise UserError(
            f"states {first + 1} and {second + 1} contradict each other: at {data.actuation_name} = "
            f"{data.actuation[first]:g} and angle_rad = {data.angle_rad[first]:g} one has the moment "
            f"{data.moment_n_m[first]:g} N·m, the other {data.moment_n_m[second]:g} N·m"
        )


def _hold_out(data: FemDataset) -> Mask:
    """Mask of the held-out states; those on the border of the box stay in the fit and span the domain."""
    inside = np.ones(len(data), bool)
    for values in (data.actuation, data.angle_rad):
        inside &= (values > values.min()) & (values < values.max())
    wanted = max(1, round(HELD_OUT_SHARE * len(data)))
    candidates = np.flatnonzero(inside)
    if candidates.size < wanted:
        candidates = np.arange(len(data))
    chosen = np.zeros(len(data), bool)
    chosen[np.random.default_rng(HELD_OUT_SEED).choice(candidates, wanted, replace=False)] = True
    return chosen


def _enough(fit: FemDataset, data: FemDataset, law: str) -> None:
    names, counts = np.unique(data.status[~np.isin(data.status, TRUSTED)], return_counts=True)
    left_out = "".join(
        f"; {n} with status '{name}' are not trusted" for name, n in zip(names, counts, strict=True)
    )
    if len(fit) < MINIMUM_STATES:
        raise UserError(
            f"{law} needs at least {MINIMUM_STATES} states to fit besides those that score it, "
            f"and there are {len(fit)}{left_out}{_let_pass(names)}"
        )
    for values, label in ((fit.actuation, fit.actuation_name), (fit.angle_rad, "angle_rad")):
        if np.ptp(values) == 0:
            raise UserError(
                f"all {len(fit)} states have the same {label} ({values[0]:g}): a law of it needs two levels"
            )
    if np.ptp(fit.moment_n_m) == 0:
        raise UserError(
            f"all {len(fit)} states have the moment {fit.moment_n_m[0]:g} N·m: add states with an external "
            "moment (the constrained branch)"
        )


def _let_pass(statuses: NDArray[np.str_]) -> str:
    """The end of a sentence: how to keep states in which convolutions overlap."""
    if SELF_CONTACT not in statuses:
        return ""
    return "; 'fem.self_contact: pass' keeps states in which convolutions go through each other"
