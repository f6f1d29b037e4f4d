"""Learning curves over designs: a meta-model's error on designs never used, by how many it is fitted to."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.execution.progress import Progress
from pliant.interfaces.meta_model import MetaModel
from pliant.pipeline.learning import keep_points, kept_points, spread_order
from pliant.pipeline.meta_model.stage import NOT_FITTED, MetaModelStage
from pliant.pipeline.residuals import Residuals
from pliant.pipeline.workbench import Workbench, content
from pliant.records.solved import SolvedDesigns
from pliant.store.store import Artifact

TEST_SHARE = 0.25
SEED = 0
STEP = np.sqrt(2.0)


def design_learning_stage(bench: Workbench, stage: MetaModelStage) -> Artifact:
    """The learning curve of a fitted meta-model's kind through the store; the value is that of `design_learning`."""
    model: MetaModel = bench.build("meta_model", stage.config)

    def compute(partial: Path) -> dict[str, Any]:
        return design_learning(model, stage.designs, bench.progress, partial / "points.json")

    settings = {name: value for name, value in content(stage.config).items() if name not in NOT_FITTED}
    return bench.make(
        "learning",
        compute,
        components=[bench.component("meta_model", stage.config)],
        modules=["pliant.pipeline.meta_model.learning"],
        config={"meta_model": settings, "family": stage.designs.family, "names": list(stage.designs.names)},
        inputs=stage.solved.inputs,
    )


def design_learning(
    model: MetaModel, designs: SolvedDesigns, progress: Progress, kept: Path | None = None
) -> dict[str, Any]:
    """Refit on nested subsets of the designs and score on a quarter of them that no fit sees.

    Subsets begin with corners of the range and go on with the design farthest from those before it.

    Returns:
        `points`: each with `n` designs, and for "all" and "interior" test designs `rms` and `worst`, shares of the
        range of each design's effort, and `wall_s`; `left_out`: sizes that cannot be fitted, each with its cause;
        `test`, `interior`: rows of the designs that score, and of those among them inside the range.
    """
    n = len(designs)
    test = np.sort(np.random.default_rng(SEED).permutation(n)[: max(1, round(TEST_SHARE * n))])
    train = np.setdiff1d(np.arange(n), test)
    order = train[spread_order(designs.values[train], np.full(len(train), "designs"), 0)]
    inner = test[~designs.corners()[test]]
    found = kept_points(kept)
    sizes = _sizes(max(model.fewest, len(designs.names) + 1), len(order))
    bar = progress.begin("learning curve over designs", len(sizes))
    try:
        for size in sizes:
            if str(size) not in found:
                found[str(size)] = {"n": size, **_point(model, designs, order[:size], test, inner)}
                keep_points(kept, found)
            bar.advance()
    finally:
        bar.finish()
    points = [found[str(size)] for size in sizes]
    return {
        "points": [p for p in points if "cause" not in p],
        "left_out": [p for p in points if "cause" in p],
        "test": test.tolist(),
        "interior": inner.tolist(),
    }


def _point(
    model: MetaModel,
    designs: SolvedDesigns,
    chosen: NDArray[np.int64],
    test: NDArray[np.int64],
    inner: NDArray[np.int64],
) -> dict[str, Any]:
    """Scores of the model of some designs, or the cause why there is none."""
    keep = np.zeros(len(designs), bool)
    keep[chosen] = True
    started = time.perf_counter()
    try:
        laws = model.fit(designs.rows(keep)).laws
    except UserError as error:
        return {"cause": str(error)}
    wall_s = time.perf_counter() - started
    shares = {int(i): _shares(laws.law(designs.values[i]), designs, int(i)) for i in test}
    return {"all": _scores(shares, test), "interior": _scores(shares, inner), "wall_s": wall_s}


def _shares(law: Any, designs: SolvedDesigns, index: int) -> Any:
    """(m,) |miss| of one design's trusted states, as shares of the range of each axis' effort."""
    data = designs.data[index]
    everywhere = np.tile([-np.inf, np.inf], (1 + len(law.axes), 1))
    return Residuals.of(data, law.axes, lambda p, u: law.evaluate(p, u).tau, everywhere).share


def _scores(shares: Mapping[int, Any], rows: Sequence[int] | NDArray[np.int64]) -> dict[str, float] | None:
    if not len(rows):
        return None
    every = np.concatenate([shares[int(i)] for i in rows])
    return {"rms": float(np.sqrt(np.mean(every**2))), "worst": float(every.max())}


def _sizes(fewest: int, most: int) -> list[int]:
    sizes, size = [], float(fewest)
    while round(size) < most:
        sizes.append(round(size))
        size *= STEP
    return [*sizes, most]
