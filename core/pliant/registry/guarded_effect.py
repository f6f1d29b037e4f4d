"""Guarded effect of a package: its exceptions and invalid results become sentences that name the package."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np

from pliant.errors import PluginFailureError
from pliant.interfaces.effect import Effect, EffectConfig, Model
from pliant.interfaces.model import SystemParts
from pliant.records.chain import ChainModel
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.term import LawTerm, Role
from pliant.registry.blame import blamed_on
from pliant.registry.component import Component


class GuardedEffect(Effect):
    """Wrapper of an effect that raises `PluginFailureError` for its failures.

    A study that names the effect stops with a sentence; a diagnosis omits it."""

    config: EffectConfig

    def __init__(self, effect: Effect, component: Component) -> None:
        super().__init__(effect.config)
        self.effect, self.component = effect, component

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return the effect's reason, or its failure as the reason."""
        try:
            with blamed_on(self.component, "unsuited"):
                reason = self.effect.unsuited(chain, histories)
            _require(self.component, isinstance(reason, str), "unsuited", reason, "a text")
        except PluginFailureError as error:
            return str(error)
        return reason

    def apply(self, model: Any) -> Any:
        """Return the model, or the parts of a system, with the effect, and guards about its maps."""
        with blamed_on(self.component, "apply"):
            after: Any = self.effect.apply(model)
        if isinstance(model, SystemParts):
            _require(self.component, isinstance(after, SystemParts), "act", after, "SystemParts")
        else:
            self._check_chain(model, after)
        return replace(
            after,
            inputs=self._guarded(model.inputs, after.inputs, History),
            outputs=self._guarded(model.outputs, after.outputs, Mapping),
        )

    def _check_chain(self, model: Model, after: Any) -> None:
        _require(self.component, isinstance(after, Model), "apply", after, "a Model")
        _require(self.component, isinstance(after.chain, ChainModel), "apply", after.chain, "a chain")
        for term in after.chain.terms:
            if not any(term is known for known in model.chain.terms):
                _check_term(self.component, term, len(after.chain.joints))

    def _guarded(self, before: Sequence[Any], now: Sequence[Any], kind: type) -> tuple[Any, ...]:
        """Return the maps, with those that the effect added as `GuardedMap`s."""
        return tuple(
            one if any(one is known for known in before) else GuardedMap(one, self.component, kind)
            for one in now
        )


@dataclass(frozen=True)
class GuardedMap:
    """A map of inputs or readings of such an effect, checked to return the type `kind`."""

    change: Callable[[Any], Any]
    component: Component
    kind: type

    def __call__(self, value: Any) -> Any:
        """Return the map's checked result."""
        name = getattr(self.change, "__name__", type(self.change).__name__)
        with blamed_on(self.component, name):
            after = self.change(value)
        what = "a History" if self.kind is History else "readings by name"
        _require(self.component, isinstance(after, self.kind), name, after, what)
        return after


def _require(component: Component, held: bool, method: str, value: object, wanted: str) -> None:
    if not held:
        returned = "None" if value is None else type(value).__name__
        raise PluginFailureError(
            f"{component.origin}: '{method}' returns {returned}; it must return {wanted}."
        )


def _check_term(component: Component, term: LawTerm, n_joints: int) -> None:
    """Raise for a term that no engine can evaluate; its function is called once."""
    where = f"{component.origin}: a law term of 'apply'"
    if not isinstance(term, LawTerm):
        raise PluginFailureError(f"{where} is {term!r}; make a LawTerm.")
    if term.role not in get_args(Role):
        raise PluginFailureError(f"{where} has role '{term.role}'; roles are {', '.join(get_args(Role))}.")
    if term.per_joint and len(term.per_joint) != n_joints:
        raise PluginFailureError(
            f"{where} has numbers for {len(term.per_joint)} joints; the chain has {n_joints}."
        )
    old, new = np.zeros(term.n_states), np.zeros(term.n_states)
    numbers = np.array(term.numbers(0), float)
    with blamed_on(component, getattr(term.function, "__name__", "function")):
        value = term.function(0.1, 0.0, 1.0, 0.0, REFERENCE_TEMPERATURE_C, old, new, numbers)
        float(value)
