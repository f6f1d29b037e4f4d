"""The stand-in meta-model, and models over designs that cheat, forget or jump."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, ClassVar, Literal

import numpy as np

from broken import Variants
from pliant.errors import UserError
from pliant.interfaces.meta_model import DesignLaws, FittedMetaModel
from pliant.records.design import Array
from pliant.records.law import Effort, LawRecord
from pliant.records.solved import SolvedDesigns
from pliant.registry.component import Component
from pliant.testing.meta_model_stand_in import (
    StandInLaws,
    StandInMetaModel,
    StandInMetaModelConfig,
)
from pliant.testing.samples import EnergyLaw


class SmallConfig(StandInMetaModelConfig):
    """No settings."""

    kind: Literal["small"] = "small"  # type: ignore[assignment]


class SmallLaws(StandInLaws):
    """Its record names the kind that reads it; `made` is the class of its laws."""

    made: ClassVar[type[EnergyLaw]] = EnergyLaw

    def law(self, values: Array) -> EnergyLaw:
        law: EnergyLaw = _as(self.made, super().law(values))
        return law

    def record(self) -> LawRecord:
        return replace(super().record(), kind="small")


def _as(cls: type[Any], one: Any) -> Any:
    """The same frozen value in another class."""
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
        "broken.meta_model:SmallConfig",
        "broken.meta_model:Small",
        "terms quadratic in the parameters",
    )
)
broken_by = variants.by_part(Small, "laws")


def broken_law(check: str, says: str) -> Callable[[type], type]:
    """Decorator: a law of one design that breaks one check."""

    def register(law: type) -> type:
        members = {"made": law, "__doc__": law.__doc__, "__module__": __name__}
        broken_by(check, says)(type(f"{law.__name__}s", (SmallLaws,), members))
        return law

    return register


@variants.by("predicts_designs_left_out", "% of its range off")
class Swapped(Small):
    """Takes the parameters in another order."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        good = super().fit(designs)
        values = designs.values.copy()
        values[:, 0] = values[::-1, 0]
        swapped = super().fit(replace(designs, values=values)).laws
        return replace(good, laws=swapped)


@variants.by("predicts_three_axes", "% of its range off")
class Uncoupled(Small):
    """Forgets what the other axes do."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        data = tuple(
            replace(one, tau=np.where(np.arange(one.tau.shape[1]) == 0, 2 * one.tau, one.tau))
            if len(one.axes) == 3
            else one
            for one in designs.data
        )
        return super().fit(replace(designs, data=data))


@variants.by("laws_are_of_the_joint", "of the law are")
class AlwaysBends(Small):
    """Says that every joint is driven by a tendon."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        good = super().fit(designs)
        return replace(good, laws=replace(good.laws, actuation_name="tendon_force_n"))  # type: ignore[type-var]


@broken_by("laws_are_stable_in_their_box", "the stiffness of an unseen design falls to")
class NegativeStiffness(SmallLaws):
    """Passive stiffness nearly lost."""

    def law(self, values: Array) -> EnergyLaw:
        law = super().law(values)
        squares = (law.powers[:, 0] == 0) & (law.powers[:, 1:].sum(axis=1) == 2)
        return replace(law, terms=law.terms - 0.9 * np.abs(law.terms) * squares)


@broken_law("slopes_are_derivatives", "dtau_dp is not the slope of tau")
class WrongSlopeLaw(EnergyLaw):
    """∂τ/∂p twice."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        return replace(good, dtau_dp=2 * good.dtau_dp)


@broken_law("laws_create_no_energy", "creates energy")
class CirculatingLaw(EnergyLaw):
    """x drives z and z drives x back."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        if deformation.shape[1] < 3:
            return good
        around = 1e-3 * np.array([[0.0, 0, 1], [0, 0, 0], [-1, 0, 0]])
        return replace(good, tau=good.tau + deformation @ around.T, dtau_du=good.dtau_du + around)


@broken_law("joints_do_not_affect_each_other", "depends on which other joints")
class BatchedLaw(EnergyLaw):
    """Uses the batch's mean."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        return replace(good, tau=good.tau + 1e-4 * deformation.mean())


@broken_by("domain_follows_the_design", "not that to which a design like this is sampled")
class OneBox(SmallLaws):
    """The same range of u for every design."""

    def law(self, values: Array) -> EnergyLaw:
        law = super().law(values)
        return replace(law, domain=replace(law.domain, deformation=np.tile([-1.0, 1.0], (len(law.axes), 1))))


@broken_law("laws_stay_finite_outside_their_domain", "not finite outside the domain")
class RefusingLaw(EnergyLaw):
    """No number outside the box of u."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        outside = np.any(self.domain.excess(actuation, deformation) != 0, axis=1)
        return replace(good, tau=np.where(outside[:, None], np.nan, good.tau))


@broken_by("laws_are_smooth_in_the_parameters", "a jump")
class Rounding(SmallLaws):
    """Gives the law of the nearest grid point."""

    def law(self, values: Array) -> EnergyLaw:
        low, high = self.box.T
        return super().law(low + np.round((values - low) / (high - low) * 3) / 3 * (high - low))


@broken_by("record_gives_the_same_bits", "the record rounds a number")
class SinglePrecision(SmallLaws):
    """Stores 32 bits."""

    def record(self) -> LawRecord:
        good = super().record()
        return replace(good, arrays={**good.arrays, "terms": np.float32(self.terms)})


@variants.by("is_deterministic", "two fits of the same designs differ")
class Bootstraps(Small):
    """A random resample without a seed."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        random = np.random.default_rng()
        data = tuple(replace(one, tau=one.tau + 1e-6 * random.random(one.tau.shape)) for one in designs.data)
        return super().fit(replace(designs, data=data))


@variants.by("check_states_are_not_fitted", "they were fitted")
class SeesEverything(Small):
    """Fits the check states too."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        data = tuple(replace(one, role=np.full(len(one), "fit")) for one in designs.data)
        return super().fit(replace(designs, data=data))


@variants.by("untrusted_states_are_not_fitted", "states in self-contact")
class TrustsAll(Small):
    """Fits states in self-contact."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        data = tuple(replace(one, status=np.full(len(one), "ok")) for one in designs.data)
        return super().fit(replace(designs, data=data))


@broken_by("flags_designs_outside", "not flagged by how far")
class Boundless(SmallLaws):
    """Claims to hold for every design."""

    def excess(self, values: Array) -> Array:
        return np.zeros(len(self.names))


@broken_by("doubt_grows_away_from_solved_designs", "far outside")
class Backwards(SmallLaws):
    """Is surest where nothing was solved."""

    def doubt(self, values: Array) -> Array:
        return 1 / super().doubt(values)


@broken_by("gain_is_a_share", "no shares of the mean squared error")
class Greedy(SmallLaws):
    """Gives its doubt for a gain."""

    def gain(self, candidates: Array, over: Array) -> Array | None:
        return super().doubt(candidates)


@variants.by("says_when_there_are_too_few_designs", "fitted to a single design")
class FitsAnything(Small):
    """Fits one design without a word."""

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        try:
            return super().fit(designs)
        except UserError:
            values = designs.values * np.linspace(0.99, 1.01, 8).reshape(4, 2)
            return super().fit(replace(designs, values=values, data=4 * designs.data))
