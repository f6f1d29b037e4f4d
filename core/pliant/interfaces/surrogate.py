"""Surrogate: a method that fits a joint law to FEM or laboratory data."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.material import Material
from pliant.records.actuation import split_actuation_names
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw, LawRecord


class SurrogateConfig(ComponentConfig):
    """Base of a surrogate's config. `data` fits a table from elsewhere instead of the FEM stage's states."""

    data: Path | None = Field(default=None, description="CSV with pressure_pa, angle_rad, moment_n_m")


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law and its errors on the states of role "check", which the fit must not use."""

    law: JointLaw
    report: FitReport


class Surrogate(Configured[SurrogateConfig]):
    """Source of a law. The fit stage calls `stated_for` first; if it returns None, `fit` with a data set.

    A law of several axes either has a table for each axis, which `tables` names and `fit_axes` gets, or is fitted by
    `fit_module` to states that cover all axes.

    Attributes:
        couples: whether `fit_module` fits the axes of a joint together, with ∂τ_i/∂u_j.
        several_actuations: whether `fit_module` fits laws of several actuations; otherwise such data are refused.
        gets_untrusted: whether the fit also gets untrusted states, such as self-contact, and evaluates their `status`
            itself; otherwise they are removed.
    """

    gets_untrusted: ClassVar[bool] = False
    couples: ClassVar[bool] = False
    several_actuations: ClassVar[bool] = False

    def stated(self) -> JointLaw | None:
        """Return the law that the config states by its coefficients, or None if the law must be fitted."""
        return None

    def stated_for(self, family: ActuatorFamily | None, material: Material | None) -> JointLaw | None:
        """Return the law that the config states for modules of a family, or None; by default `stated`.

        Args:
            family: the design; None for a chain without a `family` block.
            material: of the study; None without one.
        """
        return self.stated()

    def tables(self) -> Mapping[str, Path]:
        """Return the config's own tables by axis; the key "" is a law of one axis."""
        return {} if self.config.data is None else {"": self.config.data}

    def needs_fem(self) -> bool:
        """Return whether the FEM stage's states are needed, since some axis has neither a stated law nor a table."""
        return not self.tables() and self.stated() is None

    def fit_axes(self, data: Mapping[str, FemDataset]) -> FittedLaw:
        """Fit the data of `tables` and of the FEM stage, by axis; a law of one axis is the `fit` of the entry "".

        Raises `UserError` as `fit` does.
        """
        return self.fit(data[""])

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Fit states of all axes of a module's joint; by default each axis separately.

        Raises `UserError` as `fit` does, and by default for several actuations.
        """
        self.check_actuations(data.actuation_name)
        axes = data.explored_axes()
        if len(axes) == 1:
            return self.fit_axes({"": data.axis(axes[0])})
        return self.fit_axes({axis: data.axis(axis) for axis in axes})

    def check_actuations(self, actuation_name: str) -> None:
        """Raise `UserError` for several actuations if the surrogate supports only one."""
        if len(split_actuation_names(actuation_name)) > 1 and not self.several_actuations:
            raise UserError(
                f"surrogate '{self.config.kind}' fits laws of one actuation, and this module is driven by "
                f"{actuation_name}: use surrogate.kind 'polynomial' or 'neural'."
            )

    @abstractmethod
    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit states of role "fit" (values, and finite slopes); score on role "check".

        Raises `UserError` for too few states, with the number needed.
        """

    @abstractmethod
    def load(self, record: LawRecord) -> JointLaw:
        """Return the law of a record written by `JointLaw.record`; both evaluate to the same bits."""
