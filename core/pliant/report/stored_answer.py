"""Cached results of a verb for a model and a measurement.

An answer is its document without drawing functions, its rendered page, and the files that accompany the page. Its key
contains the study, the numbers of the chain and of the measurement, the options, and the code of the verb, the engine,
all effects, the residual models and the page.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.config.study import Study
from pliant.interfaces.model import SystemModel
from pliant.pipeline.study import build_study_chain, study_physics
from pliant.pipeline.workbench import RunContext, content, digest
from pliant.records.chain import ChainModel
from pliant.records.measurement import Measurement
from pliant.records.plain_values import plain
from pliant.records.remark import Rank
from pliant.registry.component import Component
from pliant.registry.files import FILE_MODULE, effect_files
from pliant.registry.residual_model import residual_models
from pliant.report.document import Document, Page, Table, Warned
from pliant.report.render import page
from pliant.store.content import content_digest
from pliant.store.fingerprint import versions
from pliant.store.store import Artifact

LIBRARIES = ("numpy", "scipy", "numba", "matplotlib", "jinja2")
# Keys of a document: plain values and tuples of them.
TEXTS = ("kind", "title", "sentence", "answers", "points", "closing", "footer", "page", "version")


@dataclass(frozen=True, eq=False)
class StoredAnswer:
    """A document with its rendered page, and the texts of accompanying files by name."""

    document: Document
    made: Page
    files: Mapping[str, str]
    cached: bool = False

    def render(self, document: Document) -> Page:
        """Return the page of this answer, which must be that of the document."""
        return self.made


@dataclass(frozen=True, eq=False)
class Question:
    """A question about a model and a measurement.

    Attributes:
        context: with the store.
        study: the study, including its effects.
        measurement: the one that it is compared with.
        options: JSON values that the answer depends on.
        modules: that compute the answer; the stage is named after the first one.
    """

    context: RunContext
    study: Study
    measurement: Measurement
    options: Mapping[str, Any]
    modules: Sequence[str]

    def find(self, compute: Callable[[], Any]) -> Artifact:
        """Return the answer from the store, or compute it and keep it."""
        stage, parts = self._parts()
        return self.context.make(stage, lambda partial: compute(), **parts)

    def known(self) -> Artifact | None:
        """Return the answer if it is in the store."""
        stage, parts = self._parts()
        return self.context.store.find(self.context.recipe(stage, **parts))

    def _parts(self) -> tuple[str, dict[str, Any]]:
        """Return the stage, and what its result depends on."""
        context = self.context
        components = [
            c for c in context.registry.components if c.interface == "effect" and c.missing() is None
        ]
        shipped = [c for c in components if not c.implementation.startswith(FILE_MODULE)]
        source, numbers = _model_identity(context, self.study)
        return self.modules[0].rpartition(".")[2], {
            "components": [source, *shipped],
            "modules": [
                *self.modules,
                *(model.module for model in residual_models().values()),
                __name__,
                "pliant.report.render",
                "pliant.formatting",
            ],
            "config": {
                "study": content(self.study),
                "options": dict(self.options),
                "chain": numbers,
                "measurement": content_digest(self.measurement),
                "effects": sorted(component.kind for component in components),
                "files": [digest(Path(file)) for file in effect_files(context.registry)],
                "libraries": {"pliant": __version__, **versions(LIBRARIES)},
            },
            "inputs": {},
        }


def stored_answer(
    question: Question, compute: Callable[[], tuple[Document, Mapping[str, str]]], draw: bool = True
) -> StoredAnswer:
    """Return the document that answers a question, from the store if it is cached.

    Args:
        question: the question, whatever is drawn.
        compute: returns the document, and the texts of accompanying files by name.
        draw: whether the page is rendered; empty otherwise. A cached answer with a page serves both.
    """
    drawn = replace(question, options={**question.options, "page": True})
    question = drawn if draw else replace(question, options={**question.options, "page": False})

    def work() -> dict[str, Any]:
        document, files = compute()
        made = page(document) if draw else Page("", {})
        pictures = dict(made.pictures)
        return {"document": _tree(document), "html": made.html, "pictures": pictures, "files": dict(files)}

    artifact = (None if draw else drawn.known()) or question.find(work)
    value = artifact.value
    made = Page(value["html"], value["pictures"])
    return StoredAnswer(_document(value["document"]), made, value["files"], artifact.cached)


def _model_identity(context: RunContext, study: Study) -> tuple[Component, Any]:
    """Return the component that simulates a study's model, and what identifies its numbers."""
    if study.model is not None:
        system: SystemModel = context.build("model", study.model)
        return context.component("model", study.model), dict(system.fingerprint())
    chain = build_study_chain(context, study).chain
    return context.component("physics", study_physics(context, study)), _chain_digest(chain)


def _chain_digest(chain: ChainModel) -> str:
    laws = [law.record() for law in chain.laws]
    numbers = [getattr(chain, f.name) for f in dataclasses.fields(chain) if f.name not in ("laws", "terms")]
    return content_digest(laws, *numbers)


def _tree(document: Document) -> dict[str, Any]:
    """Return the document as JSON values."""
    brief = [block if isinstance(block, str) else dataclasses.asdict(block) for block in document.brief]
    warnings = [{**dataclasses.asdict(one), "rank": int(one.rank)} for one in document.warnings]
    texts = {name: getattr(document, name) for name in TEXTS}
    return {**texts, "data": plain(dict(document.data)), "brief": brief, "warnings": warnings}


def _document(tree: Mapping[str, Any]) -> Document:
    """Return the document of a tree, without drawing functions: its page is rendered already."""
    texts = {name: _tuples(tree[name]) for name in TEXTS}
    brief = tuple(block if isinstance(block, str) else Table(**block) for block in tree["brief"])
    warnings = tuple(
        Warned(one["sentence"], tuple(one["items"]), one["folded"], Rank(one["rank"]))
        for one in tree["warnings"]
    )
    return Document(**texts, data=tree["data"], brief=brief, warnings=warnings)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list | tuple) else value
