"""Description of a study for workers: plain values, from which they open a workbench on the shared store."""

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
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import Registry, discover
from pliant.registry.files import with_files
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import ArtifactStore

SEEN_WITHIN_S = 2.0
code_of = cache(code_fingerprint)  # code that this process has loaded
_LOADING = threading.Lock()  # plugin files are executed once, even in a worker with several threads


@dataclass(frozen=True)
class RemoteStudy:
    """A study in the form sent to workers, which find their own plugins and open the store by its path.

    Attributes:
        study: as canonical JSON.
        plugins: Python files with the user's kinds.
        store: root of the store.
        modules: whose code, including imports, must equal the driver's.
        code: the driver's fingerprint of it; "": not compared.
    """

    study: str
    plugins: tuple[str, ...]
    store: str
    modules: tuple[str, ...] = ()
    code: str = ""

    @classmethod
    def from_study(cls, context: RunContext, study: Study, modules: tuple[str, ...] = ()) -> RemoteStudy:
        """Return the description of a study in this process; modules are for workers that may have other code."""
        plugins = tuple(str(file) for file in study.plugins)
        alone = study.model_copy(update={"workers": None})  # a worker has no workers
        raw = {key: value for key, value in alone.canonical().items() if value is not None}
        code = code_of(modules) if modules else ""
        return cls(json.dumps(raw), plugins, str(context.store.root.resolve()), modules, code)

    def open(self) -> tuple[RunContext, Study]:
        """Return the workbench and the study in a worker.

        Raises:
            UserError: the worker runs other code.
        """
        if self.code and code_of(self.modules) != self.code:
            raise other_version("")
        store = store_seen(Path(self.store), self.store)
        registry = registry_with(self.plugins)
        raw = json.loads(self.study)
        study: Study = study_model(raw, registry).model_validate(raw)
        return RunContext(registry.for_model(study.model_kind), ArtifactStore(store, study.name)), study


def other_version(how: str) -> UserError:
    """Return the error of a worker whose code differs from the driver's; `how` states the evidence, in brackets."""
    return UserError(
        f"the worker on {platform.node()} runs another version of Pliant, of a plugin or of a library than this "
        f"process{how}; install the same on both, and edit no code meanwhile."
    )


def store_seen(folder: Path, store: str) -> Path:
    """Return the driver's store if this host sees its folder, else a store local to this host.

    A local store computes missing artifacts once. A new folder may appear late on a network file system. The local
    store is `PLIANT_STORE` of the host, or a temporary folder.
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
    """Return the registry of the installed plugins and those of the files."""
    with _LOADING:
        return with_files(discover(), [Path(file) for file in plugins])
