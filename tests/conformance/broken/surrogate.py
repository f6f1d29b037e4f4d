"""A good linear law by least squares, and fits that cheat, forget or break."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from broken import Variants
from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw, Surrogate, SurrogateConfig
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import Domain, Effort, FitReport, JointLaw, LawRecord
from pliant.registry.component import Component
from pliant.testing.samples import LinearLaw


class LineConfig(SurrogateConfig):
    """A stated slope is optional."""

    kind: Literal["small"] = "small"
    stated_gain: float | None = None


@dataclass(frozen=True, eq=False)
class LineLaw(JointLaw):
    """τ = c + g p − k u."""

    terms: Array
    domain: Domain
    joint = "revolute"
    axes: tuple[str, ...] = ("y",)
    actuation_name: str = "pressure_pa"

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        c, g, k = self.terms
        ones = np.ones((len(deformation), 1))
        return Effort(c + g * actuation[:, None] - k * deformation, g * ones, -k * ones[:, :, None])

    def record(self) -> LawRecord:
        box = {"actuation": self.domain.actuation, "deformation": self.domain.deformation}
        values = {"axes": list(self.axes), "actuation_name": self.actuation_name}
        return LawRecord("small", values, {"terms": self.terms, **box})


class Line(Surrogate):
    """Least squares of c, g and k in the moments."""

    config: LineConfig

    def stated(self) -> JointLaw | None:
        gain = self.config.stated_gain
        return None if gain is None else LineLaw(np.array([0.0, gain, 0.04]), Domain.unbounded(1))

    def fit(self, data: FemDataset) -> FittedLaw:
        rows = data.select("fit")
        if len(rows) < 3:
            raise UserError(f"a linear law needs at least 3 states, there are {len(rows)}")
        if not np.all(np.isfinite(rows.moment_n_m)):
            raise UserError("a moment is no number")
        p, u = rows.actuation, rows.angle_rad
        terms = self.solve(np.stack([np.ones(len(p)), p / 1e4, -u], axis=1), rows) * [1, 1e-4, 1]
        box = Domain(np.array([p.min(), p.max()]), np.array([[u.min(), u.max()]]))
        law = LineLaw(terms, box, axes=(data.axis,), actuation_name=data.actuation_name)
        return FittedLaw(law, self.score(law, data, len(rows)))

    def solve(self, columns: Array, rows: FemDataset) -> Array:
        solution: Array = np.linalg.lstsq(columns, rows.moment_n_m, rcond=None)[0]
        return solution

    def score(self, law: JointLaw, data: FemDataset, n_fitted: int, role: Any = "check") -> FitReport:
        check = data.select(role)
        wide = float(np.ptp(data.moment_n_m))
        missed = law.evaluate(check.actuation, check.angle_rad[:, None]).tau[:, 0] - check.moment_n_m
        spread = float(np.sum((check.moment_n_m - check.moment_n_m.mean()) ** 2))
        worst = float(np.abs(missed).max())
        rmse, r2 = float(np.sqrt(np.mean(missed**2))), 1 - float(np.sum(missed**2)) / spread
        return FitReport(n_fitted, len(check), rmse, worst, worst / wide, r2, wide, {})

    def load(self, record: LawRecord) -> JointLaw:
        a, v = record.arrays, record.values
        box = Domain(a["actuation"], a["deformation"])
        return LineLaw(a["terms"], box, axes=tuple(v["axes"]), actuation_name=v["actuation_name"])


variants = Variants(
    Component(
        "surrogate",
        "small",
        "broken.surrogate:LineConfig",
        "broken.surrogate:Line",
        "a linear law",
        {"stated_gain": 1e-6},
    )
)


class Lawed(Line):
    """A fit whose law is another class."""

    law: type[LineLaw] = LineLaw

    def fit(self, data: FemDataset) -> FittedLaw:
        good = super().fit(data)
        law = good.law
        assert isinstance(law, LineLaw)
        return replace(
            good, law=self.law(law.terms, law.domain, axes=law.axes, actuation_name=law.actuation_name)
        )


broken_by = variants.by_part(Lawed, "law")


@variants.by("fits_a_linear_law", "fitted linear law is off")
class WrongSign(Line):
    """The moment's sign reversed."""

    def solve(self, columns: Array, rows: FemDataset) -> Array:
        return -super().solve(columns, rows)


@variants.by("reports_its_errors_honestly", "the report's rmse|n_heldout")
class FlattersItself(Line):
    """Reports the errors of the fitted states."""

    def score(self, law: JointLaw, data: FemDataset, n_fitted: int, role: Any = "fit") -> FitReport:
        return replace(super().score(law, data, n_fitted, "fit"), n_heldout=len(data.select("check")))


@variants.by("check_states_are_not_fitted", "they were fitted")
class SeesEverything(Line):
    """Fits the check states too."""

    def fit(self, data: FemDataset) -> FittedLaw:
        return super().fit(replace(data, role=np.full(len(data), "fit")))

    def score(self, law: JointLaw, data: FemDataset, n_fitted: int, role: Any = "fit") -> FitReport:
        return super().score(law, data, n_fitted, "fit")


