"""The polynomial surrogate: states in, law and honest errors out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import LawRecord
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.axes import AxesLaw, AxesSurrogate, axes_law
from pliant_plugins.surrogates.polynomial.energy_fit import fit_energy
from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw
from pliant_plugins.surrogates.polynomial.fit import Candidate, fit_adaptive
from pliant_plugins.surrogates.polynomial.law import KIND, PolynomialLaw, largest_slope
from pliant_plugins.surrogates.polynomial.several_fit import fit_several
from pliant_plugins.surrogates.polynomial.several_law import FORM, SeveralLaw
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.study import (
    fit_differences,
    fit_study,
    stated_domain,
    study_bar,
    study_law,
)
from pliant_plugins.surrogates.polynomial.system import joint_of
from pliant_plugins.surrogates.records import require_kind

# An energy's degree is one more than its effort's; where walls meet, the main axis alone takes four more.
MORE_IN_ENERGY = 5


class Polynomial(AxesSurrogate):
    """Joint laws that are polynomials in pressure and angle (`PolynomialLaw`).

    Form "adaptive" fits values and slopes by least squares, energies and travels of FEM states too where that
    helps, and chooses the degree by cross-validation; form
    "study" is the published one (see `study`). `FitReport.details` holds the
    cross-validation table, the residuals, the share of states inside the error bar and the errors of the study's
    forms on the same states.
    """

    config: PolynomialConfig
    couples = True
    several_actuations = True

    def stated(self) -> PolynomialLaw | AxesLaw | None:
        """The law of the config's coefficients, or None."""
        config = self.config
        if each := self.of_axes():
            laws = {axis: one.stated() for axis, one in each.items()}
            return axes_law(laws) if all(isinstance(law, PolynomialLaw) for law in laws.values()) else None
        if config.coefficients is None:
            return None
        axis = config.axis or ("x" if config.joint == "prismatic" else "y")
        domain = stated_domain(config.domain)
        return study_law(config.coefficients, config.odd, domain, config.actuation_name, axis, config.joint)

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Whole states of several axes as one energy; each axis by itself where the config has `axes` or form study.

        Of several actuations it is one energy of all of them, whatever the axes (`several_fit`).

        Raises:
            UserError: the study's form, or a law for each axis, of several actuations.
        """
        if len(data.actuations) > 1:
            if self.config.form == "study" or self.config.axes is not None:
                raise UserError(
                    f"the module is driven by {data.actuation_name}, and the study's form and laws of single axes take "
                    "one actuation: leave 'form' and 'axes' out."
                )
            return fit_several(data)
        together = (
            len(data.explored_axes()) > 1 and self.config.axes is None and self.config.form == "adaptive"
        )
        return (
            fit_energy(data, self.config.max_degree + MORE_IN_ENERGY)
            if together
            else super().fit_module(data)
        )

    def of_axes(self) -> dict[str, Polynomial]:
        """The surrogates of the axes of a spherical joint, where the config has them."""
        each = {} if self.config.axes is None else self.config.axes.each()
        return {
            axis: Polynomial(PolynomialConfig.model_validate({**one.model_dump(), "axis": axis}))
            for axis, one in each.items()
        }

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `states.split`).

        Raises `UserError`, in one sentence, for too few states, non-finite numbers and contradictions.
        """
        states = split(data)
        if self.config.form == "study":
            procedure = fit_study if self.config.procedure == "least_squares" else fit_differences
            coefficients = procedure(states.fit, self.config.odd)
            joint = joint_of(data)
            law = study_law(
                coefficients, self.config.odd, states.domain, data.actuation_name, data.axis, joint
            )
            law = replace(law, error=study_bar(law, states.fit))
            parameters: dict[str, Any] = coefficients.canonical()
            choice: dict[str, Any] = {
                "form": "study",
                "odd": self.config.odd,
                "procedure": self.config.procedure,
            }
        else:
            chosen, candidates = fit_adaptive(states.fit, states.domain, self.config.max_degree)
            law = replace(chosen.law, error=chosen.posterior.error_bar())
            parameters = {
                "coefficients": law.coefficients.tolist(),
                "actuation_map": law.actuation_map.tolist(),
                "deformation_map": law.deformation_map.tolist(),
            }
            choice = {"form": "adaptive", **_choice(chosen, candidates)}
        slope = largest_slope(law)
        details = {**choice, "parameters": parameters, "largest_slope": slope, "stable": slope < 0}
        return FittedLaw(law, scoring.report(law, states, details, bool(choice.get("odd", False))))

    def load(self, record: LawRecord) -> PolynomialLaw | AxesLaw | EnergyPolynomialLaw | SeveralLaw:
        """The law of a record that one of these laws wrote."""
        require_kind(record, KIND)
        if record.values.get("form") == FORM:
            return SeveralLaw.of_record(record)
        if record.values.get("form") == "energy":
            return EnergyPolynomialLaw.of_record(record)
        if record.values["joint"] == "spherical":
            return AxesLaw.of_record(record)
        return PolynomialLaw.of_record(record)


def _choice(chosen: Candidate, candidates: list[Candidate]) -> dict[str, Any]:
    """The chosen degree and the table it was chosen from; errors are shares of the fitted effort's range."""
    prior = chosen.prior
    table = [
        {
            "degree": c.degree,
            "actuation_degree": c.actuation_degree,
            "terms": c.n_terms,
            "rmse_of_range": c.rmse,
            "standard_error": c.rmse_se,
            "stable": c.largest_slope < 0,
            "held_back": c.prior is not None,
            "potential": c.potential,
            "chosen": c is chosen,
        }
        for c in candidates
    ]
    return {
        "degree": chosen.degree,
        "actuation_degree": chosen.actuation_degree,
        "terms": chosen.n_terms,
        "prior": None if prior is None else {"radii": list(prior.radii), "noise": prior.noise},
        "potential": chosen.potential,
        "cross_validation": table,
    }
