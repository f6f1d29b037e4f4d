"""The mutants that `make mutants` runs: each still stands in the code, and there are enough of every room."""

import ast
from collections import Counter

from tests.mutants.chosen import CHOSEN
from tests.mutants.mutant import ROOMS, drawn
from tests.mutants.run import DRAWN, SEED


def test_every_mutant_changes_its_file_and_leaves_it_python() -> None:
    mutants = [*CHOSEN, *drawn(DRAWN, SEED)]
    for mutant in mutants:
        ast.parse(mutant.applied())
    assert len(set(mutants)) == len(mutants) >= 60
    assert set(Counter(mutant.room for mutant in mutants)) == set(ROOMS)
