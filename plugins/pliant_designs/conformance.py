"""Checks of a `MetaModel`, of the `DesignLaws` that it fits and of the laws that these make."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import SELF_CONTACT
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
from pliant_designs.meta_model import DesignLaws, MetaModel
from pliant_designs.records import SolvedDesigns
from pliant_designs.samples import (
    FIXED,
    NAMES,
    PRESSURE_PA,
    RANGE,
    free_angles,
    grid,
    opposed_sample_law,
    sample_law,
    solved_designs,
    solved_opposed_designs,
    solved_spherical_designs,
    spherical_sample_law,
    unseen_designs,
)

# Largest error on left-out designs, as a share of the effort's range over all of them.
WORST_OF_RANGE = 0.03
PATH_STEPS = 60
# Largest share of the total change in one of 60 steps along a path through the range.
LARGEST_STEP = 0.12
# Allowed difference of a stated range of u from the true one, as a share of its width.
BOX_TOLERANCE = 0.1
MIDDLE, WIDTH = RANGE.mean(axis=1), np.ptp(RANGE, axis=1)


@once
def _laws(subject: Subject) -> DesignLaws:
    laws: DesignLaws = subject.build().fit(solved_designs()).laws
    return laws


@once
def _spherical_or_cause(subject: Subject) -> DesignLaws | str:
    try:
        laws: DesignLaws = subject.build().fit(solved_spherical_designs()).laws
    except UserError as error:
        return str(error)
    return laws


def _spherical(subject: Subject) -> DesignLaws:
    """Return the model of three axes; skip if the kind states that it supports only one axis."""
    laws = _spherical_or_cause(subject)
    if isinstance(laws, str):
        raise CheckSkipped(f"{subject.component.label} does not fit three axes: {laws}")
    return laws


@once
def _few(subject: Subject) -> SolvedDesigns:
    """Return fewer designs, for checks that fit again."""
    return solved_designs((3, max(3, int(np.ceil(subject.build().fewest / 3)))))


def _points(law: JointLaw, count: int = 40) -> tuple[Array, Array]:
    """Return points inside the sampled pressures and the law's own box."""
    random, m = np.random.default_rng(11), len(law.actuations)
    low, high = law.domain.deformation.T
    require(np.all(np.isfinite([low, high])), f"the law's range of u is {low} to {high}: not a box")
    return PRESSURE_PA * random.random(count if m == 1 else (count, m)), low + (high - low) * random.random(
        (count, len(low))
    )


def _each_law(subject: Subject) -> list[JointLaw]:
    """Return the laws of unseen designs, of one axis and, if the kind supports them, of three."""
    models = [_laws(subject)]
    with contextlib.suppress(CheckSkipped):
        models.append(_spherical(subject))
    return [model.law(values) for model in models for values in unseen_designs(3)]


def _require_predicts(laws: DesignLaws, truth_of: Callable[[Array], JointLaw]) -> None:
    errors, taus = [], []
    for values in unseen_designs():
        truth = truth_of(values)
        p, u = _points(truth)
        wanted, got = truth.evaluate(p, u).tau, laws.law(values).evaluate(p, u).tau
        require(got.shape == wanted.shape, f"tau has shape {got.shape}, not {wanted.shape}")
        errors.append(np.abs(got - wanted))
        taus.append(wanted)
    shares = np.concatenate(errors).max(axis=0) / np.ptp(np.concatenate(taus), axis=0)
    require(
        np.all(shares <= WORST_OF_RANGE),
        f"the worst torque of six designs left out is {100 * shares.max():.2g} % of its range off, allowed are "
        f"{100 * WORST_OF_RANGE:g} %: parameters unscaled or in another order, too few terms, or overfitting",
    )


def predicts_designs_left_out(subject: Subject) -> None:
    """laws of designs between solved ones have errors below 3 % of the effort's range, one axis."""
    _require_predicts(_laws(subject), sample_law)


