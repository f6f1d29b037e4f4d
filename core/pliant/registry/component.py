"""Manifest entry of a plugin: data that describe a component without importing it."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from pliant.errors import MissingDependencyError, PluginFailureError
from pliant.registry.blame import blamed_on
from pliant.registry.interface import interfaces
from pliant.registry.place import imported, is_place
from pliant.registry.shipped import PACKAGES

if TYPE_CHECKING:
    from pliant.interfaces.base import ComponentConfig


@dataclass(frozen=True)
class Component:
    """One plugin of one interface.

    Attributes:
        interface: name of one of `interfaces()`.
        kind: the word that selects it in a study.
        config: "module:Class" of its config model; the module must be cheap to import.
        implementation: "module:Class", imported only when the component is built.
        summary: one line for `pliant plugins` and the reference pages.
        example: values of required keys, in a study's notation, for the reference pages and the conformance suite, if
            the type of a field has no example.
        requires: modules that the implementation imports and that may be missing; the versions of their
            distributions are part of the keys of its artifacts.
        lazy: modules that only part of its work needs, such as a fit but not the law of a stored one; their versions
            are part of the keys too. It imports them where they are needed, and raises `MissingDependencyError`.
        install: command that installs a missing module.
        models: of an effect, the kinds of models that it changes: `chain`, or kinds of the block `model`.
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
    models: tuple[str, ...] = ("chain",)
    package: str = ""

    def from_package(self, package: str) -> Component:
        """Return the same component with the name of its distribution."""
        return replace(self, package=package)

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.interface, str) and self.interface in interfaces()):
            known = ", ".join(interfaces())
            return f"component '{self.kind}' has interface '{self.interface}'; known: {known}"
        if not (isinstance(self.kind, str) and self.kind):
            return f"a {self.interface} component has kind {self.kind!r}; it must be a word"
        for name in ("config", "implementation"):
            place = getattr(self, name)
            if not is_place(place):
                return f"{self.label} has {name} {place!r}; write it as 'package.module:Class'"
        for name in ("summary", "install"):
            if not isinstance(getattr(self, name), str):
                return f"{self.label} has {name} {getattr(self, name)!r}; it must be a text"
        for name in ("requires", "lazy"):
            value = getattr(self, name)
            if not (isinstance(value, tuple | list) and all(isinstance(m, str) for m in value)):
                verb = "requires" if name == "requires" else "has lazy"
                return f"{self.label} {verb} {value!r}; write a tuple of module names"
        if not (isinstance(self.models, tuple) and self.models):
            return f"{self.label} has models {self.models!r}; write a tuple of kinds of models"
        if not isinstance(self.example, Mapping):
            return f"{self.label} has example {self.example!r}; write a dict of config values"
        return None

    def config_model(self) -> type[ComponentConfig]:
        """Import the config model.

        Raises `PluginFailureError` if it cannot be imported, does not belong to the interface or is not complete.
        """
        model: Any = self._load(self.config)
        base: type[ComponentConfig] = interfaces()[self.interface].config_class()
        if not (isinstance(model, type) and issubclass(model, base)):
            raise PluginFailureError(
                f"{self.origin}: '{self.config}' is no {base.__name__}; a config model must subclass it."
            )
        if not model.__pydantic_complete__:  # an annotation with an undefined name
            self._complete(model)
        return model

    def smallest_block(self) -> dict[str, Any]:
        """Return the smallest valid block without `kind`, for conformance suites and docs.

        It contains the `examples` of the config's fields, and `example`.
        """
        fields = self.config_model().model_fields.items()
        given = [
            (name, f.validation_alias, f.examples[0])
            for name, f in fields
            if f.examples and not {name, f.validation_alias} & set(self.example)
        ]
        # A key without its unit if the value has the unit.
        keys = {str(short) if isinstance(value, str) else name: value for name, short, value in given}
        return {**keys, **self.example}

    def implementation_class(self) -> Any:
        """Import the implementation without building it, for the declarations of its class.

        Raises `MissingDependencyError` with the install command if a required package is missing.
        """
        if missing := self.missing():
            how = self.install or f"pip install {missing}"
            raise MissingDependencyError(f"{self.label} needs {missing}: {how}.")
        return self._load(self.implementation)

    def missing(self, lazy: bool = False) -> str | None:
        """Return the first required module, with `lazy` also of the lazy modules, that is not installed, or None."""
        modules = (*self.requires, *(self.lazy if lazy else ()))
        return next((module for module in modules if not _is_installed(module)), None)

    def build(self, config: ComponentConfig) -> Any:
        """Import the implementation and build it; raises as `implementation_class` does.

        Raises `PluginFailureError` if the constructor of a plugin that is not shipped fails.
        """
        implementation = self.implementation_class()
        with self.guard("__init__"):
            return implementation(config)

    def guard(self, method: str) -> AbstractContextManager[None]:
        """Return a context in which errors of a plugin that is not shipped name the plugin and this method."""
        return nullcontext() if self.shipped else blamed_on(self, method)

    def _load(self, reference: str) -> Any:
        try:
            return imported(reference)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin's module may raise anything, even SystemExit
            cause = f"{type(error).__name__}: {error}"
            raise PluginFailureError(f"{self.origin}: {reference} cannot be used ({cause}).") from error

    def _complete(self, model: type[ComponentConfig]) -> None:
        try:
            model.model_rebuild()
        except Exception as error:  # of pydantic, or a NameError of the annotation
            cause = str(error).partition("\n")[0].rstrip(".")
            raise PluginFailureError(f"{self.origin}: {self.config} cannot be used ({cause}).") from error

    @property
    def shipped(self) -> bool:
        """Return whether it is shipped with Pliant, so that its failures are errors of Pliant."""
        return self.implementation.partition(".")[0] in PACKAGES

    @property
    def label(self) -> str:
        """The name in messages: physics 'pybullet'."""
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
    ):  # its package is missing, partly loaded, or not a valid name
        return False
