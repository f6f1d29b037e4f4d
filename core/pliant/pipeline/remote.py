"""What workers need to do a study's work: plain values in, a workbench on the shared store out."""

from __future__ import annotations

import json
import os
import platform
import tempfile
import threading
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pliant.config.study import Study, study_model
from pliant.errors import UserError
from pliant.pipeline.workbench import Workbench
from pliant.registry.discovery import Registry, discover
from pliant.registry.files import with_files
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import ArtifactStore

SEEN_WITHIN_S = 2.0
code_of = cache(code_fingerprint)  # the code that this process has loaded
_LOADING = threading.Lock()  # files of plugins are executed once, also where a worker has several threads


@dataclass(frozen=True)
class RemoteStudy:
    """A study as it travels to workers, which find their own plugins and open the store by its path.

    Attributes:
        study: as canonical JSON.
        plugins: Python files with kinds of the user's own.
        store: root of the store.
        modules: whose code must be that of the driver, with all that they import.
        code: its fingerprint there; empty: not compared.
    """

    study: str
    plugins: tuple[str, ...]
    store: str
    modules: tuple[str, ...] = ()
    code: str = ""

    @classmethod
    def of(cls, bench: Workbench, study: Study, modules: tuple[str, ...] = ()) -> RemoteStudy:
        """Of a study in this process; modules are for workers that may have other code."""
        plugins = tuple(str(file) for file in study.plugins)
        alone = study.model_copy(update={"workers": None})  # a worker has none of its own
        raw = {key: value for key, value in alone.canonical().items() if value is not None}
        code = code_of(modules) if modules else ""
        return cls(json.dumps(raw), plugins, str(bench.store.root.resolve()), modules, code)

    def open(self) -> tuple[Workbench, Study]:
        """In a worker.

        Raises:
            UserError: the worker runs other code.
        """
        if self.code and code_of(self.modules) != self.code:
            raise other_version("")
        store = store_seen(Path(self.store), self.store)
        registry = registry_with(self.plugins)
        raw = json.loads(self.study)
        study: Study = study_model(raw, registry).model_validate(raw)
        return Workbench(registry, ArtifactStore(store, study.name)), study


def other_version(how: str) -> UserError:
    """The error of a worker with other code than the driver's; `how` it shows, in brackets."""
    return UserError(
        f"the worker on {platform.node()} runs another version of Pliant, of a plugin or of a library than this "
        f"process{how}; install the same on both, and edit no code meanwhile."
    )


def store_seen(folder: Path, store: str) -> Path:
    """The driver's store where this host sees a folder of it, else a store of this host's own.

    What the driver's store has and a host of its own lacks is computed there once. A new folder may take a while to
    show on a network file system. The host's own is `PLIANT_STORE` there, or a folder for temporary files.
    """
    until = time.monotonic() + SEEN_WITHIN_S
    while not folder.is_dir():
        if time.monotonic() >= until:
            who = os.getuid() if hasattr(os, "getuid") else "own"
            own = os.environ.get("PLIANT_STORE") or Path(tempfile.gettempdir()) / f"pliant-worker-{who}"
            return Path(own)
        time.sleep(0.2)  # a network file system
    return Path(store)


def registry_with(plugins: tuple[str, ...]) -> Registry:
    """The installed plugins and those of the files."""
    with _LOADING:
        return with_files(discover(), [Path(file) for file in plugins])
