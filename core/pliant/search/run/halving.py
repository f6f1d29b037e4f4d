"""Successive halving over the searches of a study: the best of them go on with several times the candidates.

Every search gets the budget first; of the `factor`-th part that found most each gets `factor` times as many candidates,
and so on until one is left. Each step costs about as much as the first (Jamieson, Talwalkar, AISTATS 2016, whose
"arms" are our branches). Which searches went on is written down, so that an interrupted search takes the same ones.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from pliant.errors import UserError
from pliant.interfaces.optimizer import Optimizer
from pliant.search.problem.search_problem import SearchProblem
from pliant.store.store import write_atomically

FILE = "halving.json"


class Halving:
    """Who goes on.

    Args:
        folder: of the journals; holds the choices that were made.
        count: branches.
        factor: of the study; None: nobody goes on.
        of: what the choices depend on; those made of something else are forgotten.
    """

    def __init__(self, folder: Path, count: int, factor: int | None, of: Sequence[int | None]) -> None:
        self._file, self._factor = folder / FILE, factor
        self._of = [count, factor, *of]
        self._chosen = self._read() if factor is not None else []
        self.left = self._chosen[-1] if self._chosen else list(range(count))

    def times(self, branch: int) -> int:
        """How many times the budget a branch has by now."""
        return int((self._factor or 1) ** sum(branch in chosen for chosen in self._chosen))

    def go_on(self, scores: Sequence[float]) -> bool:
        """Choose among those left, by the best objective of every branch; whether somebody goes on."""
        if self._factor is None or len(self.left) == 1:
            return False
        ranked = sorted(self.left, key=lambda branch: (scores[branch], branch))
        self.left = sorted(ranked[: -(-len(self.left) // self._factor)])
        self._chosen.append(self.left)
        text = json.dumps({"of": self._of, "chosen": self._chosen})
        write_atomically(self._file, text)
        return True

    def _read(self) -> list[list[int]]:
        try:
            plain = json.loads(self._file.read_text(encoding="utf-8"))
            found: list[list[int]] = plain["chosen"] if plain["of"] == self._of else []
        except (OSError, ValueError, KeyError, TypeError):
            return []
        return found


def require_halving(problem: SearchProblem, optimizer: Optimizer) -> None:
    """Raise `UserError` where nothing can be halved."""
    if problem.config.halving is None:
        return
    if len(problem.branches()) == 1:
        raise UserError(
            "search.halving chooses among the searches of 'each' variables, and this study has one search; leave it "
            "out, or give a variable of whole numbers or choices 'each: true'."
        )
    if len(problem.objective_names) > 1:
        raise UserError(
            "search.halving ranks searches by one objective, and search.objective lists several; leave halving out, "
            "or write one expression of them."
        )
    if optimizer.capabilities.contexts and problem.config.conditions:
        raise UserError(
            f"search.halving ranks searches by one score, and optimizer '{optimizer.config.kind}' has one for each "
            "condition; leave halving out, or use an optimizer that tries a candidate in all conditions."
        )
