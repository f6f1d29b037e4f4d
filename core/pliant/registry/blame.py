"""Sentences on errors of plugins that are not shipped: the plugin, the method, the cause and the line."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from pliant.errors import PliantError, PluginFailureError

FILE_MODULE = "pliant_file_"  # prefix of the name of a module made from a user's file


class Plugin(Protocol):
    """Interface of a plugin: paths of its config and implementation, whether it is shipped, its name."""

    @property
    def config(self) -> str: ...
    @property
    def implementation(self) -> str: ...
    @property
    def shipped(self) -> bool: ...
    @property
    def origin(self) -> str: ...


@contextmanager
def blamed_on(component: Plugin, method: str) -> Iterator[None]:
    """Convert exceptions of a call into a plugin to `PluginFailureError`; shipped plugins keep their traceback."""
    try:
        yield
    except PliantError:
        raise
    except Exception as error:
        if component.shipped:
            raise
        failure = PluginFailureError(_sentence(component, method, error))
        failure.raised = error
        raise failure from error


def blamed(error: BaseException, components: Iterable[Plugin]) -> str | None:
    """Return a sentence on an error raised by the code of such a plugin, or None for other errors."""
    last, blamed_one = -1, None
    files = [frame.filename for frame in traceback.extract_tb(error.__traceback__)]
    for component in components:
        if not component.shipped:
            inside = [k for k, file in enumerate(files) if _is_in(file, component)]
            if inside and inside[-1] > last:
                last, blamed_one = inside[-1], component
    return None if blamed_one is None else _sentence(blamed_one, "", error)


def shown(file: Path) -> str:
    """Return the path relative to the current folder if that is shorter."""
    try:
        near = os.path.relpath(file)
    except ValueError:  # another drive
        return str(file)
    return near if len(near) < len(str(file)) else str(file)


def describe_error(error: BaseException) -> str:
    """Return the error's class and its text in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _sentence(component: Plugin, method: str, error: BaseException) -> str:
    """Return the sentence on a plugin that fails in `method`, or without it in the function of the failing line."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if _is_in(f.filename, component)]
    if not frames:
        return f"{component.origin}: '{method}' fails ({describe_error(error)})."
    last = frames[-1]
    if _module(component).startswith(FILE_MODULE):
        return f"{shown(Path(last.filename))}, line {last.lineno}: '{last.name}' fails ({describe_error(error)})."
    place = f"{shown(Path(last.filename))}, line {last.lineno}"
    return f"{component.origin}: '{method or last.name}' fails ({describe_error(error)}; {place})."


def _module(component: Plugin) -> str:
    return component.implementation.partition(":")[0]


def _is_in(file: str, component: Plugin) -> bool:
    """Return whether a file belongs to a plugin's package or, without a package, is its module."""
    modules = _module(component), component.config.partition(":")[0]
    for one in {*modules, *(name.partition(".")[0] for name in modules)}:
        own = getattr(sys.modules.get(one), "__file__", None)
        if own and (
            file == own or (own.endswith("__init__.py") and Path(file).is_relative_to(Path(own).parent))
        ):
            return True
    return False
