"""Meta-model: one model over a design space, from which the law of a design comes without FEM."""

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
from pliant.records.actuation import names_of
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant.records.solved import Parameter, SolvedDesigns


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
    """A fitted meta-model: design parameters in, joint law out.

    Implementations are frozen. The law of a design inside the range of the solved designs is stable and smooth in
    the parameters; the range is the box of `box`.

    Attributes:
        names: the d parameters that it takes, SI.
        box: (d, 2) their range.
        fixed: parameters that all solved designs shared; a design must have the same.
    """

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]

    @abstractmethod
    def law(self, values: Array) -> JointLaw:
        """The law of one design, values (d,) in the order of `names`, with a domain of its own."""

    @abstractmethod
    def record(self) -> LawRecord:
        """The model as data; `MetaModel.load` makes the same of it. No pickle."""

    def doubt(self, values: Array) -> Array:
        """(m,) how unsure the model is of designs (m, d), relative to each other; 1 where it cannot tell.

        Error bars are wider by this factor. A Gaussian process gives its deviation.
        """
        return np.ones(len(values))

    def gain(self, candidates: Array, over: Array) -> Array | None:
        """(m,) expected share of the mean squared error over designs `over` (k, d) that solving each would remove.

        None where the model cannot tell (see `pliant.pipeline.meta_model.next_design`, which then takes `doubt`).
        """
        return None

    def excess(self, values: Array) -> Array:
        """(d,) how far outside its range each parameter of a design (d,) is: 0 inside."""
        low, high = self.box.T
        found: Array = np.minimum(values - low, 0.0) + np.maximum(values - high, 0.0)
        return found


@dataclass(frozen=True, eq=False)
class FittedMetaModel:
    """A meta-model and what its fit has to tell: sizes, choices made, wall time of parts, by name."""

    laws: DesignLaws
    details: Mapping[str, Any] = field(default_factory=dict)


class MetaModel(Configured[MetaModelConfig]):
    """A way to make laws of unseen designs. Scores, error bars and tables are the pipeline's, alike for all kinds.

    Attributes:
        several_actuations: whether it makes laws of several actuations; designs of them are refused otherwise.
    """

    several_actuations: ClassVar[bool] = False

    @property
    def fewest(self) -> int:
        """The fewest designs that can be fitted, for d + 1 of them a plane."""
        return 4

    def check_actuations(self, actuation_name: str) -> None:
        """Raise `UserError` for several actuations where the kind makes laws of one."""
        if len(names_of(actuation_name)) > 1 and not self.several_actuations:
            raise UserError(
                f"meta_model '{self.config.kind}' makes laws of one actuation, and this family is driven by "
                f"{actuation_name}: use meta_model.kind 'regression' or 'neural'."
            )

    @abstractmethod
    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Fit all states of role "fit" and trusted status of all designs; states of role "check" are left alone.

        Deterministic: random starts are seeded. Raises `UserError` for too few designs; says how many are needed.
        """

    @abstractmethod
    def load(self, record: LawRecord) -> DesignLaws:
        """The model of a record written by `DesignLaws.record`; both give laws of the same bits."""


def enough_to_score(count: int, names: Sequence[str], fewest: int) -> None:
    """Raise `UserError` where so many designs cannot be fitted with one of them left out."""
    needed = max(fewest, len(names) + 1)
    if count - 1 < needed:
        raise UserError(
            f"a meta-model of {len(names)} parameters ({', '.join(names)}) is fitted to at least {needed} designs and "
            f"scored on one more, so {count} are too few; add values to the sweep."
        )


def enough_designs(designs: SolvedDesigns, fewest: int, kind: str) -> None:
    """Raise `UserError` where there are fewer designs than the meta-model needs."""
    needed = max(fewest, len(designs.names) + 1)
    if len(designs) < needed:
        raise UserError(
            f"meta-model '{kind}' needs at least {needed} designs for {len(designs.names)} parameters "
            f"({', '.join(designs.names)}), and there are {len(designs)}; add values to the sweep."
        )
