"""Stage 5: a finished run becomes its page, from the store when nothing that it shows has changed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.pipeline.study import StudyRun, surrogate_kinds
from pliant.pipeline.workbench import Workbench
from pliant.report.folder import finished
from pliant.store.fingerprint import versions
from pliant.store.store import write_atomically, writing_in

# Pictures of every page; those that a page no longer has are taken away.
NAMES = {"finger", "module_shape", "law", "chain_pose", "backbones", "stills"}
NAMES |= {"runs", "where", "loops", "map", "steps"}
NAMES |= {"hypotheses", "changes", "depends", "repeats"}
NUMBERED = re.compile(r"_\d+$")


def report_stage(bench: Workbench, run: StudyRun, summary: Mapping[str, Any], folder: Path) -> Path:
    """Render the page, or find it in the store, and write it with its pictures; returns the page's path."""
    read = finished(run, summary)

    def compute(partial: Path) -> dict[str, Any]:
        from pliant.report.page import render  # matplotlib takes a second to import

        made = render(read)
        return {"html": made.html, "pictures": dict(made.pictures)}

    artifact = bench.make(
        "report",
        compute,
        components=[bench.registry.get("surrogate", kind) for kind in surrogate_kinds(run.designs)],
        modules=["pliant.report.page"],
        config={
            "study": run.study.canonical(),
            "skipped": [engine.skipped for engine in run.engines],
            "libraries": {"pliant": __version__, **versions(["matplotlib", "jinja2"])},
            # Times and digests: a page tells when its artifacts were made, so it goes with those of an earlier making.
            "provenance": [manifest["digest"] for manifest in read.provenance],
        },
        inputs={f"artifact{number}": manifest["key"] for number, manifest in enumerate(read.provenance)},
    )
    return write_page(folder, artifact.value["html"], artifact.value["pictures"])


def write_page(folder: Path, html: str, pictures: Mapping[str, Any]) -> Path:
    """Write `report.html` and `pictures/*.png`, and remove pictures of an earlier report.

    `pictures` maps names to PNG bytes as uint8 arrays. Raises `UserError` where nothing can be written.
    """
    page = folder / "report.html"
    with writing_in(folder):
        (folder / "pictures").mkdir(exist_ok=True)
        for name, png in pictures.items():
            target = folder / "pictures" / f"{name}.png"
            temporary = target.with_name(f".{name}.png")
            temporary.write_bytes(png.tobytes())
            temporary.replace(target)
        for old in (folder / "pictures").glob("*.png"):
            if old.stem not in pictures and NUMBERED.sub("", old.stem) in NAMES:
                old.unlink()
        write_atomically(page, html)
    return page
