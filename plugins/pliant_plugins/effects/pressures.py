"""What effects on pressures share: which inputs are pressures."""

from __future__ import annotations

from collections.abc import Callable

from pliant.errors import ImpossibleEffectError
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import PRESSURE, History


def needs_pressure(kind: str, chain: ChainModel) -> None:
    """Raise `ImpossibleEffectError` for a chain that no pressure drives."""
    names = [actuator.input for actuator in chain.actuators]
    if not any(PRESSURE.fullmatch(name) for name in names):
        raise ImpossibleEffectError(
            f"effect '{kind}' needs a pressure, and the chain is actuated by {', '.join(names)}"
        )


def with_pressures(history: History, change: Callable[[Array], Array]) -> History:
    """Return the history with every pressure changed; tendon forces are not changed."""
    return history.with_actuation(
        **{name: change(values) for name, values in history.actuation.items() if PRESSURE.fullmatch(name)}
    )
