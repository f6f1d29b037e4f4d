"""A compiled form that differs from the law is refused where an engine first uses it, with the difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from pliant.errors import ContractError
from pliant.mechanics.scalar_form import evaluate_scalar, require_scalar_form
from pliant.mechanics.shared_elasticity import SharedElasticity
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointLaw, LawRecord, ScalarLaw
from pliant.testing.samples import sample_chain
from pliant_plugins.physics.compiled.laws import CompiledLaws

GAIN, STIFFNESS = 1.6e-6, 0.03


def line(p: float, u: Array, parameters: Array, tau: Array, by_p: Array, by_u: Array) -> None:
    tau[0] = parameters[2] * (parameters[0] * p - parameters[1] * u[0])
    by_p[0] = parameters[0]
    by_u[0, 0] = -parameters[1]


@dataclass(frozen=True, eq=False)
class Line(JointLaw):
    """The law τ = g p − k u, whose scalar form gives `factor` times τ."""

    factor: float
    domain = Domain(np.array([0.0, 15e3]), np.array([[0.0, 0.5]]))
    joint = "revolute"
    axes = ("y",)
    actuation_name = "pressure_pa"

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        ones = np.ones((len(deformation), 1))
        tau = GAIN * actuation[:, None] - STIFFNESS * deformation
        return Effort(tau, GAIN * ones, -STIFFNESS * ones[:, :, None])

    def scalar(self) -> ScalarLaw:
        return ScalarLaw(line, np.array([GAIN, STIFFNESS, self.factor]))

    def record(self) -> LawRecord:
        raise NotImplementedError


class NotSeenBefore(Line):
    """A class of laws not yet compared in this process; laws of a class are compared once."""


def test_the_sentence_names_the_law_and_the_largest_difference() -> None:
    with pytest.raises(
        ContractError, match=r"law .*test_scalar_form.Line is not the law: tau is .*% of the largest"
    ):
        require_scalar_form(Line(1.05))


def test_the_named_difference_is_that_in_the_named_state() -> None:
    with pytest.raises(ContractError) as refused:
        require_scalar_form(Line(1.05))
    text = str(refused.value)
    wrong, right = (
        float(text.split("tau is ")[1].split()[0]),
        float(text.split("'scalar' and ")[1].split()[0]),
    )
    p = float(text.split("pressure_pa = ")[1].split(",")[0])
    u = float(text.split("u = ")[1].split(". ")[0])
    assert wrong == pytest.approx(1.05 * right, rel=1e-4)
    assert right == pytest.approx(GAIN * p - STIFFNESS * u, rel=1e-2)


def test_a_form_that_is_the_law_passes_shared_or_not() -> None:
    require_scalar_form(Line(1.0), again=True)
    require_scalar_form(SharedElasticity(Line(1.0), 2), again=True)


def test_the_rest_share_is_subtracted() -> None:
    shared = SharedElasticity(Line(1.0), 2)  # τ = g p − k u/2 of each of two
    p, u = np.array([0.0, 7e3]), np.array([[0.2], [0.3]])
    effort = evaluate_scalar(shared.scalar(), p, u)  # type: ignore[arg-type]
    assert effort.tau[:, 0] == pytest.approx(GAIN * p - STIFFNESS * u[:, 0] / 2, rel=1e-12)


def test_an_engine_refuses_it_where_it_takes_the_law() -> None:
    chain = sample_chain()
    wrong: Any = chain.with_(laws=(NotSeenBefore(1.05),) * len(chain.laws))
    with pytest.raises(ContractError, match="is not the law"):
        CompiledLaws.from_chain(wrong)
