"""Manifest of PPO: one kind of the interface `optimizer`; neither torch nor gymnasium is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the optimizer."""
    return [
        Component(
            interface="optimizer",
            kind="ppo",
            config="pliant_ppo.config:PpoConfig",
            implementation="pliant_ppo.optimizer:Ppo",
            summary="PPO by stable-baselines3: learns which design suits which condition, from thousands of candidates",
            requires=("stable_baselines3", "torch", "tensorboard"),
            install="pip install 'pliant[ppo]'",
        )
    ]
