"""Study of the next round, with a meta-model that includes direct FEM of the refused designs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.design_parameters import design_parameters, same_value
from pliant.config.study import Study
from pliant.pipeline.study import build_study_laws
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Design
from pliant.records.fem import ModuleData
from pliant_designs.solved_designs import solved_designs
from pliant_designs.sweep_table import write_designs
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import FoundDesign
from pliant_search.verify.direct_fem import direct_studies, solvable
from pliant_search.verify.verification import verification_cases

FOLDER = "search_rounds"


def with_checked(context: RunContext, problem: SearchProblem, designs: Sequence[FoundDesign]) -> Study | None:
    """Return the study with the direct FEM of these designs among its meta-model's data; None if nothing is new.

    The table is in the store, named after its content, so that an interrupted search finds it again.

    Args:
        context: plugins and store, which has the FEM of the designs since their check.
        problem: of the search, with a meta-model in its study.
        designs: the checked designs.
    """
    study = problem.study
    if study.block("meta_model") is None or not solvable(study):
        return None
    known = solved_designs(context, study).designs
    tables = [
        ({**known.fixed, **dict(zip(known.names, values.tolist(), strict=True))}, data)
        for values, data in zip(known.values, known.data, strict=True)
    ]
    count = len(tables)
    for parameters, data in _solved(context, problem, designs):
        own = {name: parameters[name] for name in (*known.names, *known.fixed) if name in parameters}
        if not any(_same(own, other, known.names) for other, _ in tables):
            tables.append((own, data))
    if len(tables) == count:
        return None
    path = _written(context, known.family, tables)
    model = study.block("meta_model").model_copy(update={"data": path})
    return study.model_copy(update={"meta_model": model, "sweep": None})


def _solved(
    context: RunContext, problem: SearchProblem, designs: Sequence[FoundDesign]
) -> Iterator[tuple[Mapping[str, Any], ModuleData]]:
    """Yield parameters and direct FEM of each distinct module of the designs."""
    for design in designs:
        studies, _ = direct_studies(
            context, [study for _, study in verification_cases(context, problem, design)]
        )
        for study in studies:
            for stages in build_study_laws(context, study):
                if stages.fem is not None and stages.family is not None:
                    yield design_parameters(stages.family, study.material), stages.fem.value


def _same(one: Mapping[str, Any], other: Mapping[str, Any], names: Sequence[str]) -> bool:
    """Return whether two designs have the same parameters."""
    return all(same_value(one.get(name), other.get(name)) for name in names)


def _written(
    context: RunContext, family: str, tables: Sequence[tuple[Mapping[str, Any], ModuleData]]
) -> Path:
    """Return the table of all designs in the store."""
    digest = hashlib.sha256(json.dumps([dict(own) for own, _ in tables], default=str).encode())
    for _, data in tables:
        digest.update(np.ascontiguousarray(data.tau).tobytes())
    path = context.store.root / FOLDER / f"{digest.hexdigest()[:32]}.csv"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_designs(
            (
                (number, {}, replace(data, design=Design(family, dict(own))), None)
                for number, (own, data) in enumerate(tables)
            ),
            path,
        )
    return path
