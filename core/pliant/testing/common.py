"""Checks that every component passes: its config, its example, its manifest entry."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.effect import Effect, EffectConfig
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.fem import FEMBackend, FemConfig
from pliant.interfaces.material import Material, MaterialConfig
from pliant.interfaces.meta_model import MetaModel, MetaModelConfig
from pliant.interfaces.optimizer import Optimizer, OptimizerConfig
from pliant.interfaces.physics import PhysicsBackend, PhysicsConfig
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.interfaces.task import SceneTask, Task, TaskConfig
from pliant.interfaces.viewer import Viewer, ViewerConfig
from pliant.registry.discovery import discover
from pliant.registry.files import FILE_MODULE
from pliant.testing.suite import Subject, Suite, require
from pliant.units import UNIT_SUFFIXES, Quantity

suite = Suite("common")

BASES: dict[str, tuple[type[ComponentConfig], type[Any] | tuple[type[Any], ...]]] = {
    "family": (FamilyConfig, ActuatorFamily),
    "material": (MaterialConfig, Material),
    "fem": (FemConfig, FEMBackend),
    "surrogate": (SurrogateConfig, Surrogate),
    "meta_model": (MetaModelConfig, MetaModel),
    "effect": (EffectConfig, Effect),
    "physics": (PhysicsConfig, PhysicsBackend),
    "task": (TaskConfig, (Task, SceneTask)),
    "optimizer": (OptimizerConfig, Optimizer),
    "viewer": (ViewerConfig, Viewer),
}
HEAVY = (
    "skfem",
    "ngsolve",
    "mujoco",
    "pybullet",
    "pypardiso",
    "torch",
    "jax",
    "tensorflow",
    "sklearn",
    "cma",
    "optuna",
    "trimesh",
    "meshio",
    "numba",
    "matplotlib",
)


@suite.check("the config model subclasses its interface's config (`FamilyConfig`, `FemConfig`, …).")
def config_subclasses_the_interface(subject: Subject) -> None:
    base, _ = BASES[subject.component.interface]
    require(
        issubclass(subject.model, base),
        f"{subject.model.__name__} is no {base.__name__}: the study would take it for another block",
    )


@suite.check('`kind: Literal["mine"] = "mine"` narrows the config to the kind that the manifest names.')
def config_names_its_kind(subject: Subject) -> None:
    kind = subject.component.kind
    field = subject.model.model_fields["kind"]
    require(
        get_args(field.annotation) == (kind,),
        f"{subject.model.__name__}.kind is {field.annotation}, not Literal['{kind}']",
    )
    require(
        field.default == kind,
        f"{subject.model.__name__}.kind has the default {field.default!r}, not '{kind}'",
    )


@suite.check("the manifest's `example` is a valid block, with `kind` left out.")
def example_is_valid(subject: Subject) -> None:
    require("kind" not in subject.component.example, "the example holds 'kind'; leave it out")
    try:
        subject.config  # noqa: B018 - validating is the test
    except ValidationError as error:
        raise_from = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        require(False, f"the example does not validate: {raise_from}")


@suite.check("configs are strict: an unknown key is an error, so that a typing mistake is never silent.")
def config_refuses_unknown_keys(subject: Subject) -> None:
    values = {**subject.config.model_dump(), "no_such_key": 1}
    try:
        subject.model.model_validate(values)
    except ValidationError:
        return
    require(
        False, "the unknown key 'no_such_key' was accepted: model_config was replaced without extra='forbid'"
    )


@suite.check("configs are frozen: what provenance stores is what ran.")
def config_is_frozen(subject: Subject) -> None:
    config = subject.config
    for name in subject.model.model_fields:
        try:
            setattr(config, name, getattr(config, name))
        except ValidationError:
            continue
        require(False, f"field '{name}' could be assigned: model_config was replaced without frozen=True")


@suite.check("`canonical()` gives JSON values under SI names, and validating them gives the same config.")
def config_survives_json(subject: Subject) -> None:
    for config in (subject.config, subject.plain_config):
        text = json.dumps(config.canonical(), allow_nan=False)
        again = subject.model.model_validate(json.loads(text))
        require(
            again.canonical() == config.canonical(),
            "the config read back from its own JSON differs: a field's serialised form is not one it accepts",
        )


@suite.check("a quantity's field is named with its SI unit (`wall_m`, `pressure_pa`).")
def quantities_carry_their_unit(subject: Subject) -> None:
    for name, annotation, metadata in _fields(subject.model):
        for unit in {q.unit for q in _quantities((annotation, *metadata))} - {"dimensionless"}:
            suffixes = [suffix for suffix, u in UNIT_SUFFIXES.items() if u == unit]
            require(
                any(name.endswith(suffix) for suffix in suffixes),
                f"field '{name}' is a quantity in {unit} but does not end in {' or '.join(suffixes)}",
            )


@suite.check("the config's module is light: it is imported whenever any study is read.")
def config_imports_nothing_heavy(subject: Subject) -> None:
    component = subject.component
    forbidden = sorted(
        {*HEAVY, *(module.partition(".")[0] for module in (*component.requires, *component.lazy))}
    )
    module = component.config.partition(":")[0]
    imported, error = _imports(module)[module]
    require(not error, f"{module} cannot be imported in a fresh interpreter: {error}")
    heavy = [name for name in forbidden if name in imported]
    require(
        not heavy, f"{module} imports {', '.join(heavy)}: move that import to the implementation's module"
    )


# Prints a line for each statement given: the top-level names that an interpreter imports for it, and the error.
FRESH = """
import json, os, sys
sys.path[:0], statements = json.loads(sys.argv[1])
before = set(sys.modules)
import pliant.registry.component
def report(statement):
    error = ""
    try:
        exec(statement)
    except BaseException as raised:
        error = f"{type(raised).__name__}: {raised}"
    print(json.dumps([sorted(m for m in set(sys.modules) - before if "." not in m), error]), flush=True)
