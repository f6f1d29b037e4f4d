"""MuJoCo's warnings: captured instead of printed, and read from the data that they concern."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco

# Names of a bad position, velocity or acceleration; other warnings do not stop a motion.
UNSTABLE = {
    mujoco.mjtWarning.mjWARN_BADQPOS: "position",
    mujoco.mjtWarning.mjWARN_BADQVEL: "velocity",
    mujoco.mjtWarning.mjWARN_BADQACC: "acceleration",
}
_lock = threading.Lock()
_listeners: list[Any] = []


@contextmanager
def silent() -> Iterator[None]:
    """Suppress MuJoCo's output and MUJOCO_LOG.TXT inside the block; several threads may enter.

    Its handler is one for the whole process: the first to enter puts a silent one in its place, the last to
    leave puts it back.
    """
    with _lock:
        if not _listeners:
            before = mujoco.get_mju_user_warning()
            mujoco.set_mju_user_warning(lambda message: None)
        else:
            before = _listeners[0]
        _listeners.append(before)
    try:
        yield
    finally:
        with _lock:
            _listeners.pop()
            if not _listeners:
                mujoco.set_mju_user_warning(before)


def unstable(data: mujoco.MjData) -> str | None:
    """Return the name of the quantity that has become unbounded since the last call, or None."""
    if not any(data.warning.number):
        return None
    found = next((name for kind, name in UNSTABLE.items() if data.warning[kind].number), None)
    for warning in data.warning:
        warning.number = 0
    return found
