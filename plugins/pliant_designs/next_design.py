"""Choice of the designs to solve next, whose data would reduce the meta-model's error most.

The gain of a candidate is the share of the mean squared error over the range of designs that solving it would remove,
if the model provides it (`DesignLaws.gain`); else the model's doubt; else the distance to the nearest solved design.
A batch is chosen sequentially, and each choice penalises the candidates near it (González, Dai, Hennig, Lawrence, Batch
Bayesian optimization via local penalization, AISTATS 2016, for another objective).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import scipy
from pydantic import ValidationError

from pliant.config.design_parameters import MATERIAL, design_parameters
from pliant.config.study import Study, varied
from pliant.errors import InvalidDesignError, UserError
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.store.store import write_atomically
from pliant_designs.records import SolvedDesigns
from pliant_designs.stage import MetaModelStage
from pliant_designs.sweep_designs import sweep_designs

CANDIDATES = 256
# Designs over which the error is averaged.
OVER = 256
SEED = 0
DIGITS = 6  # significant digits of a proposed parameter: 0.00712345
MOST_CORNERS = 6  # largest number of parameters for which the corners of the range are candidates
SAME = 1e-6  # of the range: two closer designs are equal


@dataclass(frozen=True)
class Proposal:
    """One design to solve.

    Attributes:
        names: parameters, SI.
        values: of the design.
        gain: share of the mean squared error that solving it would remove; for other bases the doubt relative to the
            largest, or the distance to the nearest solved design relative to the range.
        basis: gain, doubt or distance.
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    gain: float
    basis: str

    @property
    def parameters(self) -> dict[str, float]:
        """The design's parameters by name, SI."""
        return dict(zip(self.names, self.values, strict=True))


def check_count(count: int) -> None:
    """Raise `UserError` unless a number of designs is positive and allowed; cheap, so that it precedes every fit."""
    if count < 1:
        raise UserError(f"--next {count}: ask for at least one design.")


def designs_to_solve(context: RunContext, study: Study, stage: MetaModelStage, count: int) -> list[Proposal]:
    """Return the `count` designs to solve next, best first.

    The candidates are the sweep's unsolved designs if the study has such, else designs in the range that the family
    accepts.

    Raises:
        UserError: fewer candidates than `count`.
    """
    check_count(count)
    designs = stage.designs
    candidates = _unsolved(designs, _sweep_designs(study, designs))
    if not len(candidates):
        candidates = _unsolved(designs, _in_range(context, study, designs, CANDIDATES, SEED))
    if len(candidates) < count:
        raise UserError(
            f"--next {count}: only {len(candidates)} possible designs are not solved yet; request fewer, or "
            "widen the sweep."
        )
    over = _in_range(context, study, designs, OVER, SEED + 1)
    worth, basis = _worth(stage, candidates, over if len(over) else designs.values)
    reach = len(designs) ** (-1.0 / len(designs.names))
    left, found = worth.copy(), []
    for _ in range(count):  # each choice penalises its neighbours
        best = int(np.argmax(left))
        chosen = candidates[best]
        found.append(Proposal(designs.names, tuple(map(float, chosen)), float(worth[best]), basis))
        apart = _distances(designs, candidates, chosen[None])[:, 0]
        left = left * (1 - np.exp(-((apart / reach) ** 2) / 2))
        left[best] = -np.inf
    return found


def write_proposals(proposals: Sequence[Proposal], path: Path) -> None:
    """Write a table of designs for `sweep: {designs: next.csv}`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(proposals[0].names)
    writer.writerows([repr(value) for value in one.values] for one in proposals)
    write_atomically(Path(path), text.getvalue())


def _worth(stage: MetaModelStage, candidates: Array, over: Array) -> tuple[Array, str]:
    """Return (m,) the merit of each candidate, and the name of its measure."""
    gain = stage.laws.gain(candidates, over)
    if gain is not None and np.all(np.isfinite(gain)) and np.any(gain > 0):
        return np.asarray(gain, float), "gain"
    doubt = np.asarray(stage.laws.doubt(candidates), float)
    if np.ptp(doubt) > 1e-9 * doubt.max():
        return doubt / doubt.max(), "doubt"
    return _distances(stage.designs, candidates, stage.designs.values).min(axis=1), "distance"


def _distances(designs: SolvedDesigns, one: Array, other: Array) -> Array:
    """Return (m, k) distances between designs (m, d) and (k, d), with the range of each parameter scaled to 1."""
    width = designs.scale
    found: Array = np.linalg.norm((one / width)[:, None] - (other / width)[None], axis=2)
    return found


def _unsolved(designs: SolvedDesigns, candidates: Array) -> Array:
    if not len(candidates):
        return candidates
    new: Array = candidates[_distances(designs, candidates, designs.values).min(axis=1) > SAME]
    return new


def _sweep_designs(study: Study, designs: SolvedDesigns) -> Array:
    """Return (m, d) designs of the study's sweep; empty without a sweep of the same parameters."""
    rows = []
    for design in sweep_designs(study) if study.block("sweep") is not None else ():
        known = design_parameters(design.family, design.material)
        if not design.cause and all(name in known for name in designs.names):
            rows.append([float(known[name]) for name in designs.names])
    return np.array(rows).reshape(-1, len(designs.names))


def _in_range(context: RunContext, study: Study, designs: SolvedDesigns, count: int, seed: int) -> Array:
    """Return (m, d) designs that fill the range evenly and that the family accepts, its corners first."""
    low, width = designs.box[:, 0], designs.scale
    d = len(designs.names)
    corners = np.array(list(product((0.0, 1.0), repeat=d)) if d <= MOST_CORNERS else []).reshape(-1, d)
    shares = np.concatenate([corners, scipy.stats.qmc.Sobol(d, seed=seed).random(count)])
    rows = [[float(f"{value:.{DIGITS}g}") for value in row] for row in low + shares * width]
    return np.array([row for row in rows if _possible(context, study, designs, row)]).reshape(-1, d)


def _possible(context: RunContext, study: Study, designs: SolvedDesigns, row: Sequence[float]) -> bool:
    """Return whether family and material can be built with these parameters."""
    changes: dict[str, dict[str, float]] = {"family": {}, "material": {}}
    for name, value in zip(designs.names, row, strict=True):
        block = "material" if name.startswith(MATERIAL) else "family"
        changes[block][name.removeprefix(MATERIAL)] = value
    try:
        for block in changes:
            if (config := getattr(study, block)) is not None:
                context.build(block, varied(config, changes[block]))
    except (InvalidDesignError, ValidationError):
        return False
    return True
