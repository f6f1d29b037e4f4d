"""Study for the check of a best design: its laws are fitted to direct FEM of the design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.fem import FemConfig
from pliant.pipeline.study import DEFAULT_SURROGATE
from pliant.pipeline.workbench import RunContext
from pliant.records.actuation import ActuationKind, actuation_kind, split_actuation_names
from pliant.records.fem import PASSED, TOUCHING, ModuleData
from pliant.registry.discovery import Registry
from pliant_designs.solved_designs import solved_designs
from pliant_search.config import SearchConfig
from pliant_search.problem.study_setter import changed

DEFAULT_FEM = "skfem"
MARGIN = 1.05  # of the task's own actuation, so that a law is not used at the limit of its data


def check_verifiable(study: Study, registry: Registry | None = None) -> None:
    """Raise `UserError` before the search if the study makes the check of the best design fail.

    Args:
        study: has `search`.
        registry: if given, `verify.change` is checked too.

    Raises:
        UserError: direct FEM is wanted and the study has no material; or `verify.change` names no key of the study.
    """
    search: SearchConfig | None = study.block("search")
    config = search.verify if search is not None else None
    if config is not None and registry is not None:
        changed(registry, study, config.change)
    if solvable(study) and study.material is None:
        raise UserError(
            f"study '{study.name}' has no 'material' block, which the check of the best design by FEM needs; give the "
            "material of the meta-model's designs, or set search.verify: null."
        )


def solvable(study: Study) -> bool:
    """Return whether laws of this study depend on its design, so that direct FEM of a design can check them."""
    search: SearchConfig | None = study.block("search")
    wanted = search is not None and search.verify is not None and search.verify.fem
    can = study.block("meta_model") is not None or study.fem is not None
    return wanted and study.family is not None and can


def direct_studies(context: RunContext, studies: Sequence[Study]) -> tuple[list[Study], list[str]]:
    """Return the studies with laws from FEM of each design instead of a meta-model's, and notes on the choices made.

    A study without a `fem` block gets one that covers the tasks and the meta-model's data; a surrogate that needs no
    FEM is replaced by the default one. Segments that state their own surrogate keep it.

    Args:
        context: the plugins.
        studies: of one family and material, as a search builds them from one study.

    Raises:
        UserError: the meta-model's data cannot be read.
    """
    first, sentences = studies[0], list[str]()
    changes: dict[str, Any] = {"meta_model": None}
    if first.fem is None:
        fem: Any = default_fem(context, studies)
        changes["fem"] = fem
        limit = f"tendon_force_max: {fem.tendon_force_max_n or 0:g} N"
        if fem.pressure_max_pa is not None:
            limit = f"pressure_max: {fem.pressure_max_pa / 1e3:g} kPa"
        passed = "" if fem.self_contact == "end" else f", self_contact: {fem.self_contact}"
        sentences.append(
            f"The study has no 'fem' block; the check used {{kind: {fem.kind}, {limit}{passed}}}, which covers the "
            "meta-model's data and the task."
        )
    surrogate = first.surrogate
    if surrogate is not None and not context.build("surrogate", surrogate).needs_fem():
        default = context.registry.get("surrogate", DEFAULT_SURROGATE).config_model()
        changes["surrogate"] = default(kind=DEFAULT_SURROGATE)
        sentences.append(
            f"The study's surrogate '{surrogate.kind}' states a law or has data of its own; the check fits "
            f"'{DEFAULT_SURROGATE}' to FEM instead."
        )
    return [study.model_copy(update=changes) for study in studies], sentences


def default_fem(context: RunContext, studies: Sequence[Study]) -> FemConfig:
    """Return an FEM block for designs of a meta-model's table that covers the table and the studies' tasks.

    Contact between walls is treated as in the table.
    """
    family: ActuatorFamily = context.build("family", studies[0].need("family", "FEM"))
    data = solved_designs(context, studies[0]).designs.data
    lateral = [  # in the states that vary these axes
        float(np.abs(one.deformation[one.explored == axis, k]).max())
        for one in data
        for k, axis in enumerate(one.axes)
        if axis != one.main_axis and np.any(one.explored == axis)
    ]
    treated = {PASSED: "pass", TOUCHING: "solve"}
    seen = [how for status, how in treated.items() if any(np.any(one.status == status) for one in data)]
    block = {
        "kind": DEFAULT_FEM,
        "self_contact": (*seen, "end")[0],
        **_limits(family.actuation, data, studies),
    }
    if lateral:
        block["lateral_angle_rad"] = max(lateral)
    made: Any = context.registry.get("fem", DEFAULT_FEM).config_model().model_validate(block)
    config: FemConfig = made
    return config


def _limits(actuation: str, data: Sequence[ModuleData], studies: Sequence[Study]) -> dict[str, Any]:
    """Return the keys of an FEM block that bound each input: its kind's own key if it has one."""
    found: dict[str, Any] = {}
    for column, name in enumerate(split_actuation_names(actuation)):
        kind = actuation_kind(name)
        solved = (float(one.actuation.reshape(len(one), -1)[:, column].max()) for one in data)
        most = max(*solved, *(_driven(study, kind) for study in studies))
        if kind.limit:
            found[kind.limit] = max(most, found.get(kind.limit, 0.0))
        else:
            found.setdefault("limits", {})[name] = most
    return found


def _driven(study: Study, kind: ActuationKind) -> float:
    """Return the largest actuation of a kind that the task applies to a module, including noise and margin."""
    task = study.noisy_task()
    own = [float(getattr(task, kind.name, None) or 0.0)]
    own += [level for name, level in (getattr(task, "inputs", None) or {}).items() if kind.matches(name)]
    full = max(abs(level) for level in own)
    noise = float(getattr(getattr(task, "noise", None), kind.name, 0.0))
    segments = study.chain.as_segments() if study.chain is not None else ()
    return MARGIN * (full + noise) * max((segment.actuation_share for segment in segments), default=1.0)
