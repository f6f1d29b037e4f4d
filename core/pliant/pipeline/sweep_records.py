"""What came of a sweep: an outcome for each design, whose data stay in the store until they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pliant.config.designs import SweptDesign
from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.pipeline.sweep_worker import Status
from pliant.records.fem import PASSED, SELF_CONTACT, ModuleData
from pliant.store.store import Artifact, load_artifact


@dataclass(frozen=True)
class DesignOutcome:
    """How one design of a sweep ended.

    Attributes:
        design: what was asked.
        status: done, refused (by its family), not_reached (its FEM), error (unexpected), crashed (its worker died).
        cause: why it is not done.
        key: of its artifact in the store; empty where there is none.
        folder: of the artifact.
        n_states, n_failed, self_contact: states solved, not reached, and solved with overlapping convolutions.
        passed_through: states that overlap and that `fem.self_contact: pass` lets pass.
        free_angle_rad: the largest angle of the free branch (m for a prismatic joint).
        joint: kind of the module's joint.
        wall_s: what its FEM took when it was made.
        cached: whether it was there before this sweep.
        failed: the states that were not reached.
    """

    design: SweptDesign
    status: Status
    cause: str = ""
    key: str = ""
    folder: Path | None = None
    n_states: int = 0
    n_failed: int = 0
    self_contact: int = 0
    passed_through: int = 0
    free_angle_rad: float | None = None
    joint: str = "revolute"
    wall_s: float = 0.0
    cached: bool = False
    failed: tuple[Mapping[str, object], ...] = ()

    @staticmethod
    def of(design: SweptDesign, made: Artifact, cached: bool) -> DesignOutcome:
        """The outcome of a design that has data."""
        data: ModuleData = made.value
        free = data.branch == "free"
        main = data.deformation[:, data.axes.index(data.main_axis)]
        return DesignOutcome(
            design,
            "done",
            key=made.key,
            folder=made.folder,
            n_states=len(data),
            n_failed=len(data.failed),
            self_contact=int(np.sum(data.status == SELF_CONTACT)),
            passed_through=int(np.sum(data.status == PASSED)),
            free_angle_rad=float(main[free].max()) if free.any() else None,
            joint=data.joint,
            wall_s=float(made.manifest["wall_s"]),
            cached=cached,
            failed=data.failed,
        )

    def data(self) -> ModuleData:
        """The design's FEM data. Raises `NotReachedError` where it has none."""
        if self.folder is None:
            raise NotReachedError(f"design {self.design.number} has no FEM data: {self.cause}")
        value: ModuleData = load_artifact(self.folder).value
        return value


@dataclass(frozen=True)
class SweepRun:
    """All designs of a sweep, in its order."""

    study: Study
    outcomes: tuple[DesignOutcome, ...]
    wall_s: float

    def done(self) -> tuple[DesignOutcome, ...]:
        """The designs that have data."""
        return tuple(outcome for outcome in self.outcomes if outcome.status == "done")

    def refused(self) -> tuple[DesignOutcome, ...]:
        """The designs that their family refuses."""
        return tuple(outcome for outcome in self.outcomes if outcome.status == "refused")

    def failed(self) -> tuple[DesignOutcome, ...]:
        """The possible designs without data."""
        return tuple(o for o in self.outcomes if o.status not in ("done", "refused"))

    def data(self) -> Iterator[tuple[SweptDesign, ModuleData]]:
        """Each design that is done with its data, read from the store one by one."""
        for outcome in self.done():
            yield outcome.design, outcome.data()
