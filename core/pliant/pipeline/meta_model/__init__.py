"""Stage 2b: solved designs become one model, and the law of any other design comes from it.

designs → fit and `scoring` on designs left out → `bars` (error bars of unseen designs) → `stage` (artifacts, laws of
designs) → `next_design` (what to solve next).
"""

from pliant.pipeline.meta_model.designs import Solved, assembled, solved_designs
from pliant.pipeline.meta_model.next_design import Proposal, designs_to_solve, write_proposals
from pliant.pipeline.meta_model.scoring import Scores
from pliant.pipeline.meta_model.stage import MetaModelStage, law_of_design, meta_model_stage

__all__ = [
    "MetaModelStage",
    "Proposal",
    "Scores",
    "Solved",
    "assembled",
    "designs_to_solve",
    "law_of_design",
    "meta_model_stage",
    "solved_designs",
    "write_proposals",
]
