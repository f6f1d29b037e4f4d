"""Conformance suites for plugin authors: the clauses of the contracts as checks that name the likely cause.

Each interface has a module of checks, and this one runs them in stages; `parametrize_with_checks` makes one test of
each component. `samples`, `box` and `stand_ins` are the laws, chains, problems and small implementations that checks
and tests use.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import re
import time
import traceback
import unittest
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Concatenate, Literal, ParamSpec, TypeVar

import numpy as np
from pydantic import ValidationError

from pliant.config.problems import sentences
from pliant.errors import (
    ContractError,
    MissingDependencyError,
    PliantError,
    PluginFailureError,
    UserError,
    closest,
)
from pliant.execution.progress import Progress, Silent, open_progress_bar
from pliant.interfaces.base import ComponentConfig, FrozenModel
from pliant.registry.component import Component
from pliant.registry.discovery import CHAIN
from pliant.registry.interface import interfaces

T = TypeVar("T")
P = ParamSpec("P")


class CheckFailure(ContractError, AssertionError):  # noqa: N818 - it is what a test reports
    """Failure of a component's contract; the message names component, finding, cause and clause.

    `raised_at` is the origin of an error in the plugin's code, (type, file, line), if there was one; for a refused
    config the error in the config replaces the file.
    """

    raised_at: tuple[str, str, int] | None = None


class CheckSkipped(unittest.SkipTest):
    """A check that does not apply or cannot run here; pytest reports it as skipped, with the cause."""


class Finding(Exception):  # noqa: N818 - raised by checks only, turned into `CheckFailure`
    """Finding of a check and its likely cause."""


def require(condition: object, finding: str) -> None:
    """Raise `Finding` unless the condition is true."""
    if not condition:
        raise Finding(finding)


def agree(got: Any, wanted: Any, finding: str, rtol: float = 0.0, atol: float = 0.0) -> None:
    """Raise `Finding` with the largest difference unless ``|got − wanted| ≤ atol + rtol · max|wanted|``.

    `wanted` may be one number for all of `got`.
    """
    a, b = np.asarray(got, float), np.asarray(wanted, float)
    require(b.ndim == 0 or a.shape == b.shape, f"{finding} (shape {a.shape} instead of {b.shape})")
    require(np.all(np.isfinite(a)), f"{finding} (not all values are finite)")
    if a.size == 0:
        return
    limit = atol + rtol * float(np.abs(b).max())
    b = np.broadcast_to(b, a.shape)
    worst = np.unravel_index(int(np.abs(a - b).argmax()), a.shape)
    numbers = f"(got {a[worst]:.9g}, expected {b[worst]:.9g}, allowed difference {limit:.2g})"
    require(abs(a[worst] - b[worst]) <= limit, f"{finding} {numbers}")


def require_refused(
    call: Callable[[], object],
    accepted: str,
    says: str = "",
    what: str = "cause",
    error: type[Exception] = UserError,
) -> None:
    """Raise `Finding` unless the call raises this error with a message that matches the pattern `says`.

    `accepted` is the finding if the call succeeds; `what` names the part that a message without the pattern lacks.
    """
    try:
        call()
    except MissingDependencyError:  # not an answer to the check
        raise
    except error as raised:
        require(re.search(says, str(raised)), f"the message names no {what}: '{raised}'")
        return
    raise Finding(accepted)


@dataclass(eq=False)
class Subject:
    """The component under test, its config and results shared by several checks.

    Attributes:
        component: as a plugin's manifest declares it.
        changes: keys of its config, in a study's notation, that every config under test has.
        shared: results of functions under `once`.
    """

    component: Component
    changes: Mapping[str, Any] = field(default_factory=dict)
    shared: dict[Any, Any] = field(default_factory=dict)

    @property
    def model(self) -> type[ComponentConfig]:
        """The component's config model."""
        return self.component.config_model()

    @property
    def config(self) -> ComponentConfig:
        """The config of the component's example."""
        return self.configured({})

    @property
    def plain_config(self) -> ComponentConfig:
        """Return the config with every default, or that of the example if a key is mandatory."""
        try:
            return self.model.model_validate({"kind": self.component.kind, **self.changes})
        except ValueError:
            return self.config

    def configured(self, changes: Mapping[str, Any]) -> ComponentConfig:
        """Return the example's config with some fields replaced; keys are field names."""
        component = replace(self.component, example={**self._unchanged(), **self.changes})
        example = {"kind": component.kind, **component.smallest_block()}
        values = {**self.model.model_validate(example).model_dump(), **changes}
        return self.model.model_validate(values)

    def _unchanged(self) -> dict[str, Any]:
        """Return the other keys of the manifest's example; a key may be written with its unit or without."""
        names = {
            key: name
            for name, info in self.model.model_fields.items()
            for key in (name, info.validation_alias)
            if isinstance(key, str)
        }
        changed = {names.get(key, key) for key in self.changes}
        return {
            key: value for key, value in self.component.example.items() if names.get(key, key) not in changed
        }

    def build(self, config: ComponentConfig | None = None) -> Any:
        """Return a new instance of the component, with the example's config by default."""
        return self.component.build(self.config if config is None else config)


