"""A plugin's manifest entry: light data that describe a component without importing it."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pliant.errors import ContractError, MissingDependencyError
from pliant.interfaces.base import CONTRACT_VERSION, ComponentConfig

INTERFACES = ("family", "material", "fem", "surrogate", "effect", "physics", "task", "optimizer")


@dataclass(frozen=True)
class Component:
    """One plugin of one interface.

    Attributes:
        interface: one of `INTERFACES`.
        kind: the word that selects it in a study.
        config: "module:Class" of its config model; the module must be cheap to import.
        implementation: "module:Class", imported only when the component is built.
        summary: one line for `pliant plugins` and the reference pages.
        example: the smallest valid block without `kind`; conformance suites and docs use it.
        requires: modules that the implementation imports and that may be missing.
        install: what to type when one is missing.
        contract: version of the interface that it fills.
        package: name and version of the distribution; filled by discovery.
    """

    interface: str
    kind: str
    config: str
    implementation: str
    summary: str
    example: Mapping[str, Any] = field(default_factory=dict)
    requires: tuple[str, ...] = ()
    install: str = ""
    contract: int = CONTRACT_VERSION
    package: str = ""

    def from_package(self, package: str) -> Component:
        """The same component with its distribution named."""
        return replace(self, package=package)

    def config_model(self) -> type[ComponentConfig]:
        """Import the config model."""
        model = self._load(self.config)
        if not (isinstance(model, type) and issubclass(model, ComponentConfig)):
            raise ContractError(f"{self.label}: '{self.config}' is not a subclass of ComponentConfig.")
        return model

    def missing(self) -> str | None:
        """The first required module that is not installed, or None."""
        for module in self.requires:
            if importlib.util.find_spec(module) is None:
                return module
        return None

    def build(self, config: ComponentConfig) -> Any:
        """Import the implementation and build it; raises `MissingDependencyError` with the install command."""
        missing = self.missing()
        if missing is not None:
            how = self.install or f"pip install {missing}"
            raise MissingDependencyError(f"{self.label} needs {missing}: {how}.")
        return self._load(self.implementation)(config)

    def _load(self, reference: str) -> Any:
        module, _, name = reference.partition(":")
        try:
            return getattr(importlib.import_module(module), name)
        except Exception as error:  # a plugin's module may fail in any way
            cause = f"{type(error).__name__}: {error}"
            raise ContractError(
                f"{self.label} of {self.package}: {reference} cannot be used ({cause})."
            ) from error

    @property
    def label(self) -> str:
        """How messages name it: physics 'pybullet'."""
        return f"{self.interface} '{self.kind}'"
