"""Fits of the polynomial surrogate: one axis by the adaptive or the published form, several axes as one energy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.fem import FemDataset, ModuleData
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.energy_fit import fit_energy
from pliant_plugins.surrogates.polynomial.fit import Candidate, fit_adaptive
from pliant_plugins.surrogates.polynomial.law import largest_slope, study_law
from pliant_plugins.surrogates.polynomial.several_fit import fit_several
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.study import fit_differences, fit_study, study_bar
from pliant_plugins.surrogates.polynomial.system import one_axis_joint

# An energy's degree is one more than its effort's; where walls meet, the main axis alone takes four more.
MORE_IN_ENERGY = 5


def fit_together(config: PolynomialConfig, data: ModuleData) -> FittedLaw | None:
    """Fit several axes or actuations as one energy; None if each axis is fitted separately.

    Raises:
        UserError: the published form, or a law for each axis, with several actuations.
    """
    if len(data.actuations) > 1:
        if config.form == "study" or config.axes is not None:
            raise UserError(
                f"the module is driven by {data.actuation_name}, and the published form and laws of single axes take "
                "one actuation: leave 'form' and 'axes' out."
            )
        return fit_several(data)
    if len(data.explored_axes()) > 1 and config.axes is None and config.form == "adaptive":
        return fit_energy(data, config.max_degree + MORE_IN_ENERGY)
    return None


def fit_one_axis(config: PolynomialConfig, data: FemDataset) -> FittedLaw:
    """Fit the states of role "fit" and score the law on those of role "check" (see `states.split`).

    Raises:
        UserError: too few states, non-finite numbers or contradictions.
    """
    states = split(data)
    if config.form == "study":
        procedure = fit_study if config.procedure == "least_squares" else fit_differences
        coefficients = procedure(states.fit, config.odd)
        joint = one_axis_joint(data)
        law = study_law(coefficients, config.odd, states.domain, data.actuation_name, data.axis, joint)
        law = replace(law, error=study_bar(law, states.fit))
        parameters: dict[str, Any] = coefficients.canonical()
        choice: dict[str, Any] = {
            "form": "study",
            "odd": config.odd,
            "procedure": config.procedure,
        }
    else:
        chosen, candidates = fit_adaptive(states.fit, states.domain, config.max_degree)
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


def _choice(chosen: Candidate, candidates: list[Candidate]) -> dict[str, Any]:
    """Return the chosen degree and the table it was chosen from; errors are shares of the fitted effort's range."""
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
