"""Learning curve of a meta-model: error on unseen designs against the number of designs that it is fitted to."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.execution.progress import Progress
from pliant.pipeline.learning import curve_points, spread_order, subset_sizes
from pliant.pipeline.residuals import Residuals
from pliant.pipeline.workbench import RunContext, content
from pliant.store.store import Artifact
from pliant_designs.meta_model import MetaModel
from pliant_designs.records import SolvedDesigns
from pliant_designs.stage import NOT_FITTED, MetaModelStage

TEST_SHARE = 0.25
SEED = 0  # of the held-out designs


def design_learning_stage(context: RunContext, stage: MetaModelStage) -> Artifact:
    """Return the learning curve of a meta-model's kind through the store; the value is that of `design_learning`."""
    model: MetaModel = context.build("meta_model", stage.config)
    settings = {name: value for name, value in content(stage.config).items() if name not in NOT_FITTED}
    return context.make(
        "learning",
        lambda partial: design_learning(model, stage.designs, context.progress, partial / "points.json"),
        components=[context.component("meta_model", stage.config)],
        modules=["pliant_designs.learning"],
        config={"meta_model": settings, "family": stage.designs.family, "names": list(stage.designs.names)},
        inputs=stage.solved.inputs,
    )


def design_learning(
    model: MetaModel, designs: SolvedDesigns, progress: Progress, kept: Path | None = None
) -> dict[str, Any]:
    """Refit on nested subsets of the designs and score on a held-out quarter of them.

    Subsets start with corners of the range; each next design is the farthest from those before it.

    Returns:
        `points`: each with `n` designs, and for "all" and "interior" test designs `rms` and `worst`, shares of the
        range of each design's effort, and `wall_s`; `left_out`: sizes that cannot be fitted, each with its cause;
        `test`, `interior`: rows of the scoring designs, and of those among them inside the range.
    """
    n = len(designs)
    test = np.sort(np.random.default_rng(SEED).permutation(n)[: max(1, round(TEST_SHARE * n))])
    train = np.setdiff1d(np.arange(n), test)
    order = train[spread_order(designs.values[train], np.full(len(train), "designs"), 0)]
    inner = test[~designs.corners()[test]]

    def point(n: int) -> dict[str, Any]:
        """Return the scores of the model of some designs."""
        started = time.perf_counter()
        laws = model.fit(designs.rows(np.isin(np.arange(len(designs)), order[:n]))).laws
        wall_s = time.perf_counter() - started
        shares = {}
        for i in test:
            law = laws.law(designs.values[i])
            everywhere = np.tile([-np.inf, np.inf], (len(law.domain.box), 1))
            shares[i] = Residuals.from_law(designs.data[i], law, inside=everywhere).share

        def scores(rows: NDArray[np.int64]) -> dict[str, float] | None:
            if not len(rows):
                return None
            every = np.concatenate([shares[i] for i in rows])
            return {"rms": float(np.sqrt(np.mean(every**2))), "worst": float(every.max())}

        return {"all": scores(test), "interior": scores(inner), "wall_s": wall_s}

    sizes = subset_sizes(len(order), max(model.fewest, len(designs.names) + 1))
    title = "learning curve over designs"
    points = curve_points([{"n": size} for size in sizes], point, progress, title, kept)
    return {**points, "test": test.tolist(), "interior": inner.tolist()}
