"""Stage 5: a finished run becomes its page, from the store when nothing that it shows has changed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.config.study import Study
from pliant.pipeline.study import StudyRun, law_components
from pliant.pipeline.workbench import Workbench
from pliant.report.folder import finished
from pliant.store.fingerprint import versions
from pliant.store.store import Artifact, write_atomically, writing_in

# Pictures of every page; those that a page no longer has are taken away.
NAMES = {"finger", "module_shape", "law", "chain_pose", "backbones", "stills", "tip_cloud"}
NAMES |= {"runs", "where", "loops", "map", "steps"}
NAMES |= {"module_stress", "fem_states", "fem_sampling", "fem_cost"}
NAMES |= {"hypotheses", "changes", "depends", "repeats"}
# Beside fem.csv; `pliant run` in the same folder writes report.html.
FEM_PAGE = "fem.html"
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
        components=law_components(bench, run.designs),
        modules=["pliant.report.page", "pliant.formatting"],
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


def fem_report_stage(bench: Workbench, study: Study, artifacts: Sequence[Artifact], folder: Path) -> Path:
    """Render the page of `pliant fem`, or find it in the store, and write it as `fem.html`; returns its path."""
    written = study.canonical()

    def compute(partial: Path) -> dict[str, Any]:
        from pliant.report.fem_page import render_fem  # matplotlib takes a second to import
        from pliant.report.fem_section import Solved

        kind = str((written.get("fem") or {}).get("kind", ""))
        names = [study.name] if len(artifacts) == 1 else [f"design {n + 1}" for n in range(len(artifacts))]
        designs = [Solved(name, a.value, kind) for name, a in zip(names, artifacts, strict=True)]
        return {"html": render_fem(written, designs, [a.manifest for a in artifacts])}

    artifact = bench.make(
        "report",
        compute,
        components=[],
        modules=["pliant.report.fem_page", "pliant.formatting"],
        config={
            "study": written,
            "libraries": {"pliant": __version__, **versions(["matplotlib", "jinja2"])},
            "provenance": [a.manifest["digest"] for a in artifacts],
        },
        inputs={f"artifact{number}": a.key for number, a in enumerate(artifacts)},
    )
    page = folder / FEM_PAGE
    with writing_in(folder):
        write_atomically(page, artifact.value["html"])
    return page


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
