"""A plugin's manifest entry: light data that describe a component without importing it."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pliant.errors import ContractError, MissingDependencyError
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.fem import FemConfig
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.meta_model import MetaModelConfig
from pliant.interfaces.optimizer import OptimizerConfig
from pliant.interfaces.physics import PhysicsConfig
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.interfaces.task import TaskConfig
from pliant.interfaces.viewer import ViewerConfig

# Interface → the base that a component's config model has.
CONFIG_BASES: dict[str, type[ComponentConfig]] = {
    "family": FamilyConfig,
    "material": MaterialConfig,
    "fem": FemConfig,
    "surrogate": SurrogateConfig,
    "meta_model": MetaModelConfig,
    "effect": EffectConfig,
    "physics": PhysicsConfig,
    "task": TaskConfig,
    "optimizer": OptimizerConfig,
    "viewer": ViewerConfig,
}
INTERFACES = tuple(CONFIG_BASES)
PLACE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")


@dataclass(frozen=True)
class Component:
    """One plugin of one interface.

    Attributes:
        interface: one of `INTERFACES`.
        kind: the word that selects it in a study.
        config: "module:Class" of its config model; the module must be cheap to import.
        implementation: "module:Class", imported only when the component is built.
        summary: one line for `pliant plugins` and the reference pages.
        example: values of keys, as a study writes them, for the reference pages and the conformance suite: those that
            the config requires, where a field's type has no example of its own.
        requires: modules that the implementation imports and that may be missing; the versions of their
            distributions are part of the keys of what it makes.
        lazy: modules that only part of its work needs, such as a fit but not the law of a stored one; their versions
            are part of the keys too. It imports them where that part begins, and raises `MissingDependencyError`.
        install: what to type when one is missing.
        package: name and version of the distribution; filled by discovery.
    """

    interface: str
    kind: str
    config: str
    implementation: str
    summary: str
    example: Mapping[str, Any] = field(default_factory=dict)
    requires: tuple[str, ...] = ()
    lazy: tuple[str, ...] = ()
    install: str = ""
    package: str = ""

    def from_package(self, package: str) -> Component:
        """The same component with its distribution named."""
        return replace(self, package=package)

    def problem(self) -> str | None:
        """What is wrong with this entry itself, or None; nothing is imported."""
        if self.interface not in INTERFACES:
            return f"component '{self.kind}' has interface '{self.interface}'; known: {', '.join(INTERFACES)}"
        if not (isinstance(self.kind, str) and self.kind):
            return f"a {self.interface} component has kind {self.kind!r}; it must be a word"
        for name in ("config", "implementation"):
            place = getattr(self, name)
            if not (isinstance(place, str) and PLACE.fullmatch(place)):
                return f"{self.label} has {name} {place!r}; write it as 'package.module:Class'"
        for name in ("summary", "install"):
            if not isinstance(getattr(self, name), str):
                return f"{self.label} has {name} {getattr(self, name)!r}; it must be a text"
        for name in ("requires", "lazy"):
            value = getattr(self, name)
            if not (isinstance(value, tuple | list) and all(isinstance(m, str) for m in value)):
                verb = "requires" if name == "requires" else "has lazy"
                return f"{self.label} {verb} {value!r}; write a tuple of module names"
        if not isinstance(self.example, Mapping):
            return f"{self.label} has example {self.example!r}; write a dict of config values"
        return None

    def config_model(self) -> type[ComponentConfig]:
        """Import the config model; raises `ContractError` for what is none of this interface."""
        model = self._load(self.config)
        base = CONFIG_BASES[self.interface]
        if not (isinstance(model, type) and issubclass(model, base)):
            raise ContractError(
                f"{self.origin}: '{self.config}' is no {base.__name__}; a config model must subclass it."
            )
        return model

    def smallest_block(self) -> dict[str, Any]:
        """The smallest valid block without `kind`, for conformance suites and docs: what the fields of the config give
        as their `examples`, and `example`.
        """
        fields = self.config_model().model_fields.items()
        given = [(name, f.validation_alias, f.examples[0]) for name, f in fields if f.examples]
        # A key without its unit where the value says the unit.
        keys = {str(short) if isinstance(value, str) else name: value for name, short, value in given}
        return {**keys, **self.example}

    def implementation_class(self) -> Any:
        """Import the implementation without building it, for what its class declares.

        Raises `MissingDependencyError` with the install command where a package that it requires is missing.
        """
        if missing := self.missing():
            how = self.install or f"pip install {missing}"
            raise MissingDependencyError(f"{self.label} needs {missing}: {how}.")
        return self._load(self.implementation)

    def missing(self, lazy: bool = False) -> str | None:
        """The first required module, or with `lazy` also the first of those, that is not installed, or None."""
        modules = (*self.requires, *(self.lazy if lazy else ()))
        return next((module for module in modules if not _is_installed(module)), None)

    def build(self, config: ComponentConfig) -> Any:
        """Import the implementation and build it; raises as `implementation_class` does."""
        return self.implementation_class()(config)

    def _load(self, reference: str) -> Any:
        module, _, name = reference.partition(":")
        try:
            return getattr(importlib.import_module(module), name)
        except Exception as error:  # a plugin's module may fail in any way
            cause = f"{type(error).__name__}: {error}"
            raise ContractError(f"{self.origin}: {reference} cannot be used ({cause}).") from error

    @property
    def label(self) -> str:
        """How messages name it: physics 'pybullet'."""
        return f"{self.interface} '{self.kind}'"

    @property
    def origin(self) -> str:
        """The label with the package: physics 'pybullet' of pliant 0.1.0."""
        return f"{self.label} of {self.package}" if self.package else self.label


def _is_installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (
        ImportError,
        ValueError,
        RecursionError,
    ):  # its package is missing, half-loaded, or no name at all
        return False