def predicts_three_axes(subject: Subject) -> None:
    """the same on three axes, from whole states; or `UserError` states that the kind supports one axis."""
    _require_predicts(_spherical(subject), spherical_sample_law)


def carries_several_actuations(subject: Subject) -> None:
    """if declared, the kind gives laws of two pressures: errors below 3 %, stable, exact slopes, energy, record."""
    model: MetaModel = subject.build()
    if not model.several_actuations:
        raise CheckSkipped(f"{subject.component.label} makes laws of one actuation")
    designs = solved_opposed_designs()
    laws = model.fit(designs).laws
    law, wanted = laws.law(MIDDLE), designs.data[0].actuation_name
    require(
        law.actuation_name == wanted, f"the law's actuations are {law.actuation_name}, the data's {wanted}"
    )
    _require_predicts(laws, opposed_sample_law)
    again = model.load(stored(laws.record()))
    for values in unseen_designs(2):
        law = laws.law(values)
        p, u = _points(law)
        softest = float(-law.evaluate(p, u).dtau_du.max())
        require(softest > 0, f"the stiffness of an unseen design falls to {softest:.3g} N·m/rad in its box")
        require_exact_slopes(law, p, u, rtol=1e-3)
        require_potential(law, p, u, rtol=1e-3)
        require_joints_apart(law, p, u)
        require_finite_outside(law)
        require_same_bits(law, again.law(values), p, u)


def laws_match_the_joint(subject: Subject) -> None:
    """joint, axes and actuation of the laws are those of the data."""
    cases: list[tuple[DesignLaws, SolvedDesigns]] = [(_laws(subject), solved_designs((2, 2)))]
    with contextlib.suppress(CheckSkipped):
        cases.append((_spherical(subject), solved_spherical_designs((2, 2))))
    for laws, designs in cases:
        got, wanted = (
            (one.joint, tuple(one.axes), one.actuation_name) for one in (laws.law(MIDDLE), designs.data[0])
        )
        require(got == wanted, f"joint, axes and actuation of the law are {got}, of the data {wanted}")


def scalar_form_is_the_law(subject: Subject) -> None:
    """`scalar` of a law gives the same as `evaluate`, values and slopes, or None: engines compile it."""
    for law in _each_law(subject):
        require_same_compiled(law)


def laws_are_stable_in_their_box(subject: Subject) -> None:
    """laws of designs in the range are stable in their own box: −∂τ/∂u is positive definite."""
    for law in [*_each_law(subject), *(_laws(subject).law(corner) for corner in grid((2, 2)))]:
        slopes = law.evaluate(*_points(law, 200)).dtau_du
        softest = float(np.linalg.eigvalsh(-(slopes + np.swapaxes(slopes, 1, 2)) / 2).min())
        require(
            softest > 0,
            f"the stiffness of an unseen design falls to {softest:.3g} N·m/rad in its box, where all solved designs "
            "are stable: coefficients that are each plausible may not be so together",
        )


def slopes_are_derivatives(subject: Subject) -> None:
    """`evaluate` of a law gives the exact slopes, shapes (n, a) and (n, a, a)."""
    for law in _each_law(subject):
        require_exact_slopes(law, *_points(law), rtol=1e-3)


def laws_create_no_energy(subject: Subject) -> None:
    """no law creates energy: ∂τ_i/∂u_j = ∂τ_j/∂u_i and τ = −∂Π/∂u."""
    finding = "∂τ_i/∂u_j is not ∂τ_j/∂u_i: a closed path through the axes creates energy"
    for law in _each_law(subject):
        p, u = _points(law)
        slopes = law.evaluate(p, u).dtau_du
        agree(slopes, np.swapaxes(slopes, 1, 2), finding, rtol=1e-8)
        require_potential(law, p, u, rtol=1e-3)


