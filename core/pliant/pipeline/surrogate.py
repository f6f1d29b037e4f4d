"""Stage 2: data become a law τ(p, u)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.pipeline.tables import read_table
from pliant.pipeline.workbench import Workbench, content
from pliant.records.fem import FemDataset
from pliant.records.law import FitReport, JointLaw
from pliant.store.store import Artifact


@dataclass(frozen=True)
class LawStage:
    """A law, its errors (None for a stated law), the artifact that holds both (None for a stated law)."""

    law: JointLaw
    report: FitReport | None
    artifact: Artifact | None
    data: FemDataset | None

    @property
    def key(self) -> str:
        """What later stages key on."""
        return self.artifact.key if self.artifact else "stated"


def law_stage(bench: Workbench, config: SurrogateConfig, dataset: Artifact | None) -> LawStage:
    """State or fit a law; `dataset` is the FEM artifact, or None where the config brings its own data."""
    surrogate: Surrogate = bench.build("surrogate", config)
    stated = surrogate.stated()
    if stated is not None:
        return LawStage(stated, None, None, None)
    data, key = _data(config, dataset)

    def compute(partial: Path) -> Any:
        fitted = surrogate.fit(data)
        return {"law": fitted.law.record(), "report": fitted.report}

    artifact = bench.make(
        "fit",
        compute,
        components=[bench.component("surrogate", config)],
        modules=["pliant.pipeline.surrogate"],
        config={"surrogate": {name: value for name, value in content(config).items() if name != "data"}},
        inputs={"data": key},
    )
    law = surrogate.load(artifact.value["law"])
    return LawStage(law, artifact.value["report"], artifact, data)


def _data(config: SurrogateConfig, dataset: Artifact | None) -> tuple[FemDataset, str]:
    if config.data is not None:
        data = read_table(config.data)
        return data, "sha256:" + hashlib.sha256(config.data.read_bytes()).hexdigest()
    if dataset is None:
        raise UserError(
            f"surrogate '{config.kind}' needs data: give a 'family', 'material' and 'fem' block, "
            "or 'surrogate.data: table.csv'."
        )
    return dataset.value, dataset.key
