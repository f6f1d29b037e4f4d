"""Checks of a `Surrogate` and of the joint laws that it makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.design import Array
from pliant.records.fem import FemDataset
from pliant.records.law import JointLaw
from pliant.testing import CheckSkipped, Subject, agree, once, require, require_refused
from pliant.testing.joint_laws import (
    require_exact_slopes,
    require_finite_outside,
    require_joints_apart,
    require_potential,
    require_same_bits,
    require_same_compiled,
    stored,
)
from pliant.testing.samples import (
    coupled_law,
    linear_law,
    opposed_law,
    opposed_table,
    sample_module_table,
    sample_table,
    softening_law,
)

# States of a nonlinear law with a little scatter, so that no form fits them exactly, and points inside their box.
NOISE_N_M = 2e-5
DATA = sample_table(softening_law(), noise_n_m=NOISE_N_M)
LINEAR = sample_table(linear_law())
_SHARES = np.random.default_rng(11).random((2, 20))
P = DATA.actuation.max() * _SHARES[0]
U = (DATA.angle_rad.min() + np.ptp(DATA.angle_rad) * _SHARES[1])[:, None]
# New states that test a 90 % band, the smallest share that it contains, and its largest width: relative to the
# residuals, or to the effort's range.
NEW, FEWEST_HELD, WIDEST, WIDEST_OF_RANGE = 200, 0.5, 10.0, 0.02


def _surrogate(subject: Subject) -> Surrogate:
    """Return the surrogate built from the example, or from defaults if the example states a law."""
    example: Surrogate = subject.build()
    return example if example.stated() is None else subject.build(subject.plain_config)


@once
def _fitted(subject: Subject) -> FittedLaw:
    return _surrogate(subject).fit(DATA)


def _tau(subject: Subject, data: FemDataset) -> Array:
    """Return τ at the points by a law that is fitted to these data."""
    return _surrogate(subject).fit(data).law.evaluate(P, U).tau


def _laws(subject: Subject) -> list[JointLaw]:
    """Return the fitted law, and the stated one if the example states it."""
    stated = subject.build().stated()
    return [_fitted(subject).law, *([stated] if stated is not None else [])]


def fits_a_linear_law(subject: Subject) -> None:
    """`fit` reproduces its data: a linear law to 2 % of the effort's range."""
    finding = "τ (N·m) of a fitted linear law is off: units, scaling, or the moment's sign"
    wanted, allowed = linear_law().evaluate(P, U).tau, 0.02 * float(np.ptp(LINEAR.moment_n_m))
    agree(_tau(subject, LINEAR), wanted, finding, atol=allowed)


def reports_its_errors_honestly(subject: Subject) -> None:
    """the report contains the errors on states of role "check", and their number."""
    fitted, check = _fitted(subject), DATA.select("check")
    missed = fitted.law.evaluate(check.actuation, check.angle_rad[:, None]).tau[:, 0] - check.moment_n_m
    worst, spread = float(np.abs(missed).max()), np.sum((check.moment_n_m - check.moment_n_m.mean()) ** 2)
    given = fitted.report.n_heldout
    require(given == len(check), f"n_heldout is {given}, there are {len(check)} check states")
    for name, value in (
        ("rmse", float(np.sqrt(np.mean(missed**2)))),
        ("worst", worst),
        ("worst_of_range", worst / float(np.ptp(DATA.moment_n_m))),
        ("r2", 1 - float(np.sum(missed**2) / spread)),
    ):
        finding = f"the report's {name} is not that of the check states"
        agree(getattr(fitted.report, name), value, finding, rtol=1e-6)


def check_states_are_not_fitted(subject: Subject) -> None:
    """the fit does not see states of role "check"."""
    altered = np.where(DATA.role == "check", 1.5 * DATA.moment_n_m + 1e-3, DATA.moment_n_m)
    same = np.array_equal(
        _tau(subject, replace(DATA, moment_n_m=altered)), _fitted(subject).law.evaluate(P, U).tau
    )
    require(
        same, "the law changed when only the check states' moments did: they were fitted, or chose the model"
    )


def slopes_are_derivatives(subject: Subject) -> None:
    """`evaluate` gives the exact slopes ∂τ/∂p and ∂τ/∂u, shapes (n, a) and (n, a, a)."""
    for law in _laws(subject):
        require_exact_slopes(law, P, U, rtol=1e-4)


