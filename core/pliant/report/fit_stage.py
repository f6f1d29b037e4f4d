"""The fit's page: from the store when nothing that it shows has changed, written as `fit.html`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.errors import UserError
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.pipeline.law_speed import evaluations_per_second
from pliant.pipeline.learning import learning_stage
from pliant.pipeline.module_data import as_scored, module_of, module_of_axes
from pliant.pipeline.study import DEFAULT_SURROGATE, DesignStages
from pliant.pipeline.study_beside import study_law_beside
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.workbench import Workbench
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw
from pliant.store.fingerprint import versions
from pliant.store.store import Artifact, write_atomically, writing_in
from pliant.tabular.fem_modules import has_several_axes, read_module_table
from pliant.tabular.fem_reading import read_table

FIT_PAGE = "fit.html"


@dataclass(frozen=True, eq=False)
class FitPiece:
    """A law, the surrogate that made it, and the states that it was fitted to and scored on.

    `learning` holds the learning curve where one was made; `source` says in words where the states come from;
    `study_law` is the study's form on the same states where the law's report has none.
    """

    name: str
    config: SurrogateConfig
    law: LawStage
    data: ModuleData
    learning: Artifact | None = None
    source: str = "FEM"
    study_law: JointLaw | None = None


def piece_of(
    bench: Workbench,
    name: str,
    config: SurrogateConfig,
    law: LawStage,
    data: ModuleData | None = None,
    *,
    learning: bool = True,
    source: str = "FEM",
) -> FitPiece:
    """What the page needs of a law; with `learning` the surrogate is fitted again to parts of the states.

    Args:
        data: whole states of the module; those of the law's stage otherwise.

    Raises:
        UserError: the law is stated by coefficients, so that there is no fit to report.
    """
    if law.report is None or law.artifact is None or (data is None and law.data is None):
        raise UserError(
            f"the law of '{name}' is stated by its coefficients: there is no fit, so leave out --out, or let "
            "'surrogate' fit FEM states or a table."
        )
    surrogate: Surrogate = bench.build("surrogate", config)
    if data is None:
        data = _of_tables(surrogate, law)
    curve = None
    if learning and len(surrogate.tables()) <= 1:
        curve = learning_stage(bench, config, data, {"law": law.artifact.key})
    told = law.report.details
    own = "study_form" in told or any("study_form" in axis for axis in dict(told.get("axes", {})).values())
    beside = None if own else study_law_beside(bench, as_scored(data, law.report))
    return FitPiece(name, config, law, data, curve, source, beside)


def _of_tables(surrogate: Surrogate, law: LawStage) -> ModuleData:
    """The states of the config's own tables: one of one axis or of several, or one for each axis."""
    tables = surrogate.tables()
    path = tables.get("")
    if path is not None and has_several_axes(path):
        return read_module_table(path)
    if tables and path is None:
        return module_of_axes({axis: read_table(one, axis) for axis, one in tables.items()}, law.law.axes)
    assert law.data is not None
    return module_of(law.data)


def pieces_of(bench: Workbench, designs: Sequence[DesignStages], learning: bool = True) -> list[FitPiece]:
    """The pieces of a study's designs, named by number where there are several."""
    found = []
    for number, design in enumerate(designs, start=1):
        name = "the design" if len(designs) == 1 else f"design {number}"
        default = bench.registry.get("surrogate", DEFAULT_SURROGATE)
        config: Any = design.design.surrogate or default.config_model()(kind=DEFAULT_SURROGATE)
        data = design.fem.value if design.fem is not None else None
        source = "FEM" if design.fem is not None else "the table"
        found.append(piece_of(bench, name, config, design.law, data, learning=learning, source=source))
    return found


def fit_report_stage(
    bench: Workbench,
    title: str,
    pieces: Sequence[FitPiece],
    study: Mapping[str, Any],
    folder: Path,
    compared: Sequence[FitPiece] = (),
) -> Path:
    """Render the page of laws, or find it in the store, and write it as `fit.html`; returns its path.

    Args:
        title: of the page.
        pieces: one for each design.
        study: inputs to list, `Study.canonical()` or as much of it as there is.
        folder: where the page goes.
        compared: surrogates fitted to the same states, to stand side by side.
    """
    artifacts = [a for p in (*pieces, *compared) for a in (p.law.artifact, p.learning) if a is not None]

    def compute(partial: Path) -> dict[str, Any]:
        from pliant.report.fit_page import render_fit  # matplotlib takes a second to import

        fitted, beside = ([_fitted(piece) for piece in group] for group in (pieces, compared))
        return {"html": render_fit(title, fitted, study, [a.manifest for a in artifacts], beside)}

    artifact = bench.make(
        "report",
        compute,
        components=[bench.component("surrogate", p.config) for p in (*pieces, *compared)],
        modules=["pliant.report.fit_page"],
        config={
            "title": title,
            "study": dict(study),
            "names": [[p.name, p.source] for p in (*pieces, *compared)],
            "pieces": len(pieces),
            "libraries": {"pliant": __version__, **versions(["matplotlib", "jinja2"])},
            "provenance": [a.manifest["digest"] for a in artifacts],
        },
        inputs={f"artifact{number}": a.key for number, a in enumerate(artifacts)},
    )
    page = folder / FIT_PAGE
    with writing_in(folder):
        write_atomically(page, artifact.value["html"])
    return page


def _fitted(piece: FitPiece) -> Any:
    from pliant.report.fit_reading import Fitted

    law = piece.law
    assert law.report is not None and law.artifact is not None
    return Fitted(
        piece.name,
        piece.config.kind,
        law.law,
        law.report,
        as_scored(piece.data, law.report),
        float(law.artifact.manifest["wall_s"]),
        evaluations_per_second(law.law),
        piece.learning.value if piece.learning is not None else None,
        piece.source,
        piece.study_law,
    )
