"""What a conformance suite is made of: checks, their subject, outcomes, the failure that names the cause."""

from __future__ import annotations

import contextlib
import importlib
import time
import traceback
import unittest
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar

import numpy as np

from pliant.errors import ContractError, MissingDependencyError, PliantError
from pliant.interfaces.base import ComponentConfig
from pliant.registry.component import Component

T = TypeVar("T")


class CheckFailure(ContractError, AssertionError):  # noqa: N818 - it is what a test reports
    """A component breaks its contract; the message names it, what was seen, why, and the clause."""


class CheckSkipped(unittest.SkipTest):
    """A check that does not apply or cannot run here; pytest reports it as skipped, with the cause."""


class Finding(Exception):  # noqa: N818 - raised by checks only, turned into `CheckFailure`
    """What a check saw and what the likely cause is."""


def require(condition: object, finding: str) -> None:
    """Raise `Finding` unless the condition holds."""
    if not condition:
        raise Finding(finding)


def require_close(got: Any, wanted: Any, finding: str, rtol: float = 0.0, atol: float = 0.0) -> None:
    """Raise `Finding` with the largest difference unless ``|got − wanted| ≤ atol + rtol · max|wanted|``."""
    a, b = np.asarray(got, float), np.asarray(wanted, float)
    require(a.shape == b.shape, f"{finding} (shape {a.shape} instead of {b.shape})")
    require(np.all(np.isfinite(a)), f"{finding} (not all values are finite)")
    if a.size == 0:
        return
    error = np.abs(a - b)
    limit = atol + rtol * float(np.abs(b).max())
    worst = np.unravel_index(int(error.argmax()), error.shape)
    numbers = f"(got {a[worst]:.9g}, expected {b[worst]:.9g}, allowed difference {limit:.2g})"
    require(error.max() <= limit, f"{finding} {numbers}")


@dataclass(eq=False)
class Subject:
    """The component under test, its config and what several checks may share.

    Attributes:
        component: as a plugin's manifest declares it.
        shared: results of `once`, by name.
    """

    component: Component
    shared: dict[str, Any] = field(default_factory=dict)

    @property
    def model(self) -> type[ComponentConfig]:
        """The config model."""
        return self.component.config_model()

    @property
    def config(self) -> ComponentConfig:
        """The config of the component's example."""
        return self.configured({})

    @property
    def plain_config(self) -> ComponentConfig:
        """The config with every default, or that of the example where a key is mandatory."""
        try:
            return self.model.model_validate({"kind": self.component.kind})
        except ValueError:
            return self.config

    def configured(self, changes: Mapping[str, Any]) -> ComponentConfig:
        """The example's config with some fields replaced; keys are field names."""
        values = {**self.model.model_validate(self._example()).model_dump(), **changes}
        return self.model.model_validate(values)

    def build(self, config: ComponentConfig | None = None) -> Any:
        """A new instance."""
        return self.component.build(self.config if config is None else config)

    def once(self, name: str, make: Callable[[], T]) -> T:
        """The shared result of this name, computed by the first check that needs it."""
        if name not in self.shared:
            self.shared[name] = make()
        result: T = self.shared[name]
        return result

    def _example(self) -> dict[str, Any]:
        return {"kind": self.component.kind, **self.component.example}


CheckFunction = Callable[[Subject], None]
Status = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class CheckOutcome:
    """What became of one check; `message` is empty where it passed."""

    interface: str
    kind: str
    name: str
    status: Status
    message: str
    wall_s: float


@dataclass(frozen=True)
class Check:
    """One clause of an interface's contract as a function that raises when it is broken."""

    interface: str
    name: str
    clause: str
    function: CheckFunction

    def run(self, subject: Subject) -> None:
        """Raise `CheckFailure` if the clause is broken, `CheckSkipped` if it cannot be judged here."""
        try:
            self.function(subject)
        except CheckSkipped:
            raise
        except MissingDependencyError as error:
            raise CheckSkipped(str(error)) from None
        except Finding as finding:
            raise self._failure(subject, str(finding)) from finding
        except Exception as error:  # whatever a plugin raises is its failure, not the suite's
            raise self._failure(subject, f"it raised {_described(error)}") from error

    def outcome(self, subject: Subject) -> CheckOutcome:
        """Run and report instead of raising."""
        started = time.perf_counter()
        status: Status = "passed"
        message = ""
        try:
            self.run(subject)
        except CheckSkipped as skipped:
            status, message = "skipped", str(skipped)
        except CheckFailure as failure:
            status, message = "failed", str(failure)
        wall_s = time.perf_counter() - started
        return CheckOutcome(self.interface, subject.component.kind, self.name, status, message, wall_s)

    def _failure(self, subject: Subject, seen: str) -> CheckFailure:
        seen = seen if seen.endswith(".") else seen + "."
        return CheckFailure(
            f"{subject.component.label} fails '{self.name}': {seen} The contract: {self.clause}"
        )


@dataclass(frozen=True)
class BoundCheck:
    """A check with its subject: what a parametrized test calls."""

    check: Check
    subject: Subject

    def __call__(self) -> None:
        self.check.run(self.subject)

    @property
    def id(self) -> str:
        """Readable test id: physics-quasistatic-settles_in_equilibrium."""
        return f"{self.check.interface}-{self.subject.component.kind}-{self.check.name}"


class Suite:
    """Collects the checks of one interface; `Suite.check` is the decorator."""

    def __init__(self, interface: str) -> None:
        self.interface = interface
        self.checks: list[Check] = []

    def check(self, clause: str) -> Callable[[CheckFunction], CheckFunction]:
        """Register a function as a check; `clause` is the sentence of the contract that it tests."""

        def register(function: CheckFunction) -> CheckFunction:
            self.checks.append(Check(self.interface, function.__name__, clause, function))
            return function

        return register


def checks_for(interface: str) -> tuple[Check, ...]:
    """All checks of an interface: those that every component passes, then its own."""
    own: Suite = importlib.import_module(f"pliant.testing.{interface}").suite
    common: Suite = importlib.import_module("pliant.testing.common").suite
    return (*(replace(check, interface=interface) for check in common.checks), *own.checks)


def run_checks(component: Component) -> list[CheckOutcome]:
    """Run a component's whole suite; never raises for what the component does."""
    subject = Subject(component)
    return [check.outcome(subject) for check in checks_for(component.interface)]


def check_component(component: Component, interface: str | None = None) -> None:
    """Run a component's whole suite and raise `CheckFailure` at the first clause that is broken.

    Raises `CheckSkipped` with the cause if its package's requirements are not installed, and `CheckFailure`
    if the component is not of the `interface` that is named.
    """
    if interface not in (None, component.interface):
        raise CheckFailure(f"{component.label} is no {interface}: use the suite of its own interface.")
    missing = component.missing()
    if missing is not None:
        raise CheckSkipped(f"{component.label} needs {missing}: {component.install or 'install it'}")
    subject = Subject(component)
    for check in checks_for(component.interface):
        with contextlib.suppress(CheckSkipped):
            check.run(subject)


def _described(error: Exception) -> str:
    """The error in words; its place only where it was not raised on purpose."""
    if isinstance(error, PliantError):
        return f"{type(error).__name__}: {' '.join(str(error).split())}"
    place = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(str(error).split()) or "without a message"
    return f"{type(error).__name__} in {place.name} ({place.filename}:{place.lineno}): {text}"