def once(make: Callable[Concatenate[Subject, P], T]) -> Callable[Concatenate[Subject, P], T]:
    """Decorate a function of a subject (and further hashable arguments) to cache its result for later checks."""

    @functools.wraps(make)
    def shared(subject: Subject, *args: P.args, **kwargs: P.kwargs) -> T:
        key = (make.__module__, make.__name__, *args, *kwargs.items())
        if key not in subject.shared:
            subject.shared[key] = make(subject, *args, **kwargs)
        result: T = subject.shared[key]
        return result

    return shared


CheckFunction = Callable[[Subject], None]
Status = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class CheckOutcome:
    """Outcome of one check; `message` is "" if it passed."""

    interface: str
    kind: str
    name: str
    status: Status
    message: str
    wall_s: float


@dataclass(frozen=True)
class ConformanceCheck:
    """One clause of an interface's contract as a function that raises if it is broken.

    `declares` marks the first stage: manifest, config, signature. If such a clause is broken the rest is not run.
    """

    interface: str
    name: str
    clause: str
    function: CheckFunction
    declares: bool = False

    def run(self, subject: Subject) -> None:
        """Raise `CheckFailure` if the clause is broken, `CheckSkipped` if it cannot be checked here."""
        try:
            try:
                self.function(subject)
            except PluginFailureError as refused:  # a raised error has a place
                raise refused.raised or refused from None
        except CheckSkipped:
            raise
        except MissingDependencyError as error:
            raise CheckSkipped(str(error)) from None
        except Finding as finding:
            raise self._failure(subject, str(finding)) from finding
        except ValidationError as error:
            seen = _refusal(subject, error)
            failure = self._failure(subject, seen)
            failure.raised_at = ("ValidationError", seen, 0)
            raise failure from None
        except Exception as error:  # any exception of a plugin is its failure, not the suite's
            name, text = type(error).__name__, " ".join(str(error).split()) or "without a message"
            function, file, line = _raised_at(subject, error)
            # Its place only if it was not raised on purpose.
            where = "" if isinstance(error, PliantError) else f" in {function} ({file}:{line})"
            failure = self._failure(subject, f"it raised {name}{where}: {text}")
            failure.raised_at = (name, file, line)
            raise failure from error

    def _failure(self, subject: Subject, seen: str) -> CheckFailure:
        seen = seen.removesuffix(".")
        return CheckFailure(
            f"{subject.component.label} fails '{self.name}': {seen}. The contract: {self.clause}"
        )


def _raised_at(subject: Subject, error: Exception) -> tuple[str, str, int]:
    """Return the last line of the plugin's package in an error's traceback, else the last: function, file, line."""
    package = subject.component.implementation.partition(":")[0].partition(".")[0]
    frames = list(traceback.walk_tb(error.__traceback__))
    own = [at for at in frames if at[0].f_globals.get("__name__", "").partition(".")[0] == package]
    frame, line = (own or frames)[-1]
    return frame.f_code.co_name, frame.f_code.co_filename, line


def _refusal(subject: Subject, error: ValidationError) -> str:
    """Return the errors in a block that its model refused, in the sentences for a study."""
    model = subject.model if error.title == subject.model.__name__ else FrozenModel
    lines = sentences(error, model, lambda path: "", (subject.component.interface,)).splitlines()
    return f"{error.title} refuses its block: {' '.join(lines)}"


def declared(function: CheckFunction) -> CheckFunction:
    """Mark a check of the first stage."""
    vars(function)["declares"] = True
    return function


def remarked(function: CheckFunction) -> CheckFunction:
    """Mark a common check whose failure stops no other check."""
    vars(function)["declares"] = False
    return function


def checks_for(interface: str) -> tuple[ConformanceCheck, ...]:
    """Return all checks of an interface: those of the first stage, the common ones before its own, then the rest.

    A check is a public function ``(subject: Subject) -> None`` of such a module; its docstring is a clause.
    """
    every = []
    common = "pliant.testing.common"
    for place in (common, *interfaces()[interface].checks):
        module = importlib.import_module(place)
        for name, function in vars(module).items():
            own = inspect.isfunction(function) and function.__module__ == module.__name__
            if (
                own
                and name[0] != "_"
                and function.__annotations__ == {"subject": "Subject", "return": "None"}
            ):
                first = bool(vars(function).get("declares", place == common))
                every.append(
                    ConformanceCheck(
                        interface, name, inspect.cleandoc(function.__doc__ or ""), function, first
                    )
                )
    return tuple(sorted(every, key=lambda check: not check.declares))