def joints_do_not_affect_each_other(subject: Subject) -> None:
    """a law is vectorised: joints evaluated together or one by one give the same."""
    for law in _each_law(subject):
        require_joints_apart(law, *_points(law))


def domain_follows_the_design(subject: Subject) -> None:
    """the domain of a law is that of its design: it contains the free branch and follows the data's."""
    finding = "the range of u is not that to which a design like this is sampled: extrapolation would not be flagged"
    for values in unseen_designs():
        truth, domain = sample_law(values), _laws(subject).law(values).domain
        wanted, box = truth.domain.deformation[0], domain.deformation[0]
        agree(domain.actuation, [0.0, PRESSURE_PA], "the range of pressures is not the data's", rtol=1e-6)
        free = free_angles(truth, np.linspace(0, PRESSURE_PA, 7))
        require(
            box[0] <= free.min() and free.max() <= box[1],
            f"the free branch from {free.min():.3g} to {free.max():.3g} rad leaves the domain, {box[0]:.3g} to "
            f"{box[1]:.3g} rad: every simulation would be flagged",
        )
        agree(box, wanted, finding, atol=BOX_TOLERANCE * float(np.ptp(wanted)))


def laws_stay_finite_outside_their_domain(subject: Subject) -> None:
    """laws return finite numbers outside their domain and report the excess."""
    require_finite_outside(_laws(subject).law(MIDDLE))


def laws_are_smooth_in_the_parameters(subject: Subject) -> None:
    """laws change smoothly with the parameters: no jump between neighbouring designs."""
    p, u = _points(sample_law(MIDDLE), 8)
    share = np.linspace(0, 1, PATH_STEPS + 1)[:, None]
    for start, end in ((RANGE[:, 0], RANGE[:, 1]), (RANGE[[0, 1], [0, 1]], RANGE[[0, 1], [1, 0]])):
        path = start + share * (end - start)
        taus = np.stack([_laws(subject).law(values).evaluate(p, u).tau[:, 0] for values in path])
        steps = np.abs(np.diff(taus, axis=0))
        largest = float((steps.max(axis=0) / np.maximum(steps.sum(axis=0), 1e-12)).max())
        require(
            largest <= LARGEST_STEP,
            f"one of {PATH_STEPS} equal steps through the range makes {100 * largest:.3g} % of all change in τ: a "
            "jump, at which gradients and error bars mean nothing",
        )


def record_gives_the_same_bits(subject: Subject) -> None:
    """`load(record)` gives a model whose laws have the same bits, through JSON and arrays."""
    laws, kind = _laws(subject), subject.component.kind
    record = laws.record()
    asked = f"the record's kind is '{record.kind}', so that meta_model '{kind}' would not be asked"
    require(record.kind == kind, asked)
    again: DesignLaws = subject.build().load(stored(record))
    kept = tuple(again.names) == tuple(laws.names) and dict(again.fixed) == dict(laws.fixed)
    lost = "names, box or fixed parameters are lost in the record"
    require(kept and np.array_equal(again.box, laws.box), lost)
    for values in unseen_designs(3):
        law = laws.law(values)
        require_same_bits(law, again.law(values), *_points(law))
    same = np.array_equal(laws.doubt(unseen_designs()), again.doubt(unseen_designs()))
    require(same, "the predictive sd is lost in the record")


@once
def _fitted(subject: Subject, alter: str = "", attempt: int = 1) -> Array:
    """Return τ of unseen designs by a fit of a few, whose states at high pressure and negative u are in self-contact.

    `alter` names states whose efforts are changed: "check" or "untrusted".
    """
    designs, data = _few(subject), []
    for one in designs.data:
        high = (one.branch == "constrained") & (one.actuation > 0.9 * PRESSURE_PA)
        touching = high & (one.deformation[:, 0] < 0)
        rows = {"": np.zeros(len(one), bool), "check": one.role == "check", "untrusted": touching}[alter]
        tau = np.where(rows[:, None], 1.5 * one.tau + 1e-3, one.tau)
        data.append(replace(one, tau=tau, status=np.where(touching, SELF_CONTACT, one.status)))
    laws = subject.build().fit(replace(designs, data=tuple(data))).laws
    each = [laws.law(values) for values in unseen_designs(3)]
    return np.concatenate([law.evaluate(*_points(law)).tau for law in each])