def scalar_form_is_the_law(subject: Subject) -> None:
    """`scalar` gives the same law as `evaluate`, values and slopes, or None: engines compile it."""
    for law in _laws(subject):
        require_same_compiled(law)


def joints_do_not_affect_each_other(subject: Subject) -> None:
    """laws are vectorised: joints evaluated together or one by one give the same."""
    for law in _laws(subject):
        require_joints_apart(law, P, U)


def record_gives_the_same_bits(subject: Subject) -> None:
    """`load(record)` gives a law that evaluates to the same bits, through JSON and arrays without pickle."""
    own = subject.component.kind
    for law in _laws(subject):
        record = law.record()
        asked = f"the record's kind is '{record.kind}', so that surrogate '{own}' would not be asked"
        require(record.kind == own, asked)
        require_same_bits(law, _surrogate(subject).load(stored(record)), P, U)


def effort_derives_from_the_potential(subject: Subject) -> None:
    """τ = −∂Π/∂u with Π(p, 0) = 0: no simulation can gain energy from the law."""
    for law in _laws(subject):
        agree(
            law.potential(P, np.zeros_like(U)),
            np.zeros(len(P)),
            "the potential at u = 0 is not zero",
            atol=1e-15,
        )
        require_potential(law, P, U, rtol=1e-4)


def domain_is_the_data_box(subject: Subject) -> None:
    """a law states its domain, the box of its data, and the distance of a point from it."""
    fitted, domain = DATA.select("fit"), _fitted(subject).law.domain
    box = [end for values in (fitted.actuation, fitted.angle_rad) for end in (values.min(), values.max())]
    finding = "the domain is not the box of the fitted states: extrapolation would not be flagged"
    agree([*domain.actuation, *domain.deformation[0]], box, finding, rtol=1e-6)


def stays_finite_outside_the_domain(subject: Subject) -> None:
    """laws return finite numbers outside their domain and report the excess."""
    require_finite_outside(_fitted(subject).law)


def error_bar_holds_new_states(subject: Subject) -> None:
    """a law's band, if it has one, is finite, wider for a higher level, kept by the record, of the size of its errors,
    and contains most new states at 90 %.
    """
    law = _fitted(subject).law
    half, wide = (law.band(P, U, level) for level in (0.5, 0.9))
    if half is None or wide is None:
        require(half is wide, "the law has a band at one level and none at another")
        raise CheckSkipped(f"laws of {subject.component.label} state no error")
    require(wide.shape == U.shape, f"the band's half-widths have shape {wide.shape}, not {U.shape}")
    require(np.all(np.isfinite(wide)) and np.all(half >= 0), "half-widths are not finite, or below zero")
    require(np.all(wide >= half), "the band of 90 % is narrower than that of 50 %")
    again = _surrogate(subject).load(stored(law.record())).band(P, U, 0.9)
    require(again is not None and np.array_equal(again, wide), "the band is lost in the record")
    random = np.random.default_rng(3)
    p, u = (
        low + (high - low) * random.random(NEW)
        for low, high in (law.domain.actuation, *law.domain.deformation)
    )
    new = softening_law().evaluate(p, u[:, None]).tau[:, 0] + NOISE_N_M * random.standard_normal(NEW)
    missed = np.abs(law.evaluate(p, u[:, None]).tau[:, 0] - new)
    band = np.asarray(law.band(p, u[:, None], 0.9))[:, 0]
    held = float(np.mean(missed <= band))
    require(held >= FEWEST_HELD, f"the 90 % band holds {100 * held:.0f} % of new states")
    most = max(WIDEST * float(np.quantile(missed, 0.9)), WIDEST_OF_RANGE * float(np.ptp(DATA.moment_n_m)))
    middle = float(np.median(band))
    told = f"the 90 % band is ± {middle:.3g} N·m, 90 % of new states are missed by less than"
    require(middle <= most, f"{told} {np.quantile(missed, 0.9):.3g} N·m")


def law_is_stable(subject: Subject) -> None:
    """data of a stable joint give a stable law: ∂τ/∂u < 0 in the domain."""
    steepest = _fitted(subject).law.evaluate(P, U).dtau_du.max()
    require(steepest < 0, f"∂τ/∂u reaches {steepest:.3g} N·m/rad where the data fall: sign, or overfitting")