for statement in statements:
    if len(statements) == 1:
        report(statement)
    elif (child := os.fork()) == 0:
        report(statement)
        os._exit(0)
    else:
        os.waitpid(child, 0)
"""
_KNOWN: dict[str, tuple[set[str], str]] = {}


def _imports(module: str) -> dict[str, tuple[set[str], str]]:
    """Module → what a fresh interpreter imports for it and the error, for this one and the configs of its package.

    One interpreter serves the whole package where processes can be forked: a start takes longer than all the rest.
    """
    if module not in _KNOWN:
        top = module.partition(".")[0]
        siblings = (
            {c.config.partition(":")[0] for c in discover().components} if hasattr(os, "fork") else set()
        )
        asked = sorted({module, *(name for name in siblings if name.partition(".")[0] == top)} - set(_KNOWN))
        given = json.dumps([sys.path, [_import_of(name) for name in asked]])
        done = subprocess.run(
            [sys.executable, "-c", FRESH, given], capture_output=True, text=True, check=False
        )
        for name, line in zip(asked, done.stdout.splitlines(), strict=True):
            imported, error = json.loads(line)
            _KNOWN[name] = (set(imported), error)
    return _KNOWN


def _import_of(module: str) -> str:
    """How a fresh interpreter gets at a module: by its name, or as the file that `plugins` lists."""
    if not module.startswith(FILE_MODULE):
        return f"import {module}"
    file = sys.modules[module].__file__
    return f"import pathlib, pliant.registry.files as files; files.components_of(pathlib.Path({file!r}))"


@suite.check("the implementation is a concrete subclass of its interface, built by `Class(config)`.")
def implementation_fills_the_interface(subject: Subject) -> None:
    bases = _implementations(subject)
    built = subject.build()
    names = " or ".join(base.__name__ for base in bases)
    require(isinstance(built, bases), f"{type(built).__name__} does not subclass {names}")
    require(
        getattr(built, "config", None) is not None,
        f"{type(built).__name__} has no `config`: call super().__init__(config)",
    )


@suite.check("building reads the config and never changes it.")
def building_leaves_the_config_alone(subject: Subject) -> None:
    config = subject.config
    before = json.dumps(config.canonical(), sort_keys=True)
    built = subject.build(config)
    after = json.dumps(config.canonical(), sort_keys=True)
    require(after == before, f"the config changed from {before} to {after} when the component was built")
    require(
        json.dumps(built.config.canonical(), sort_keys=True) == before,
        "the built component carries another config than the one it was given",
    )


@suite.check("`summary` is one line for `pliant plugins`; config and implementation have docstrings.")
def describes_itself(subject: Subject) -> None:
    summary = subject.component.summary
    require(summary.strip() and "\n" not in summary, f"the summary is {summary!r}, not one line")
    inherited = {base.__doc__ for base in (BASES[subject.component.interface][0], *_implementations(subject))}
    for thing in (subject.model, type(subject.build())):
        own = thing.__dict__.get("__doc__")
        require(own and own not in inherited, f"{thing.__name__} has no docstring of its own")


def _implementations(subject: Subject) -> tuple[type[Any], ...]:
    """The classes of which a component's implementation subclasses one."""
    base = BASES[subject.component.interface][1]
    return base if isinstance(base, tuple) else (base,)


def _fields(model: type[BaseModel]) -> Iterator[tuple[str, Any, tuple[Any, ...]]]:
    for name, field in model.model_fields.items():
        yield name, field.annotation, tuple(field.metadata)


def _quantities(items: tuple[Any, ...]) -> Iterator[Quantity]:
    """Quantity annotations anywhere inside annotations such as `tuple[Length, ...] | None`."""
    for item in items:
        if isinstance(item, Quantity):
            yield item
        else:
            yield from _quantities((*get_args(item), *getattr(item, "__metadata__", ())))


def quantity_of(model: type[BaseModel], name: str) -> Quantity | None:
    """The quantity of a field, or None where it is a plain number, text or block."""
    field = model.model_fields[name]
    return next(_quantities((field.annotation, *field.metadata)), None)
