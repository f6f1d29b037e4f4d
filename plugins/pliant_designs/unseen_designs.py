"""`pliant.api.meta_model`: a fitted meta-model, which gives laws of designs that were never solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from pliant.api import OpenStudy
from pliant.config.problems import sentences
from pliant.config.study import varied
from pliant.errors import UserError
from pliant.records.law import JointLaw
from pliant_designs.cross_validation import Scores
from pliant_designs.next_design import Proposal, designs_to_solve
from pliant_designs.stage import MetaModelStage, meta_model_stage


@dataclass(frozen=True, eq=False)
class UnseenDesigns:
    """The fitted meta-model of a study.

    Attributes:
        opened: the study.
        stage: the model with its scores, coverage and details.
    """

    opened: OpenStudy
    stage: MetaModelStage

    @property
    def scores(self) -> Mapping[str, Scores]:
        """Errors on held-out designs: all, interior, border."""
        return self.stage.scores

    def law(self, parameters: Mapping[str, Any] | None = None) -> JointLaw:
        """Return the law of a design, with its error bar.

        Args:
            parameters: of the family, as a study writes them, ``{"average_radius": "7.2 mm"}``; the others are the
                study's.

        Raises:
            UserError: an impossible design, or one outside the model's domain.
        """
        study = self.opened.study
        family = study.need("family", "a meta-model")
        try:
            changed = varied(family, parameters or {})
        except ValidationError as error:
            raise UserError(sentences(error, type(family), lambda path: "", ("family",))) from None
        self.opened.context.build("family", changed)
        return self.stage.law(self.stage.values(changed, study.material))  # type: ignore[arg-type]

    def next(self, count: int = 1) -> list[Proposal]:
        """Return the designs to solve next, best first."""
        return designs_to_solve(self.opened.context, self.opened.study, self.stage, count)


def meta_model(opened: OpenStudy) -> UnseenDesigns:
    """Return the study's meta-model, after solving its designs if necessary."""
    return UnseenDesigns(opened, meta_model_stage(opened.context, opened.study))
