"""Components of this package. Imported at every start of Pliant, so no heavy library is imported here."""

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3  # of Pliant's plugins; docs/plugin_contract.md says what a later number changes


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the engine."""
    return [
        Component(
            interface="physics",
            kind="mujoco_warp",
            config="pliant_warp.config:MujocoWarpConfig",
            implementation="pliant_warp.backend:MujocoWarp",
            summary="MuJoCo whose batches of chains settle at once on a GPU, or on the CPU device (MuJoCo Warp)",
            requires=("mujoco", "mujoco_warp", "warp"),
            install="pip install pliant-warp",
        )
    ]
