"""The polynomial surrogate: a law stated by coefficients, or fitted by `fitting`."""

from __future__ import annotations

from pliant.interfaces.surrogate import FittedLaw
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import JointLaw, LawRecord
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.axes import AxesLaw, AxesSurrogate, axes_law
from pliant_plugins.surrogates.polynomial.law import KIND, SEVERAL, PolynomialLaw, stated_domain, study_law
from pliant_plugins.surrogates.records import require_kind


class Polynomial(AxesSurrogate):
    """Joint laws that are polynomials in pressure and angle (`PolynomialLaw`).

    Form "adaptive" fits values and slopes by least squares, energies and travels of FEM states too if that reduces the
    error, and chooses the degree by cross-validation; form "study" is the published one (see `study`).
    `FitReport.details` contains the cross-validation table, the residuals, the share of states inside the error bar and
    the errors of the published forms on the same states.
    """

    config: PolynomialConfig
    couples = True
    several_actuations = True
    gets_untrusted = True  # `states.split` judges them

    def stated(self) -> PolynomialLaw | AxesLaw | None:
        """Return the law of the config's coefficients, or None."""
        config = self.config
        if each := self.axis_surrogates():
            laws = {axis: one.stated() for axis, one in each.items()}
            return axes_law(laws) if all(isinstance(law, PolynomialLaw) for law in laws.values()) else None
        if config.coefficients is None:
            return None
        axis = config.axis or ("x" if config.joint == "prismatic" else "y")
        domain = stated_domain(config.domain)
        return study_law(config.coefficients, config.odd, domain, config.actuation_name, axis, config.joint)

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Fit states of several axes as one energy; fit each axis separately if the config has `axes` or form study.

        Several actuations have one common energy, whatever the axes (`several_fit`).

        Raises:
            UserError: the published form, or a law for each axis, with several actuations.
        """
        # The fits, and the forms of laws that a stated law is not, are loaded only for a fit.
        from pliant_plugins.surrogates.polynomial.fitting import fit_together

        return fit_together(self.config, data) or super().fit_module(data)

    def axis_surrogates(self) -> dict[str, Polynomial]:
        """Return the surrogates of the axes of a spherical joint, if the config has them."""
        each = {} if self.config.axes is None else self.config.axes.each()
        stated = {axis: {"axis": axis} if one.coefficients is not None else {} for axis, one in each.items()}
        return {
            axis: Polynomial(PolynomialConfig.model_validate({**one.model_dump(), **stated[axis]}))
            for axis, one in each.items()
        }

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `states.split`).

        Raises `UserError`, in one sentence, for too few states, non-finite numbers and contradictions.
        """
        from pliant_plugins.surrogates.polynomial.fitting import fit_one_axis

        return fit_one_axis(self.config, data)

    def load(self, record: LawRecord) -> JointLaw:
        """Return the law of a record that one of these laws wrote."""
        require_kind(record, KIND)
        form = record.values.get("form")
        if form == SEVERAL:
            from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw

            return SeveralLaw.from_record(record)
        if form == "energy":
            from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw

            return EnergyPolynomialLaw.from_record(record)
        if record.values["joint"] == "spherical":
            return AxesLaw.from_record(record)
        return PolynomialLaw.from_record(record)
