"""The problem in which the best trials of a noisy search are evaluated again (`search.confirm`)."""

from __future__ import annotations

from dataclasses import replace

from pliant.config.search import ConfirmConfig
from pliant.config.study_keys import KeyPath, study_key
from pliant.errors import UserError
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.problem.study_setter import changed

PLACE = "search.confirm.change"


def reevaluation_problem(problem: SearchProblem) -> SearchProblem:
    """The problem in which the best candidates are tried again; conditions give way to what `confirm.change` sets.

    Raises:
        UserError: a key that the study does not have, or a value that it does not allow.
    """
    config = problem.config.confirm
    assert config is not None
    paths = _paths(problem, config)
    conditions = tuple(
        replace(one, changes={path: value for path, value in one.changes.items() if path not in paths})
        for one in problem.conditions
    )
    study = changed(problem.registry, problem.study, config.change, PLACE)
    return replace(problem, study=study, conditions=conditions)


def require_reevaluation(problem: SearchProblem) -> None:
    """Raise `UserError` where one best cannot be chosen, or where the change is wrong."""
    if problem.config.confirm is None:
        return
    if len(problem.objective_names) > 1:
        raise UserError(
            "search.confirm chooses by one objective, and search.objective lists several; leave confirm out, or write "
            "one expression of them."
        )
    reevaluation_problem(problem)
    set_twice = {path for one in problem.variables for path in one.keys} & _paths(
        problem, problem.config.confirm
    )
    if set_twice:
        names = ", ".join(".".join(map(str, path)) for path in sorted(set_twice, key=str))
        raise UserError(f"search.confirm.change sets {names}, which the search varies; leave it out there.")


def _paths(problem: SearchProblem, config: ConfirmConfig) -> set[KeyPath]:
    return {study_key(problem.study, problem.registry, written, PLACE).path for written in config.change}