def is_deterministic(subject: Subject) -> None:
    """the same data give the same model, bit by bit: results are stored under the data's key."""
    same = np.array_equal(_fitted(subject), _fitted(subject, attempt=2))
    require(same, "two fits of the same designs differ: a random start without a fixed seed")


def check_states_are_not_fitted(subject: Subject) -> None:
    """the fit does not see states of role "check"."""
    same = np.array_equal(_fitted(subject), _fitted(subject, "check"))
    finding = "the laws changed when only the check states' efforts did: they were fitted, or chose the model"
    require(same, finding)


def untrusted_states_are_not_fitted(subject: Subject) -> None:
    """states whose status is not trusted, such as self-contact, are not fitted."""
    same = np.array_equal(_fitted(subject), _fitted(subject, "untrusted"))
    require(same, "the laws changed when only the efforts of states in self-contact did")


def flags_designs_outside(subject: Subject) -> None:
    """a model states its range, the box of the solved designs, and the distance of a design from it."""
    laws = _laws(subject)
    require(tuple(laws.names) == NAMES, f"the names are {tuple(laws.names)}, of the designs {NAMES}")
    agree(laws.box, RANGE, "the box is not that of the solved designs", rtol=1e-9)
    require(dict(laws.fixed) == FIXED, f"fixed is {dict(laws.fixed)}, of the designs {FIXED}")
    inside = laws.excess(MIDDLE)
    require(np.all(inside == 0), f"a design in the middle of the range is said to be {inside} outside")
    beyond = np.array([-0.3, 0.2]) * WIDTH
    excess = laws.excess(np.array([RANGE[0, 0], RANGE[1, 1]]) + beyond)
    agree(excess, beyond, "a design outside the range is not flagged by how far it is outside", atol=1e-9)


def doubt_grows_away_from_solved_designs(subject: Subject) -> None:
    """`doubt` is positive and finite, and not smaller far from the solved designs than at them."""
    laws, solved = _laws(subject), solved_designs().values
    doubts = laws.doubt(np.concatenate([solved, MIDDLE + np.array([[2.0, 2.0], [-1.5, 2.0]]) * WIDTH]))
    n = len(solved) + 2
    require(doubts.shape == (n,), f"doubt of {n} designs has shape {doubts.shape}")
    positive = bool(np.all(np.isfinite(doubts)) and np.all(doubts > 0))
    require(positive, f"doubt is not positive and finite: {doubts}")
    at, far = float(np.median(doubts[:-2])), float(doubts[-2:].min())
    # The same number everywhere: the model provides no uncertainty.
    less = f"the doubt is {at:.3g} at solved designs and {far:.3g} far outside"
    require(far > at or np.ptp(doubts) == 0, less)


def gain_is_a_share(subject: Subject) -> None:
    """`gain` returns None or a share from 0 to 1 for each candidate."""
    gain = _laws(subject).gain(unseen_designs(5), grid((5, 5)))
    if gain is not None:
        require(np.shape(gain) == (5,), f"the gain of 5 candidates has shape {np.shape(gain)}")
        shares = bool(np.all((gain >= 0) & (gain <= 1)))
        require(shares, f"gains are {np.asarray(gain)}: no shares of the mean squared error")


def says_when_there_are_too_few_designs(subject: Subject) -> None:
    """too few designs raise `UserError` with the number needed."""
    one = solved_designs((2, 2)).rows(np.arange(4) == 1)
    accepted = "a model over two parameters was fitted to a single design"
    require_refused(lambda: subject.build().fit(one), accepted, r"\d", "number of designs")
