"""Chains in the form of compiled loops, packed once where they share laws and geometry."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Any, TypeVar

from pliant.records.chain import ChainModel
from pliant_plugins.physics.compiled.body import Body
from pliant_plugins.physics.compiled.laws import CompiledLaws

MOST_PACKS = 256
Packed = TypeVar("Packed")


class Packs:
    """The last few hundred packed laws and bodies, known by the identity of what they were made of."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[ChainModel, Any]] = {}
        self._lock = Lock()

    def laws(self, chain: ChainModel) -> CompiledLaws | None:
        """See `CompiledLaws.of`; loads, payload and pose of a chain do not matter."""
        key = ("laws", *map(id, chain.laws), id(chain.joints), chain.actuators)
        return self._keep(key, chain, CompiledLaws.of)

    def body(self, chain: ChainModel) -> tuple[Any, ...]:
        """See `Body.arrays`; loads, payload and gravity of a chain do not matter."""
        parts = (
            chain.joints,
            chain.bodies,
            chain.laws,
            chain.tip_offset_m,
            chain.base_position_m,
            chain.base_rotation,
        )
        return self._keep(("body", *map(id, parts)), chain, lambda c: Body.of(c).arrays)

    def _keep(self, key: tuple[Any, ...], chain: ChainModel, make: Callable[[ChainModel], Packed]) -> Packed:
        found = self._kept.get(key)
        if found is None:
            # The chain is kept: the identities of its parts stay their own.
            found = (chain, make(chain))
            with self._lock:
                while len(self._kept) >= MOST_PACKS:
                    self._kept.pop(next(iter(self._kept)))
                self._kept[key] = found
        packed: Packed = found[1]
        return packed
