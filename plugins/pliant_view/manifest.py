"""The verbs `render` and `view`, the viewer `mujoco`, and the writer of fields; nothing that draws is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.command import Command
from pliant.registry.component import Component
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verbs that draw."""
    return [Command("render", "pliant_view.command:render"), Command("view", "pliant_view.command:view")]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the function that `pliant fem --fields` calls."""
    return [Function("fields_writer", "pliant_view.writing:fields_writer")]


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the viewer."""
    return [
        Component(
            interface="viewer",
            kind="mujoco",
            config="pliant_view.mujoco.config:MujocoViewerConfig",
            implementation="pliant_view.mujoco.backend:MujocoViewer",
            summary="MuJoCo's renderer and its interactive window, for the results of every engine",
            requires=("mujoco",),
            install="pip install 'pliant[mujoco]'",
        )
    ]