def run_checks(
    component: Component,
    progress: Progress | None = None,
    *,
    changes: Mapping[str, Any] | None = None,
    clauses: Collection[str] = (),
) -> list[CheckOutcome]:
    """Run a component's suite in stages; never raise for a failure of the component.

    A broken clause of the first stage (manifest, config, signature; for a family its elements) stops the rest, and a
    failure by the same line of the plugin as an earlier check is not counted again: such checks are skipped with the
    name of the check that states the cause.

    Args:
        component: under test.
        progress: notified of each check.
        changes: keys of its config, in a study's notation, that every config under test has.
        clauses: names of the checks to run; all by default.

    Raises:
        UserError: a clause that the interface does not have, or changes that the config refuses.
    """
    subject, checks = Subject(component, changes or {}), checks_for(component.interface)
    names = [check.name for check in checks]
    for clause in clauses:
        if clause not in names:
            raise UserError(
                f"{component.interface} has no clause '{clause}'{closest(clause, names)} Clauses: {', '.join(names)}."
            )
    checks = tuple(check for check in checks if not clauses or check.name in clauses)
    _require_changes(subject)
    outcomes: list[CheckOutcome] = []
    first = ""
    causes: dict[tuple[str, str, int], str] = {}
    with open_progress_bar(progress or Silent(), "checks", len(checks)) as bar:
        for check in checks:
            bar.describe(check.name)
            started = time.perf_counter()
            status: Status = "passed"
            message = ""
            try:
                if first:
                    raise CheckSkipped(f"not run: '{first}' fails first")
                if component.interface == "effect" and CHAIN not in component.models and not check.declares:
                    raise CheckSkipped(
                        "not run: its samples are chains, and the effect is of a user's own model"
                    )
                check.run(subject)
            except CheckSkipped as skipped:
                status, message = "skipped", str(skipped)
            except CheckFailure as failure:
                status, message = "failed", str(failure)
                place = failure.raised_at
                if place and causes.setdefault(place, check.name) != check.name:
                    status, message = "skipped", f"it fails where '{causes[place]}' does"
                first = check.name if check.declares and status == "failed" else ""
            wall_s = time.perf_counter() - started
            outcomes.append(
                CheckOutcome(check.interface, component.kind, check.name, status, message, wall_s)
            )
            bar.advance()
    return outcomes


def _require_changes(subject: Subject) -> None:
    """Raise `UserError` for changes that the config refuses; without changes the suite reports the error."""
    if not subject.changes:
        return
    try:
        subject.config  # noqa: B018 - validating is the test
    except ValidationError as error:
        lines = sentences(error, subject.model, lambda path: "", (subject.component.interface,)).splitlines()
        raise UserError(f"{subject.component.label}: {' '.join(lines)}") from None


def check_component(component: Component, interface: str | None = None) -> None:
    """Run a component's suite in stages and raise `CheckFailure` with a sentence for each cause.

    Raises `CheckSkipped` with the cause if its package's requirements are not installed, and `CheckFailure`
    if the component is not of the given `interface`.
    """
    if interface not in (None, component.interface):
        raise CheckFailure(f"{component.label} is no {interface}: use the suite of its own interface.")
    missing = component.missing()
    if missing is not None:
        raise CheckSkipped(f"{component.label} needs {missing}: {component.install or 'install it'}")
    failed = [outcome.message for outcome in run_checks(component) if outcome.status == "failed"]
    if failed:
        raise CheckFailure("\n".join(failed))


# Argument of a test by `parametrize_with_checks`, which the test calls.
BoundCheck = Callable[[], None]


def parametrize_with_checks(components: Iterable[Component]) -> Any:
    """Parametrize a test by components: one test runs the suite of one of them, in stages.

    ::

        @parametrize_with_checks(pliant_components())
        def test_conformance(check):
            check()

    Ids read physics-quasistatic; a missing dependency skips with its cause, a failure has a sentence for each cause.
    """
    import pytest  # only tests need it

    every = list(components)
    checks: list[BoundCheck] = [functools.partial(check_component, component) for component in every]
    return pytest.mark.parametrize("check", checks, ids=[f"{c.interface}-{c.kind}" for c in every])


# One name per interface: the whole suite for a component of this interface.
check_family = functools.partial(check_component, interface="family")
check_material = functools.partial(check_component, interface="material")
check_fem = functools.partial(check_component, interface="fem")
check_surrogate = functools.partial(check_component, interface="surrogate")
check_meta_model = functools.partial(check_component, interface="meta_model")
check_effect = functools.partial(check_component, interface="effect")
check_physics = functools.partial(check_component, interface="physics")
check_task = functools.partial(check_component, interface="task")
check_optimizer = functools.partial(check_component, interface="optimizer")
check_viewer = functools.partial(check_component, interface="viewer")
