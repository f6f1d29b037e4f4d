"""A correct linear law by least squares, and fits that leak data, lose state or fail."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw, Surrogate, SurrogateConfig
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import Domain, Effort, FitReport, JointLaw, LawRecord, ScalarLaw
from pliant.registry.component import Component
from pliant.testing.samples import LinearLaw


class LineConfig(SurrogateConfig):
    """The config of the linear law; a stated slope is optional."""

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


class LineSurrogate(Surrogate):
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


class Lawed(LineSurrogate):
    """A fit whose law is another class."""

    law: type[LineLaw] = LineLaw

    def fit(self, data: FemDataset) -> FittedLaw:
        good = super().fit(data)
        law = good.law
        assert isinstance(law, LineLaw)
        return replace(
            good, law=self.law(law.terms, law.domain, axes=law.axes, actuation_name=law.actuation_name)
        )


variants = Variants(
    Component(
        "surrogate",
        "small",
        f"{__name__}:LineConfig",
        f"{__name__}:LineSurrogate",
        "a linear law",
        {"stated_gain": 1e-6},
    )
)


broken, broken_law = variants.row_adder(LineSurrogate), variants.row_adder(Lawed, "law")


def _nan_outside(up: Any, self: Any, p: Array, u: Array) -> Effort:
    outside = np.any(self.domain.excess(p, u) != 0, axis=1)
    return replace(up(p, u), tau=np.where(outside[:, None], np.nan, up(p, u).tau))


def _single_precision(up: Any, self: Any) -> LawRecord:
    return replace(up(), arrays={**up().arrays, "terms": np.float32(self.terms)})


def _fitting_anything(up: Any, self: Any, data: FemDataset) -> FittedLaw:
    try:
        return up(data)  # type: ignore[no-any-return]
    except UserError:
        law = LineLaw(np.array([0.0, 1e-6, 0.04]), Domain.unbounded(1))
        return FittedLaw(law, FitReport(1, 0, 0.0, 0.0, 0.0, 1.0, 1.0, {}))


def _resampled(up: Any, self: Any, columns: Array, rows: FemDataset) -> Array:
    chosen = np.random.default_rng().integers(len(columns), size=len(columns))
    return np.asarray(up(columns[chosen], replace(rows, moment_n_m=rows.moment_n_m[chosen])))


def _each_axis_by_itself(up: Any, self: Any, data: ModuleData) -> FittedLaw:
    """Fit each axis separately: τ_k = g_k p − K_k u_k."""
    rows = data.role == "fit"
    p, u, tau = data.actuation[rows], data.deformation[rows], data.tau[rows]
    columns = [np.stack([p, -u[:, k]], axis=1) for k in range(len(data.axes))]
    fits = [np.linalg.lstsq(both, tau[:, k], rcond=None)[0] for k, both in enumerate(columns)]
    gain, stiffness = np.transpose(fits)
    law = LinearLaw(gain, np.diag(stiffness), Domain.unbounded(len(gain)), data.joint, data.axes)
    return FittedLaw(law, FitReport(len(p), 0, 0.0, 0.0, 0.0, 0.0, float(np.ptp(tau)), {}))


def _blind_to_the_second(up: Any, self: Any, data: ModuleData) -> FittedLaw:
    """Return τ = 2 g p₁ − k u of two pressures: correct where the other is equal and opposite in effect."""
    law = _FirstPressure(np.array([0.0, 3.2e-6, 0.03]), Domain(np.zeros((2, 2)), np.zeros((1, 2))))
    return FittedLaw(law, FitReport(1, 0, 0.0, 0.0, 0.0, 0.0, 1.0, {}))


class _FirstPressure(LineLaw):
    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        one = super().evaluate(actuation[:, 0], deformation)
        return replace(one, dtau_dp=np.stack([one.dtau_dp, np.zeros_like(one.dtau_dp)], axis=2))


def _five_percent_off(p: Any, u: Array, terms: Array, tau: Array, by_p: Array, by_u: Array) -> None:
    tau[0] = 1.05 * (terms[0] + terms[1] * p - terms[2] * u[0])
    by_p[0], by_u[0, 0] = terms[1], -terms[2]


broken("fits_a_linear_law", solve=lambda up, self, *given: -up(*given))
broken(
    "reports_its_errors_honestly",
    score=lambda up, self, law, data, n: replace(
        up(law, data, n, "fit"), n_heldout=len(data.select("check"))
    ),
)
broken(
    "check_states_are_not_fitted",
    fit=lambda up, self, data: up(replace(data, role=np.full(len(data), "fit"))),
    score=lambda up, self, law, data, n: up(law, data, n, "fit"),
)
broken_law(
    "slopes_are_derivatives", evaluate=lambda up, self, p, u: replace(up(p, u), dtau_du=-up(p, u).dtau_du)
)
broken_law("scalar_form_is_the_law", scalar=lambda up, self: ScalarLaw(_five_percent_off, self.terms))
broken_law(
    "joints_do_not_affect_each_other",
    evaluate=lambda up, self, p, u: replace(up(p, u), tau=up(p, u).tau + 1e-4 * u.mean()),
)
broken_law("record_gives_the_same_bits", record=_single_precision)
broken_law(
    "effort_derives_from_the_potential", potential=lambda up, self, p, u: 2 * JointLaw.potential(self, p, u)
)
broken(
    "domain_is_the_data_box",
    fit=lambda up, self, data: replace(up(data), law=replace(up(data).law, domain=Domain.unbounded(1))),
)
broken_law("stays_finite_outside_the_domain", evaluate=_nan_outside)
broken_law(
    "error_bar_holds_new_states", band=lambda up, self, p, u, level=0.9: level * 0.02 * np.ones_like(u)
)  # 43 % of the range
broken("law_is_stable", solve=lambda up, self, *given: up(*given) * [1, 1, -1])
broken("says_when_there_are_too_few_states", fit=_fitting_anything)
broken(
    "fits_values_without_slopes",
    solve=lambda up, self, columns, rows: up(columns, rows) * [1, 1, 0] + [0, 0, -rows.dmoment_du.mean()],
)
broken(
    "refuses_values_that_are_not_numbers",
    fit=lambda up, self, data: up(replace(data, moment_n_m=np.nan_to_num(data.moment_n_m))),
)
broken("is_deterministic", solve=_resampled)
broken("stated_law_is_complete", stated=lambda up, self: np.array([0.0, 1e-6, 0.04]))
broken("couples_joint_axes", couples=True, fit_module=_each_axis_by_itself)
broken("carries_several_actuations", several_actuations=True, fit_module=_blind_to_the_second)
