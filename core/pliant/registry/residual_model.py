"""Residual models in manifests: they learn a term for the error that no listed effect explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pliant.errors import MissingDependencyError
from pliant.registry.block import KEY
from pliant.registry.manifests import registered
from pliant.registry.place import is_place
from pliant.registry.shipped import REMEDY


@dataclass(frozen=True)
class ResidualModel:
    """A model of what no listed effect explains.

    Attributes:
        name: of the model, `curve`.
        learn: "module:function", called as `learn(predictor, readings, noise, conditions, folds)`; it returns a
            `LearnedTerm`, or None if the runs support none.
        package: name and version of the distribution; filled by `residual_models`.
    """

    name: str
    learn: str
    package: str = ""

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"residual model '{self.name}'"

    @property
    def module(self) -> str:
        """The module of its function, whose code a diagnosis depends on."""
        return self.learn.partition(":")[0]

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.name, str) and KEY.fullmatch(self.name)):
            return f"a residual model has name {self.name!r}; write lower-case words joined by '_'"
        if not is_place(self.learn):
            return f"{self.label} has learn {self.learn!r}; write it as 'package.module:function'"
        return None


def residual_models() -> Mapping[str, ResidualModel]:
    """Return the residual models of all packages by name."""
    return registered("pliant_residual_models", ResidualModel)


def require_residual_model() -> None:
    """Raise `MissingDependencyError` without any residual model."""
    if not residual_models():
        raise MissingDependencyError(f"a learned term belongs to the package pliant_learned, {REMEDY}.")
