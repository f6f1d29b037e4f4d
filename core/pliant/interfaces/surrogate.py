"""Surrogate: fits a joint law to FEM or bench data."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.records.actuation import names_of
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw, LawRecord


class SurrogateConfig(ComponentConfig):
    """Base of a surrogate's config. `data` fits a table from elsewhere instead of the FEM stage's states."""

    data: Path | None = Field(default=None, description="CSV with pressure_pa, angle_rad, moment_n_m")


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law and its errors on the states of role "check", which the fit must not have seen."""

    law: JointLaw
    report: FitReport


class Surrogate(Configured[SurrogateConfig]):
    """A way to make a law. The fit stage calls `stated` first; if that is None, `fit` with a data set.

    A law of several axes has a table for each, then `tables` names them and `fit_axes` gets them, or is fitted by
    `fit_module` to states that know all axes.

    Attributes:
        couples: whether `fit_module` fits the axes of a joint together, with ∂τ_i/∂u_j.
        several_actuations: whether `fit_module` fits laws of several actuations; data of them are refused otherwise.
    """

    couples: ClassVar[bool] = False
    several_actuations: ClassVar[bool] = False

    def stated(self) -> JointLaw | None:
        """The law that the config states by its coefficients, or None if the law must be fitted."""
        return None

    def tables(self) -> Mapping[str, Path]:
        """The config's own tables by axis; "" stands for the law of one axis."""
        return {} if self.config.data is None else {"": self.config.data}

    def needs_fem(self) -> bool:
        """Whether some axis is neither stated nor has a table, so that the FEM stage's states are fitted."""
        return not self.tables() and self.stated() is None

    def fit_axes(self, data: Mapping[str, FemDataset]) -> FittedLaw:
        """Fit the data of `tables` and of the FEM stage, by axis; a law of one axis is `fit` of what stands under "".

        Raises `UserError` as `fit` does.
        """
        return self.fit(data[""])

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Fit whole states of a module: all axes of its joint; each by itself unless the surrogate knows better.

        Raises `UserError` as `fit` does, and for several actuations unless the surrogate knows better.
        """
        self.check_actuations(data.actuation_name)
        axes = data.explored_axes()
        if len(axes) == 1:
            return self.fit_axes({"": data.axis(axes[0])})
        return self.fit_axes({axis: data.axis(axis) for axis in axes})

    def check_actuations(self, actuation_name: str) -> None:
        """Raise `UserError` for several actuations where the surrogate has laws of one."""
        if len(names_of(actuation_name)) > 1 and not self.several_actuations:
            raise UserError(
                f"surrogate '{self.config.kind}' fits laws of one actuation, and this module is driven by "
                f"{actuation_name}: use surrogate.kind 'polynomial' or 'neural'."
            )

    @abstractmethod
    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit states of role "fit" (values, and slopes where they are finite); score on role "check".

        Raises `UserError` when there are too few states; says how many are needed.
        """

    @abstractmethod
    def load(self, record: LawRecord) -> JointLaw:
        """Make the law of a record written by `JointLaw.record`; both evaluate to the same bits."""
