"""Context of a run that every stage needs: the plugins, the store, the progress."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pliant.execution.progress import Progress, Silent
from pliant.interfaces.base import ComponentConfig, FrozenModel
from pliant.registry.component import Component
from pliant.registry.discovery import Registry
from pliant.store.fingerprint import code_fingerprint, versions
from pliant.store.store import Artifact, ArtifactStore, Recipe


def content(config: FrozenModel) -> dict[str, Any]:
    """Return a config as JSON values for a key; a file enters by its content, not by its path."""
    return dict(_content(config, config.canonical()))


def digest(path: Path) -> str:
    """Return the digest of a file's content."""
    with path.open("rb") as file:
        return "sha256:" + hashlib.file_digest(file, "sha256").hexdigest()


def _content(value: Any, plain: Any) -> Any:
    """Return `plain`, the JSON form of `value`, with each existing file replaced by its digest."""
    if isinstance(value, Path) and value.is_file():
        return digest(value)
    if isinstance(value, FrozenModel) and isinstance(plain, Mapping):
        return {name: _content(getattr(value, name, None), item) for name, item in plain.items()}
    if isinstance(value, Mapping) and isinstance(plain, Mapping):
        by_name = {str(key): item for key, item in value.items()}
        return {name: _content(by_name.get(name), item) for name, item in plain.items()}
    if isinstance(value, list | tuple) and isinstance(plain, list) and len(value) == len(plain):
        return [_content(item, tree) for item, tree in zip(value, plain, strict=True)]
    return plain


@dataclass(frozen=True)
class RunContext:
    """Context of a run, passed from stage to stage; never global."""

    registry: Registry
    store: ArtifactStore
    progress: Progress = field(default_factory=Silent)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle without the progress, which is not shown in another process."""
        return RunContext, (self.registry, self.store)

    def component(self, interface: str, config: ComponentConfig) -> Component:
        """Return the plugin of a config."""
        return self.registry.get(interface, config.kind)

    def build(self, interface: str, config: ComponentConfig) -> Any:
        """Return the built plugin of a config."""
        return self.registry.build(interface, config)

    def recipe(
        self,
        stage: str,
        *,
        components: Sequence[Component],
        modules: Sequence[str],
        config: Mapping[str, Any],
        inputs: Mapping[str, str],
    ) -> Recipe:
        """Return what identifies the result of a stage; arguments as for `make`."""
        places = [place for c in components for place in (c.config, c.implementation)]
        packages = {c.implementation.partition(".")[0] for c in self.registry.components}
        code = code_fingerprint([*modules, *(place.partition(":")[0] for place in places)], packages)
        libraries = versions([module for c in components for module in (*c.requires, *c.lazy)])
        plugins = [{"interface": c.interface, "kind": c.kind, "package": c.package} for c in components]
        return Recipe(stage, config, inputs, code, libraries, plugins)

    def make(
        self,
        stage: str,
        compute: Callable[[Path], Any],
        *,
        components: Sequence[Component],
        modules: Sequence[str],
        config: Mapping[str, Any],
        inputs: Mapping[str, str],
        agrees: Callable[[Any], bool] | None = None,
    ) -> Artifact:
        """Run one stage through the store.

        Args:
            stage: its name, the folder in the store.
            compute: computes the result; see `ArtifactStore.make`.
            components: the plugins whose code the result depends on.
            modules: Pliant's own modules whose code it depends on.
            config: JSON values it depends on; see `content` for those of a plugin's config.
            inputs: name → key of the artifacts it is made from.
            agrees: see `ArtifactStore.make`.
        """
        recipe = self.recipe(stage, components=components, modules=modules, config=config, inputs=inputs)
        return self.store.make(recipe, compute, self.progress.note, agrees)
