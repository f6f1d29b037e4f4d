"""The stand-in meta-model, and models over designs that leak data, lose state or are discontinuous."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, ClassVar, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.law import Effort, LawRecord, ScalarLaw
from pliant.registry.component import Component
from pliant.testing.samples import EnergyLaw
from pliant_designs.meta_model import DesignLaws, FittedMetaModel
from pliant_designs.records import SolvedDesigns
from pliant_designs.stand_in import StandInLaws, StandInMetaModel, StandInMetaModelConfig


class SmallConfig(StandInMetaModelConfig):
    """The config of a meta-model without settings."""

    kind: Literal["small"] = "small"  # type: ignore[assignment]


class SmallLaws(StandInLaws):
    """Laws whose record names the kind that reads it; `made` is the class of its laws."""

    made: ClassVar[type[EnergyLaw]] = EnergyLaw

    def law(self, values: Array) -> EnergyLaw:
        law: EnergyLaw = _as(self.made, super().law(values))
        return law

    def record(self) -> LawRecord:
        return replace(super().record(), kind="small")


def _as(cls: type[Any], one: Any) -> Any:
    """Return the same frozen value as an instance of another class."""
    return cls(**{f.name: getattr(one, f.name) for f in fields(one)})


class Small(StandInMetaModel):
    """Least squares of an energy whose terms are quadratic in the parameters."""

    config: SmallConfig  # type: ignore[assignment]
    laws: ClassVar[type[StandInLaws]] = SmallLaws

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        good = super().fit(designs)
        return replace(good, laws=_as(self.laws, good.laws))

    def load(self, record: LawRecord) -> DesignLaws:
        laws: DesignLaws = _as(self.laws, super().load(record))
        return laws


variants = Variants(
    Component(
        "meta_model",
        "small",
        f"{__name__}:SmallConfig",
        f"{__name__}:Small",
        "terms quadratic in the parameters",
    )
)
broken, broken_laws, broken_law = (variants.row_adder(Small, part) for part in ("", "laws", "laws.made"))


def refitted(check: str, change: Any) -> None:
    """Add a row: the correct fit of data of which fields are changed, design by design."""
    broken(
        check,
        fit=lambda up, self, designs: up(
            replace(designs, data=tuple(replace(one, **change(one)) for one in designs.data))
        ),
    )


def _swapped(up: Any, self: Any, designs: SolvedDesigns) -> FittedMetaModel:
    values = designs.values.copy()
    values[:, 0] = values[::-1, 0]
    return replace(up(designs), laws=up(replace(designs, values=values)).laws)


def _soft(up: Any, self: Any, values: Array) -> EnergyLaw:
    law: EnergyLaw = up(values)
    squares = (law.powers[:, 0] == 0) & (law.powers[:, 1:].sum(axis=1) == 2)
    return replace(law, terms=law.terms - 0.9 * np.abs(law.terms) * squares)


def _circulating(up: Any, self: Any, p: Array, u: Array) -> Effort:
    """Add an effort by which x drives z and z drives x in the opposite sense."""
    good: Effort = up(p, u)
    around = 1e-3 * np.array([[0.0, 0, 1], [0, 0, 0], [-1, 0, 0]])
    if u.shape[1] < 3:
        return good
    return replace(good, tau=good.tau + u @ around.T, dtau_du=good.dtau_du + around)


def _one_box_law(up: Any, self: Any, values: Array) -> EnergyLaw:
    law: EnergyLaw = up(values)
    return replace(law, domain=replace(law.domain, deformation=np.tile([-1.0, 1.0], (len(law.axes), 1))))


def _nan_outside(up: Any, self: Any, p: Array, u: Array) -> Effort:
    outside = np.any(self.domain.excess(p, u) != 0, axis=1)
    return replace(up(p, u), tau=np.where(outside[:, None], np.nan, up(p, u).tau))


def _nearest_law(up: Any, self: Any, values: Array) -> EnergyLaw:
    low, high = self.box.T
    law: EnergyLaw = up(low + np.round((values - low) / (high - low) * 3) / 3 * (high - low))
    return law


def _single_precision(up: Any, self: Any) -> LawRecord:
    return replace(up(), arrays={**up().arrays, "terms": np.float32(self.terms)})


def _blind_to_the_second(up: Any, self: Any, designs: SolvedDesigns) -> Any:
    data = [
        replace(one, actuation=one.actuation.reshape(len(one), -1)[:, 0], actuation_name=one.actuations[0])
        for one in designs.data
    ]
    return up(replace(designs, data=tuple(data)))


def _fitting_anything(up: Any, self: Any, designs: SolvedDesigns) -> Any:
    try:
        return up(designs)
    except UserError:
        values = designs.values * np.linspace(0.99, 1.01, 8).reshape(4, 2)
        return up(replace(designs, values=values, data=4 * designs.data))


def _no_law(p: Any, u: Array, parameters: Array, tau: Array, by_p: Array, by_u: Array) -> None:
    """Write nothing, so that all outputs stay zero."""


broken("predicts_designs_left_out", fit=_swapped)
refitted(
    "predicts_three_axes",
    lambda one: {"tau": one.tau * np.where(np.arange(one.tau.shape[1]) == 0, len(one.axes) // 2 + 1, 1)},
)
broken("carries_several_actuations", several_actuations=True, fit=_blind_to_the_second)
broken(
    "laws_match_the_joint",
    fit=lambda up, self, designs: replace(
        up(designs), laws=replace(up(designs).laws, actuation_name="tendon_force_n")
    ),
)
broken_laws("laws_are_stable_in_their_box", law=_soft)
broken_law(
    "slopes_are_derivatives", evaluate=lambda up, self, p, u: replace(up(p, u), dtau_dp=2 * up(p, u).dtau_dp)
)
broken_law("laws_create_no_energy", evaluate=_circulating)
broken_law("scalar_form_is_the_law", scalar=lambda up, self: ScalarLaw(_no_law, np.zeros(1)))
broken_law(
    "joints_do_not_affect_each_other",
    evaluate=lambda up, self, p, u: replace(up(p, u), tau=up(p, u).tau + 1e-4 * u.mean()),
)
broken_laws("domain_follows_the_design", law=_one_box_law)
broken_law("laws_stay_finite_outside_their_domain", evaluate=_nan_outside)
broken_laws("laws_are_smooth_in_the_parameters", law=_nearest_law)
broken_laws("record_gives_the_same_bits", record=_single_precision)
refitted(
    "is_deterministic", lambda one: {"tau": one.tau + 1e-6 * np.random.default_rng().random(one.tau.shape)}
)
refitted("check_states_are_not_fitted", lambda one: {"role": np.full(len(one), "fit")})
refitted("untrusted_states_are_not_fitted", lambda one: {"status": np.full(len(one), "ok")})
broken_laws("flags_designs_outside", excess=lambda up, self, values: np.zeros(len(self.names)))
broken_laws("doubt_grows_away_from_solved_designs", doubt=lambda up, self, values: 1 / up(values))
broken_laws("gain_is_a_share", gain=lambda up, self, candidates, over: self.doubt(candidates))
broken("says_when_there_are_too_few_designs", fit=_fitting_anything)
