"""``gymnasium.make("pliant/FreeBending-v0")``"""

from __future__ import annotations

from typing import ClassVar

from pliant_plugins.envs.reach import ReachEnv


class FreeBendingEnv(ReachEnv):
    """Bend a finger of eight modules until its tip is at the target; nothing hangs at it."""

    default_study: ClassVar[str] = "free_bending"