@broken_by("slopes_are_derivatives", "dtau_du is not the slope of tau")
class WrongSlope(LineLaw):
    """∂τ/∂u with the sign of a stiffness."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        return replace(good, dtau_du=-good.dtau_du)


@broken_by("joints_do_not_affect_each_other", "depends on which other joints")
class Batched(LineLaw):
    """Uses the batch's mean."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        return replace(good, tau=good.tau + 1e-4 * deformation.mean())


@broken_by("record_gives_the_same_bits", "the record rounds a number")
class Rounded(LineLaw):
    """Stores 32 bits."""

    def record(self) -> LawRecord:
        good = super().record()
        return replace(good, arrays={**good.arrays, "terms": np.float32(self.terms)})


@broken_by("effort_derives_from_the_potential", "τ is not −∂Π/∂u")
class OtherEnergy(LineLaw):
    """Twice the energy."""

    def potential(self, actuation: Array, deformation: Array) -> Array:
        return 2 * super().potential(actuation, deformation)


@variants.by("domain_is_the_box_of_the_data", "not the box of the fitted states")
class Boundless(Line):
    """Claims to hold everywhere."""

    def fit(self, data: FemDataset) -> FittedLaw:
        good = super().fit(data)
        return replace(good, law=replace(good.law, domain=Domain.unbounded(1)))  # type: ignore[type-var]


@broken_by("stays_finite_outside_the_domain", "not finite outside the domain")
class Refusing(LineLaw):
    """No number outside its box."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        outside = np.any(self.domain.excess(actuation, deformation) != 0, axis=1)
        return replace(good, tau=np.where(outside[:, None], np.nan, good.tau))


@variants.by("law_is_stable", "∂τ/∂u reaches")
class Unstable(Line):
    """Its stiffness is negative."""

    def solve(self, columns: Array, rows: FemDataset) -> Array:
        return super().solve(columns, rows) * [1, 1, -1]


@variants.by("says_when_there_are_too_few_states", "LinAlgError|ValueError|single state|IndexError")
class FitsAnything(Line):
    """Fits one state without a word."""

    def fit(self, data: FemDataset) -> FittedLaw:
        try:
            return super().fit(data)
        except UserError:
            law = LineLaw(np.array([0.0, 1e-6, 0.04]), Domain.unbounded(1))
            return FittedLaw(law, FitReport(1, 0, 0.0, 0.0, 0.0, 1.0, 1.0, {}))


@variants.by("fits_values_without_slopes", "not all values are finite|LinAlgError")
class NeedsSlopes(Line):
    """Takes the stiffness from the slopes alone."""

    def solve(self, columns: Array, rows: FemDataset) -> Array:
        return super().solve(columns, rows) * [1, 1, 0] + [0, 0, -rows.dmoment_du.mean()]


@variants.by("refuses_values_that_are_not_numbers", "without a word")
class DropsNan(Line):
    """Leaves out what it cannot read."""

    def fit(self, data: FemDataset) -> FittedLaw:
        return super().fit(replace(data, moment_n_m=np.nan_to_num(data.moment_n_m)))


@variants.by("is_deterministic", "two fits of the same data differ")
class Bootstraps(Line):
    """A random resample without a seed."""

    def solve(self, columns: Array, rows: FemDataset) -> Array:
        chosen = np.random.default_rng().integers(len(columns), size=len(columns))
        return super().solve(columns[chosen], replace(rows, moment_n_m=rows.moment_n_m[chosen]))


@variants.by("stated_law_is_complete", "no JointLaw")
class StatesNumbers(Line):
    """Gives the coefficients instead of a law."""

    def stated(self) -> Any:
        return np.array([0.0, 1e-6, 0.04])


@variants.by("couples_the_axes_of_a_joint", "about x of a coupled law is off")
class EachByItself(Line):
    """Says that it couples axes, and fits τ_k = g_k p − K_k u_k."""

    couples = True

    def fit_module(self, data: ModuleData) -> FittedLaw:
        rows = data.role == "fit"
        p, u, tau = data.actuation[rows], data.deformation[rows], data.tau[rows]
        fits = [
            np.linalg.lstsq(np.stack([p, -u[:, k]], axis=1), tau[:, k], rcond=None)[0]
            for k in range(len(data.axes))
        ]
        gain, stiffness = np.transpose(fits)
        law = LinearLaw(gain, np.diag(stiffness), Domain.unbounded(len(gain)), data.joint, data.axes)
        missed = law.evaluate(p, u).tau - tau
        worst, wide = float(np.abs(missed).max()), float(np.ptp(tau))
        rmse = float(np.sqrt(np.mean(missed**2)))
        return FittedLaw(law, FitReport(len(p), 0, rmse, worst, worst / wide, 0.0, wide, {}))
