"""The mutants of `make mutants`: each occurs in the code, every room has enough, and the tests of each exist."""

import ast
from collections import Counter

import pytest
from benchmarks.house import modules
from tests.conformance.test_shipped import SUITES
from tests.mutants.chosen import CHOSEN
from tests.mutants.mutant import ROOMS, ROOT, Mutant, drawn
from tests.mutants.run import DRAWN, SEED, dotted, nearest_tests


@pytest.fixture(scope="module")
def mutants() -> list[Mutant]:
    return [*CHOSEN, *drawn(DRAWN, SEED)]


def test_every_mutant_changes_its_file_and_leaves_it_python(mutants: list[Mutant]) -> None:
    for mutant in mutants:
        ast.parse(mutant.applied())
    assert len(set(mutants)) == len(mutants) >= 60
    assert set(Counter(mutant.room for mutant in mutants)) == set(ROOMS)


@pytest.mark.slow
def test_every_mutant_meets_tests_that_exist(mutants: list[Mutant]) -> None:
    """pytest ends with an error for a missing test, which would count as a caught mutant."""
    tests = nearest_tests(modules())
    cases = {f"test_shipped[{suite.id}]" for suite in SUITES}
    for mutant in mutants:
        found = tests[dotted(mutant.file)]
        assert found, mutant
        for file, _, case in (one.partition("::") for one in found):
            assert (ROOT / file).is_file() and case in {"", *cases}
