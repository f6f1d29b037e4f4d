"""Checks that every component passes: its config, its example, its manifest entry."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import partial
from typing import get_args

from pydantic import ValidationError

from pliant.errors import InvalidDesignError
from pliant.registry.discovery import CHAIN, discover
from pliant.registry.files import FILE_MODULE
from pliant.registry.interface import interfaces
from pliant.testing import Finding, Subject, remarked, require, require_refused
from pliant.units import UNIT_SUFFIXES, quantities_in

HEAVY = """
    cma jax matplotlib meshio mujoco ngsolve numba optuna pybullet pypardiso skfem sklearn tensorflow torch
    trimesh
"""


def config_subclasses_the_interface(subject: Subject) -> None:
    """the config model subclasses its interface's config (`FamilyConfig`, `FemConfig`, …)."""
    subject.component.config_model()


def config_names_its_kind(subject: Subject) -> None:
    """`kind: Literal["mine"] = "mine"` narrows the config to the kind that the manifest names."""
    kind, whose = subject.component.kind, f"{subject.model.__name__}.kind"
    field = subject.model.model_fields["kind"]
    # Effects of users' own models: `kind: str = effect_kind("mine")`, with names of places behind it.
    open_ended = field.annotation is str and CHAIN not in subject.component.models
    narrow = open_ended or get_args(field.annotation) == (kind,)
    require(narrow, f"{whose} is {field.annotation}, not Literal['{kind}']")
    require(field.default == kind, f"{whose} has the default {field.default!r}, not '{kind}'")


def example_is_valid(subject: Subject) -> None:
    """the manifest's `example` is a valid block, with `kind` left out."""
    require("kind" not in subject.component.smallest_block(), "the example holds 'kind'; leave it out")
    subject.config  # noqa: B018 - validating is the test


def config_refuses_unknown_keys(subject: Subject) -> None:
    """configs are strict: an unknown key is an error, so that a typing mistake is never silent."""
    require_refused(
        lambda: subject.model.model_validate({**subject.config.model_dump(), "no_such_key": 1}),
        "the unknown key 'no_such_key' was accepted: model_config was replaced without extra='forbid'",
        error=ValidationError,
    )


def config_is_frozen(subject: Subject) -> None:
    """configs are frozen, so that provenance stores the config that ran."""
    config = subject.config
    for name in subject.model.model_fields:
        require_refused(
            partial(setattr, config, name, getattr(config, name)),
            f"field '{name}' could be assigned: model_config was replaced without frozen=True",
            error=ValidationError,
        )


def config_survives_json(subject: Subject) -> None:
    """`canonical()` gives JSON values under SI names, and validating them gives the same config."""
    for config in (subject.config, subject.plain_config):
        again = subject.model.model_validate(json.loads(json.dumps(config.canonical(), allow_nan=False)))
        require(
            again.canonical() == config.canonical(),
            "the config read back from its own JSON differs: a field's serialised form is not one it accepts",
        )


def quantities_carry_their_unit(subject: Subject) -> None:
    """a quantity's field is named with its SI unit (`wall_m`, `pressure_pa`)."""
    for name, field in subject.model.model_fields.items():
        for unit in {q.unit for q in quantities_in(field.annotation, *field.metadata)} - {"dimensionless"}:
            suffixes = tuple(suffix for suffix, u in UNIT_SUFFIXES.items() if u == unit)
            ends = f"does not end in {' or '.join(suffixes)}"
            require(name.endswith(suffixes), f"field '{name}' is a quantity in {unit} but {ends}")


def config_imports_nothing_heavy(subject: Subject) -> None:
    """the config's module is light: it is imported whenever any study is read."""
    component = subject.component
    own = {module.partition(".")[0] for module in (*component.requires, *component.lazy)}
    module = component.config.partition(":")[0]
    imported, error = _imports(module)
    require(not error, f"{module} cannot be imported in a fresh interpreter: {error}")
    heavy = ", ".join(sorted(imported & {*HEAVY.split(), *own}))
    require(not heavy, f"{module} imports {heavy}: move that import to the implementation's module")


# Prints a line for each given statement: the top-level names that an interpreter imports for it, and the error.
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


def _imports(module: str) -> tuple[set[str], str]:
    """Return the imports of a fresh interpreter for a module, and the error.

    If processes can be forked, one interpreter serves the configs of the whole package, since its start takes longest.
    """
    if module not in _KNOWN:
        top = module.partition(".")[0]
        others = {c.config.partition(":")[0] for c in discover().components} if hasattr(os, "fork") else set()
        asked = sorted({module, *(name for name in others if name.partition(".")[0] == top)} - set(_KNOWN))
        given = json.dumps([sys.path, [_import_statement(name) for name in asked]])
        command = [sys.executable, "-c", FRESH, given]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        for name, line in zip(asked, done.stdout.splitlines(), strict=True):
            imported, error = json.loads(line)
            _KNOWN[name] = (set(imported), error)
    return _KNOWN[module]


def _import_statement(module: str) -> str:
    """Return the import statement of a module in a fresh interpreter: by its name, or as a file of `plugins`."""
    if not module.startswith(FILE_MODULE):
        return f"import {module}"
    file = sys.modules[module].__file__
    return f"import pathlib, pliant.registry.files as files; files.load_components(pathlib.Path({file!r}))"


def implementation_fills_the_interface(subject: Subject) -> None:
    """the implementation is a concrete subclass of its interface, built by `Class(config)`."""
    bases = interfaces()[subject.component.interface].base_classes()
    try:
        built = subject.build()
    except InvalidDesignError as error:
        raise Finding(f"the design that its manifest states as the example is refused: {error}") from error
    name = type(built).__name__
    names = " or ".join(base.__name__ for base in bases)
    require(isinstance(built, bases), f"{name} does not subclass {names}")
    require(
        getattr(built, "config", None) is not None, f"{name} has no `config`: call super().__init__(config)"
    )


def building_leaves_the_config_alone(subject: Subject) -> None:
    """building reads the config and never changes it."""
    config = subject.config
    before = config.canonical()
    built = subject.build(config)
    now = config.canonical()
    require(now == before, f"the config changed from {before} to {now} when the component was built")
    require(
        built.config.canonical() == before, "the built component carries another config than it was given"
    )


@remarked
def describes_itself(subject: Subject) -> None:
    """`summary` is one line for `pliant plugins`; config and implementation have docstrings."""
    component = subject.component
    summary = component.summary
    require(summary.strip() and "\n" not in summary, f"the summary is {summary!r}, not one line")
    interface = interfaces()[component.interface]
    bases = (interface.config_class(), *interface.base_classes())
    for thing in (subject.model, type(subject.build())):
        own = thing.__dict__.get("__doc__")
        require(
            own and own not in {base.__doc__ for base in bases},
            f"{thing.__name__} has no docstring of its own",
        )
