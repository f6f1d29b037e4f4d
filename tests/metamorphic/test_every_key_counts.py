"""Every number and choice of every example study changes an answer, is refused, or is named as unused.

A study's keys are tested with the verb that reads them: the simulation, the comparison where there is a recording,
FEM, and the search. Defaults are tested too; `LIMITS` are those that bound values which these studies do not reach.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import pytest
from tests.metamorphic.every_key import (
    EXAMPLES,
    STATED,
    Perturbed,
    compared,
    perturbed_keys,
    searched,
    silent_keys,
    simulated,
    solved,
)

from pliant.config.loading import load_study
from pliant.config.study import Study
from pliant.evidence.opening import read_study_measurement
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore
from pliant_search.optimizer import OptimizerConfig

# Blocks by the verb that reads them.
OF_A_SIMULATION = ("chain", "physics", "task", "effects", "surrogate", "meta_model", "noise", "uncertainty")
OF_A_DESIGN = ("family", "material")
OF_FEM = ("fem", "sweep")
OF_A_SEARCH = ("search", "optimizer")
OF_A_RECORDING = ("law_error", "measurements", "protocols", "posterior")
# Defaults that bound values which these studies do not reach, or belong to absent parts: no value changes anything.
LIMITS = {
    "position": "a grasp places its fingers; a base that is stated is named",
    "smallest_step": "the equilibrium is found in whole steps",
    "longest_step": "nothing moves in time",
    "outside_domain": "no joint leaves the data of its law",
    "force_max": "refused where a force is given",
    "max_turn": "of steps that are smaller",
    "error": "the first states reach it",
    "max_states": "fewer states reach the wanted error",
    "lateral_angle": "of modules with several axes",
    "lateral_states": "of modules with several axes",
    "coupling_states": "of modules with several axes",
    "self_contact": "walls that touch: tests/fem/test_contact.py",
    "max_iterations": "fewer steps converge",
    "max_halvings": "no step is halved",
    "restarts": "the budget ends before",
    "over_conditions": "there is one condition",
    "extrapolate": "the design is inside the solved ones",
    "weight": "no weights are added",
    "seed": "nothing is drawn",
    "angle_power": "a form of an effect at its neutral strength",
}
# MuJoCo's own numbers: of motion in time and of contacts; equilibria do not depend on them.
OF_MOTION = ("timestep", "joint_damping", "drag_1", "tolerance", "settle_timestep", "max_settle_steps")
OF_CONTACT = ("contact_timestep", "near", "contact_stiffness", "contact_damping", "slip_damping")
OF_CONTACT = (*OF_CONTACT, "contact_impedance", "impratio", "noslip_iterations")
LIMITS |= dict.fromkeys(OF_MOTION, "equilibria do not depend on it")
LIMITS |= dict.fromkeys(OF_CONTACT, "of contacts")
# Keys that a study states and on which nothing can depend there.
NOTHING_DEPENDS = {
    ("helix", "surrogate.axes.x.odd"): "m_e of this axis is 0",
    ("helix", "surrogate.axes.z.odd"): "m_e of this axis is 0",
    ("joint", "chain.module_length_m"): "one joint without gravity, read by its angle",
    ("joint", "chain.module_mass_kg"): "one joint without gravity, read by its angle",
}
# Keys that are not tested here, and where they are.
ELSEWHERE = {
    "search.verify": "the winner's direct FEM: tests/search",
    "search.polish": "descents from the best candidates: tests/search/test_polish.py",
    "measurements.max_samples": "more samples than any example has: tests/measurements",
    "model.number_error": "errors of a file's numbers in a diagnosis: tests/pliant_mjcf/test_diagnose_arm.py",
    "measurements.trials": "success counts: tests/pliant_counts",
    "measurements.plausible": "success counts: tests/pliant_counts",
    "fem.self_contact": "the stand-in of the solver has no walls: tests/fem/test_contact.py",
    "bench": "what performs runs: tests/bench",
    "experiment": "limits and budget of a closed loop: tests/bench",
    "printer": "solids to print: tests/pliant_print",
    "solid": "solids to print: tests/pliant_print",
    "mould": "moulds: tests/pliant_print",
    "cross_check": "the same engines as in 'physics'",
    "pliant": "the format's number",
}
# The mesh of this example is written by its script.
MESHED = "cad_file/finger.yaml"
ALL = sorted(path.relative_to(EXAMPLES).as_posix() for path in EXAMPLES.rglob("*.yaml"))


def opened(name: str, context: RunContext, folder: Path | None = None) -> Study:
    """Return the study without engines for comparison; with a folder, its mesh is written there if it needs one."""
    path = EXAMPLES / name
    if name == MESHED and folder is not None:
        pytest.importorskip("netgen")
        for file in ("mesh.py", path.name):
            shutil.copy(path.parent / file, folder)
        subprocess.run([sys.executable, folder / "mesh.py"], check=True, capture_output=True)
        path = folder / path.name
    return load_study(path, context.registry, ["cross_check=[]"], lambda text: None)


def verb_examples(verb: str) -> list[str]:
    """Return the examples that a verb reads."""
    registry = discover()
    found = []
    for name in ALL:
        study = load_study(EXAMPLES / name, registry, (), lambda text: None)
        reads = {
            "simulate": study.chain is not None and study.task is not None,
            "fem": study.fem is not None and study.family is not None,
            "search": study.search is not None,
            "compare": study.measurements is not None and study.chain is not None and "counts" not in name,
        }
        if reads[verb]:
            found.append(name)
    return found


def unexplained(name: str, found: Iterable[Perturbed]) -> list[str]:
    """Return the keys whose lack of effect is not explained."""
    left = []
    for key in found:
        dotted = ".".join(map(str, key.path))
        limit = key.written in LIMITS and not key.stated
        reason = (Path(name).stem, dotted) in NOTHING_DEPENDS or any(
            dotted.startswith(one) for one in ELSEWHERE
        )
        if not (limit or reason):
            left.append(dotted)
    return left


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> RunContext:
    """Return one store for all studies."""
    return RunContext(discover(), ArtifactStore(tmp_path_factory.mktemp("every_key")))


FAST = ("data/bellow_translational.yaml", "next_experiment/finger.yaml", "tendon_finger/finger.yaml")
SIMULATED = verb_examples("simulate")
HEAVY = pytest.mark.skipif("PLIANT_METAMORPHIC" not in os.environ, reason="minutes: run by make metamorphic")


@pytest.mark.parametrize(
    "name", [one if one in FAST else pytest.param(one, marks=HEAVY) for one in SIMULATED]
)
def test_every_simulation_key_counts(name: str, context: RunContext, tmp_path: Path) -> None:
    study = opened(name, context, tmp_path)
    if study.fem is not None or (study.meta_model is not None and name != "designs/unseen.yaml"):
        # The stages after FEM, with a law that needs none; FEM and its keys are tested below.
        law = context.registry.get("surrogate", "polynomial").config_model().model_validate(with_input(study))
        study = study.model_copy(update={"surrogate": law, "meta_model": None, "search": None})
    found = silent_keys(study, (*OF_A_SIMULATION, *OF_A_DESIGN), partial(simulated, context=context))
    assert unexplained(name, found) == []


def with_input(study: Study) -> dict[str, object]:
    """Return the stated law, of a pressure or of a tendon."""
    tendon = study.family is not None and study.family.kind == "tendon_joint"
    return {**STATED, "actuation_name": "tendon_force_n" if tendon else "pressure_pa"}


@HEAVY
@pytest.mark.parametrize("name", verb_examples("fem"))
def test_every_fem_key_counts(name: str, context: RunContext, tmp_path: Path) -> None:
    study = opened(name, context, tmp_path)
    found = silent_keys(study, (*OF_FEM, *OF_A_DESIGN), partial(solved, context=context))
    assert unexplained(name, found) == []


@HEAVY
@pytest.mark.parametrize("name", verb_examples("search"))
def test_every_search_key_counts(name: str, context: RunContext) -> None:
    study = opened(name, context)
    assert study.search is not None
    budget = study.search.model_copy(update={"budget": min(study.search.budget, 12), "polish": None})
    study = study.model_copy(update={"search": budget, "optimizer": with_short_batches(study)})
    assert unexplained(name, silent_keys(study, OF_A_SEARCH, partial(searched, context=context))) == []


def with_short_batches(study: Study) -> OptimizerConfig | None:
    """Return the optimizer, one that learns from batches with batches of which a short budget has several."""
    config = study.optimizer
    return config.model_copy(update={"n_steps": 1}) if config is not None and config.kind == "ppo" else config


@pytest.mark.parametrize("name", verb_examples("compare"))
def test_every_comparison_key_counts(name: str, context: RunContext) -> None:
    study = opened(name, context)
    measurement = read_study_measurement(context, study, None)
    answer = partial(compared, context=context, measurement=measurement)
    heads = (*OF_A_RECORDING, *(() if study.task is not None else OF_A_SIMULATION))
    # Values left to defaults, such as the base's position, do not affect angles.
    found = [key for key in silent_keys(study, heads, answer) if key.stated]
    assert unexplained(name, found) == []


def test_every_block_in_an_example_is_read(context: RunContext) -> None:
    heads = {*OF_A_SIMULATION, *OF_A_DESIGN, *OF_FEM, *OF_A_SEARCH, *OF_A_RECORDING}
    for name in ALL:
        for key in perturbed_keys(opened(name, context)):
            dotted = ".".join(map(str, key.path))
            assert key.path[0] in heads or any(dotted.startswith(one) for one in ELSEWHERE), (name, dotted)
