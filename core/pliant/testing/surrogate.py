"""Checks of a `Surrogate` and of the joint laws that it makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.fem import FemDataset
from pliant.records.law import JointLaw
from pliant.testing.joint_laws import (
    require_exact_slopes,
    require_finite_outside,
    require_joints_apart,
    require_potential,
    require_same_bits,
    stored,
)
from pliant.testing.samples import coupled_law, linear_law, module_table_of, softening_law, table_of
from pliant.testing.suite import CheckSkipped, Subject, Suite, require, require_close, require_refused

suite = Suite("surrogate")


def _data(subject: Subject) -> FemDataset:
    """States of a law with curvature and a little scatter, so that no form fits them exactly."""
    return subject.once("table", lambda: table_of(softening_law(), noise_n_m=2e-5))


def _surrogate(subject: Subject) -> Surrogate:
    """Built from defaults: the example may state a law instead of fitting one."""
    surrogate: Surrogate = subject.build(subject.plain_config)
    return surrogate


def _fitted(subject: Subject) -> FittedLaw:
    return subject.once("fitted", lambda: _surrogate(subject).fit(_data(subject)))


def _points(data: FemDataset) -> tuple[np.ndarray, np.ndarray]:
    """Points inside the data's box."""
    random = np.random.default_rng(11)
    u = data.angle_rad
    return data.actuation.max() * random.random(20), (u.min() + np.ptp(u) * random.random(20))[:, None]


@suite.check("`fit` reproduces what its data say: a linear law to 2 % of the effort's range.")
def fits_a_linear_law(subject: Subject) -> None:
    law = linear_law()
    data = table_of(law)
    fitted = _surrogate(subject).fit(data).law
    p, u = _points(data)
    wanted = law.evaluate(p, u).tau
    require_close(
        fitted.evaluate(p, u).tau,
        wanted,
        "τ (N·m) of a fitted linear law is off: units, scaling, or the moment's sign",
        atol=0.02 * float(np.ptp(data.moment_n_m)),
    )


@suite.check('the report holds the errors on states of role "check", and their number.')
def reports_its_errors_honestly(subject: Subject) -> None:
    fitted, check = _fitted(subject), _data(subject).select("check")
    missed = fitted.law.evaluate(check.actuation, check.angle_rad[:, None]).tau[:, 0] - check.moment_n_m
    report = fitted.report
    require(
        report.n_heldout == len(check),
        f"n_heldout is {report.n_heldout}, there are {len(check)} check states",
    )
    wanted = {
        "rmse": float(np.sqrt(np.mean(missed**2))),
        "worst": float(np.abs(missed).max()),
        "worst_of_range": float(np.abs(missed).max() / np.ptp(_data(subject).moment_n_m)),
        "r2": 1 - float(np.sum(missed**2) / np.sum((check.moment_n_m - check.moment_n_m.mean()) ** 2)),
    }
    for name, value in wanted.items():
        require_close(
            getattr(report, name), value, f"the report's {name} is not that of the check states", rtol=1e-6
        )


@suite.check('the fit does not see states of role "check".')
def check_states_are_not_fitted(subject: Subject) -> None:
    data = _data(subject)
    altered = np.where(data.role == "check", 1.5 * data.moment_n_m + 1e-3, data.moment_n_m)
    law = _surrogate(subject).fit(replace(data, moment_n_m=altered)).law
    p, u = _points(data)
    require(
        np.array_equal(law.evaluate(p, u).tau, _fitted(subject).law.evaluate(p, u).tau),
        "the law changed when only the check states' moments did: they were fitted, or chose the model",
    )


@suite.check("`evaluate` gives the exact slopes ∂τ/∂p and ∂τ/∂u, shapes (n, a) and (n, a, a).")
def slopes_are_derivatives(subject: Subject) -> None:
    for law in _laws(subject):
        require_exact_slopes(law, *_points(_data(subject)), rtol=1e-4)


@suite.check("laws are vectorised: joints evaluated together or one by one give the same.")
def joints_do_not_affect_each_other(subject: Subject) -> None:
    for law in _laws(subject):
        require_joints_apart(law, *_points(_data(subject)))


@suite.check(
    "`load(record)` gives a law that evaluates to the same bits, through JSON and arrays without pickle."
)
def record_gives_the_same_bits(subject: Subject) -> None:
    for law in _laws(subject):
        record = law.record()
        require(
            record.kind == subject.component.kind,
            f"the record's kind is '{record.kind}', so that surrogate '{subject.component.kind}' would not "
            "be asked",
        )
        require_same_bits(law, _surrogate(subject).load(stored(record)), *_points(_data(subject)))


@suite.check("τ = −∂Π/∂u with Π(p, 0) = 0: no simulation can gain energy from the law.")
def effort_derives_from_the_potential(subject: Subject) -> None:
    p, u = _points(_data(subject))
    for law in _laws(subject):
        rest = law.potential(p, np.zeros_like(u))
        require_close(rest, np.zeros(20), "the potential at u = 0 is not zero", atol=1e-15)
        require_potential(law, p, u, rtol=1e-4)


