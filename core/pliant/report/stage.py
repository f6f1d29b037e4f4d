"""Pages as files: rendered, or read from the store if their data have not changed."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.pipeline.workbench import RunContext
from pliant.registry.component import Component
from pliant.report.document import Document, Page
from pliant.report.render import page
from pliant.store.fingerprint import versions
from pliant.store.store import writing_in

REPORT = "report.html"
# Pictures of every page; those that a page no longer has are removed.
NAMES = {"finger", "module_shape", "law", "chain_pose", "backbones", "stills", "tip_cloud"}
NAMES |= {"runs", "where", "loops", "map", "steps"}
NAMES |= {"module_stress", "fem_states", "fem_sampling", "fem_cost"}
NAMES |= {"hypotheses", "changes", "depends", "repeats"}
NUMBERED = re.compile(r"_\d+$")


@dataclass(frozen=True, eq=False)
class StoredPage:
    """The inputs of a page, by which the store caches it.

    Attributes:
        context: with the store.
        manifests: of the artifacts that it shows; they include the time of their computation, which a page shows.
        components: plugins on whose code it depends.
        module: Pliant's module that draws it.
        config: JSON values that it shows.
    """

    context: RunContext
    manifests: Sequence[Mapping[str, Any]]
    components: Sequence[Component]
    module: str
    config: Mapping[str, Any]

    def render(self, document: Document) -> Page:
        """Return the page of the document, from the store if it is cached."""

        def compute(partial: Path) -> dict[str, Any]:
            made = page(document)
            return {"html": made.html, "pictures": dict(made.pictures)}

        artifact = self.context.make(
            "report",
            compute,
            components=self.components,
            modules=[self.module, "pliant.report.render", "pliant.formatting"],
            config={
                **self.config,
                "libraries": {"pliant": __version__, **versions(["matplotlib", "jinja2"])},
                "provenance": [manifest["digest"] for manifest in self.manifests],
            },
            inputs={f"artifact{n}": manifest["key"] for n, manifest in enumerate(self.manifests)},
        )
        return Page(artifact.value["html"], artifact.value["pictures"])


def write_page(folder: Path, html: str, pictures: Mapping[str, Any], name: str = REPORT) -> Path:
    """Write a page; for `report.html` also `pictures/*.png`, and remove pictures of an earlier report.

    `pictures` maps names to PNG bytes as uint8 arrays. Raises `UserError` where nothing can be written.
    """
    target = folder / name
    pictures = pictures if name == REPORT else {}
    with writing_in(folder):
        staged = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
        try:  # all files are written before any is moved into place
            for picture, png in pictures.items():
                (staged / f"{picture}.png").write_bytes(png.tobytes())
            (staged / name).write_text(html, encoding="utf-8")
            if name == REPORT:
                _put_pictures(folder / "pictures", pictures, staged)
            (staged / name).replace(target)
        finally:
            shutil.rmtree(staged, ignore_errors=True)
    return target


def _put_pictures(folder: Path, pictures: Mapping[str, Any], staged: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name in pictures:
        (staged / f"{name}.png").replace(folder / f"{name}.png")
    for old in folder.glob("*.png"):
        if old.stem not in pictures and NUMBERED.sub("", old.stem) in NAMES:
            old.unlink()
