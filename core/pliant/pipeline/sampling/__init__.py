"""Which states of a module are solved: `sample` chooses, solves and keeps them.

`plan` follows the strategy that the config names: `adaptive` (with the Gaussian process of `gaussian`), `grid`
or `study`; `lateral` adds the other axes of a module that has several.
"""

from pliant.pipeline.sampling.plan import sample
from pliant.pipeline.sampling.targets import FULL, MAIN, Sampled, Sampling, Target, levels
from pliant.pipeline.sampling.walk import Piece

__all__ = ["FULL", "MAIN", "Piece", "Sampled", "Sampling", "Target", "levels", "sample"]