def says_when_there_are_too_few_states(subject: Subject) -> None:
    """too few states raise `UserError` with the number needed."""
    one, accepted = DATA.rows(np.arange(len(DATA)) == 3), "a law was fitted to a single state"
    require_refused(lambda: _surrogate(subject).fit(one), accepted, r"\d", "number of states")


def fits_values_without_slopes(subject: Subject) -> None:
    """slopes may be NaN (external data): then only values are fitted."""
    blank = np.full(len(LINEAR), np.nan)
    tau = _tau(subject, replace(LINEAR, dmoment_dp=blank, dmoment_du=blank))
    allowed = 0.02 * float(np.ptp(LINEAR.moment_n_m))
    agree(tau, linear_law().evaluate(P, U).tau, "τ (N·m) is off when the data have no slopes", atol=allowed)


def refuses_values_that_are_not_numbers(subject: Subject) -> None:
    """a moment that is not a number raises `UserError`; it is never fitted or silently dropped."""
    moments = np.where(np.arange(len(DATA)) == 5, np.nan, DATA.moment_n_m)
    accepted = "a table with a NaN moment was fitted without a word"
    require_refused(lambda: _surrogate(subject).fit(replace(DATA, moment_n_m=moments)), accepted)


def is_deterministic(subject: Subject) -> None:
    """the same data give the same law, bit by bit: results are stored under the data's key."""
    same = np.array_equal(_tau(subject, DATA), _fitted(subject).law.evaluate(P, U).tau)
    require(same, "two fits of the same data differ: a random start without a fixed seed")


def stated_law_is_complete(subject: Subject) -> None:
    """`stated` gives the law that the config states, or None."""
    stated = subject.build().stated()
    if stated is None:
        raise CheckSkipped(f"the example of {subject.component.label} states no law")
    require(isinstance(stated, JointLaw), f"stated() gave {stated!r}, no JointLaw")
    domain = stated.domain
    require(domain.actuation.shape == (2,), "the stated law has no domain; Domain.unbounded says 'none'")
    require(len(stated.axes) == domain.deformation.shape[0], "the domain does not fit the law's axes")


def couples_joint_axes(subject: Subject) -> None:
    """a surrogate that couples axes identifies the coupling, with symmetric slopes."""
    surrogate, wanted, data = _surrogate(subject), coupled_law(), sample_module_table(coupled_law())
    if not surrogate.couples:
        raise CheckSkipped(f"{subject.component.label} fits each axis by itself")
    law = surrogate.fit_module(data).law
    p, u = data.actuation[data.role == "check"], data.deformation[data.role == "check"]
    effort, truth = law.evaluate(p, u), wanted.evaluate(p, u)
    require(law.axes == wanted.axes, f"the law's axes are {law.axes}, the data's {wanted.axes}")
    for k, axis in enumerate(wanted.axes):
        finding = f"τ (N·m) about {axis} of a coupled law is off: are states that hold several axes fitted?"
        agree(effort.tau[:, k], truth.tau[:, k], finding, atol=0.02 * float(np.ptp(data.tau[:, k])))
    finding = "∂τ_i/∂u_j differs from ∂τ_j/∂u_i: the law has no potential and can create energy"
    agree(effort.dtau_du, np.swapaxes(effort.dtau_du, 1, 2), finding, atol=1e-9)


def carries_several_actuations(subject: Subject) -> None:
    """a surrogate that declares it gives laws of several pressures: values, slopes by each, an energy, a record."""
    surrogate, data = _surrogate(subject), opposed_table()
    if not surrogate.several_actuations:
        raise CheckSkipped(f"{subject.component.label} fits laws of one actuation")
    law, check = surrogate.fit_module(data).law, data.rows(data.role == "check")
    named = f"the law's actuations are {law.actuation_name}, the data's {data.actuation_name}"
    require(law.actuation_name == data.actuation_name, named)
    p, u = check.actuation, check.deformation
    finding = "τ (N·m) of a law of two pressures is off: are both of them fitted, each with its own slope?"
    allowed = 0.02 * float(np.ptp(data.tau))
    agree(law.evaluate(p, u).tau, opposed_law().evaluate(p, u).tau, finding, atol=allowed)
    require_exact_slopes(law, p, u, rtol=1e-4)
    require_potential(law, p, u, rtol=1e-4)
    require_joints_apart(law, p, u)
    require_finite_outside(law)
    require_same_bits(law, surrogate.load(stored(law.record())), p, u)
