"""Meta-model: one model over a design space that predicts the law of a design without FEM."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.records.actuation import split_actuation_names
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant_designs.records import Parameter, SolvedDesigns


class MetaModelConfig(ComponentConfig):
    """Base of a meta-model's config."""

    data: Path | None = Field(
        default=None,
        description="table of a sweep (fem.csv of 'pliant fem'); else the study's `sweep` is solved",
    )
    folds: int = Field(
        default=8, ge=2, description="parts of the designs that are left out in turn to score the model"
    )
    extrapolate: bool = Field(
        default=False, description="whether designs outside the range of the solved ones get a law too"
    )


class DesignLaws(ABC):
    """A fitted meta-model, which maps design parameters to a joint law.

    Implementations are frozen. The law of a design inside the range of the solved designs is stable and smooth in
    the parameters; the range is the box of `box`.

    Attributes:
        names: the d parameters that it takes, SI.
        box: (d, 2) their range.
        fixed: parameters that all solved designs share; a design must have the same values.
    """

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]

    @abstractmethod
    def law(self, values: Array) -> JointLaw:
        """Return the law of one design and its domain, values (d,) in the order of `names`."""

    @abstractmethod
    def record(self) -> LawRecord:
        """Return the model as data, from which `MetaModel.load` rebuilds it. No pickle."""

    def doubt(self, values: Array) -> Array:
        """Return (m,) relative uncertainty of designs (m, d); 1 if the model provides none.

        Error bars are wider by this factor. A Gaussian process returns its standard deviation.
        """
        return np.ones(len(values))

    def gain(self, candidates: Array, over: Array) -> Array | None:
        """Return (m,) expected share of the mean squared error over `over` (k, d) that solving each would remove.

        None if the model does not provide it; `pliant_designs.next_design` then uses `doubt`.
        """
        return None

    def excess(self, values: Array) -> Array:
        """Return (d,) distance of each parameter of a design (d,) from its range: 0 inside."""
        low, high = self.box.T
        found: Array = np.minimum(values - low, 0.0) + np.maximum(values - high, 0.0)
        return found


@dataclass(frozen=True, eq=False)
class FittedMetaModel:
    """A meta-model and the details of its fit by name: sizes, choices, wall time of parts."""

    laws: DesignLaws
    details: Mapping[str, Any] = field(default_factory=dict)


class MetaModel(Configured[MetaModelConfig]):
    """Base of a kind of meta-model. Scores, error bars and tables are the pipeline's and equal for all kinds.

    Attributes:
        several_actuations: whether it supports laws of several actuations; otherwise such designs are refused.
    """

    several_actuations: ClassVar[bool] = False

    @property
    def fewest(self) -> int:
        """The smallest number of designs that can be fitted; d + 1 designs determine a plane."""
        return 4

    def check_actuations(self, actuation_name: str) -> None:
        """Raise `UserError` for several actuations if the kind supports only one."""
        if len(split_actuation_names(actuation_name)) > 1 and not self.several_actuations:
            raise UserError(
                f"meta_model '{self.config.kind}' makes laws of one actuation, and this family is driven by "
                f"{actuation_name}: use meta_model.kind 'regression' or 'neural'."
            )

    @abstractmethod
    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Fit all states of role "fit" and trusted status of all designs; states of role "check" are not used.

        Deterministic: random starts are seeded. Raises `UserError` for too few designs, with the number needed.
        """

    @abstractmethod
    def load(self, record: LawRecord) -> DesignLaws:
        """Return the model of a record written by `DesignLaws.record`; the laws of both are equal bit by bit."""


def enough_to_score(count: int, names: Sequence[str], fewest: int) -> None:
    """Raise `UserError` if `count` designs cannot be fitted with one of them left out."""
    needed = max(fewest, len(names) + 1)
    if count - 1 < needed:
        raise UserError(
            f"a meta-model of {len(names)} parameters ({', '.join(names)}) is fitted to at least {needed} designs and "
            f"scored on one more, so {count} are too few; add values to the sweep."
        )


def enough_designs(designs: SolvedDesigns, fewest: int, kind: str) -> None:
    """Raise `UserError` if there are fewer designs than the meta-model needs."""
    needed = max(fewest, len(designs.names) + 1)
    if len(designs) < needed:
        raise UserError(
            f"meta-model '{kind}' needs at least {needed} designs for {len(designs.names)} parameters "
            f"({', '.join(designs.names)}), and there are {len(designs)}; add values to the sweep."
        )