@suite.check("a law knows its domain: the box of its data, and how far outside a point lies.")
def domain_is_the_box_of_the_data(subject: Subject) -> None:
    data = _data(subject).select("fit")
    domain = _fitted(subject).law.domain
    box = [data.actuation.min(), data.actuation.max(), data.angle_rad.min(), data.angle_rad.max()]
    require_close(
        [*domain.actuation, *domain.deformation[0]],
        box,
        "the domain is not the box of the fitted states: extrapolation would not be flagged",
        rtol=1e-6,
    )


@suite.check("laws answer outside their domain with finite numbers; the excess is flagged, not hidden.")
def stays_finite_outside_the_domain(subject: Subject) -> None:
    require_finite_outside(_fitted(subject).law)


@suite.check("data of a stable joint give a stable law: ∂τ/∂u < 0 in the domain.")
def law_is_stable(subject: Subject) -> None:
    slope = _fitted(subject).law.evaluate(*_points(_data(subject))).dtau_du[:, 0, 0]
    require(
        np.all(slope < 0),
        f"∂τ/∂u reaches {slope.max():.3g} N·m/rad where the data fall: sign, or overfitting",
    )


@suite.check("too few states raise `UserError`, which says how many are needed.")
def says_when_there_are_too_few_states(subject: Subject) -> None:
    one = _data(subject).rows(np.arange(len(_data(subject))) == 3)
    require_refused(
        lambda: _surrogate(subject).fit(one),
        "a law was fitted to a single state",
        r"\d",
        "number of states",
    )


@suite.check("slopes may be NaN (data from elsewhere): then values alone are fitted.")
def fits_values_without_slopes(subject: Subject) -> None:
    law = linear_law()
    data = table_of(law)
    blank = np.full(len(data), np.nan)
    fitted = _surrogate(subject).fit(replace(data, dmoment_dp=blank, dmoment_du=blank)).law
    p, u = _points(data)
    require_close(
        fitted.evaluate(p, u).tau,
        law.evaluate(p, u).tau,
        "τ (N·m) is off when the data have no slopes",
        atol=0.02 * float(np.ptp(data.moment_n_m)),
    )


@suite.check("a moment that is not a number raises `UserError`; it is never fitted or dropped in silence.")
def refuses_values_that_are_not_numbers(subject: Subject) -> None:
    data = _data(subject)
    moments = data.moment_n_m.copy()
    moments[5] = np.nan
    require_refused(
        lambda: _surrogate(subject).fit(replace(data, moment_n_m=moments)),
        "a table with a NaN moment was fitted without a word",
    )


@suite.check("the same data give the same law, bit by bit: results are stored under the data's key.")
def is_deterministic(subject: Subject) -> None:
    p, u = _points(_data(subject))
    again = _surrogate(subject).fit(_data(subject)).law
    require(
        np.array_equal(again.evaluate(p, u).tau, _fitted(subject).law.evaluate(p, u).tau),
        "two fits of the same data differ: a random start without a fixed seed",
    )


@suite.check("`stated` gives the law that the config states, or None.")
def stated_law_is_complete(subject: Subject) -> None:
    stated = subject.build().stated()
    if stated is None:
        raise CheckSkipped(f"the example of {subject.component.label} states no law")
    require(isinstance(stated, JointLaw), f"stated() gave {stated!r}, no JointLaw")
    require(
        stated.domain.actuation.shape == (2,), "the stated law has no domain; Domain.unbounded says 'none'"
    )
    require(len(stated.axes) == stated.domain.deformation.shape[0], "the domain does not fit the law's axes")


@suite.check("a surrogate that couples axes finds how one axis turns another, with symmetric slopes.")
def couples_the_axes_of_a_joint(subject: Subject) -> None:
    surrogate = _surrogate(subject)
    if not surrogate.couples:
        raise CheckSkipped(f"{subject.component.label} fits each axis by itself")
    wanted, data = coupled_law(), module_table_of(coupled_law())
    law = surrogate.fit_module(data).law
    p, u = data.actuation[data.role == "check"], data.deformation[data.role == "check"]
    effort, truth = law.evaluate(p, u), wanted.evaluate(p, u)
    require(law.axes == wanted.axes, f"the law's axes are {law.axes}, the data's {wanted.axes}")
    for k, axis in enumerate(wanted.axes):
        require_close(
            effort.tau[:, k],
            truth.tau[:, k],
            f"τ (N·m) about {axis} of a coupled law is off: are states that hold several axes fitted?",
            atol=0.02 * float(np.ptp(data.tau[:, k])),
        )
    require_close(
        effort.dtau_du,
        np.swapaxes(effort.dtau_du, 1, 2),
        "∂τ_i/∂u_j differs from ∂τ_j/∂u_i: the law has no potential and can create energy",
        atol=1e-9,
    )


def _laws(subject: Subject) -> list[JointLaw]:
    """The fitted law, and the stated one if the example states it."""
    stated = subject.build().stated()
    return [_fitted(subject).law, *([stated] if stated is not None else [])]
