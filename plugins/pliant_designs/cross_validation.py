"""Cross-validation of a meta-model: each design is left out once and predicted by the others."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.execution.progress import Progress
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.law import JointLaw
from pliant.store.store import (
    CorruptedError,
    digests,
    read_checked,
    write_atomically,
    write_value,
    writing_in,
)
from pliant_designs.meta_model import MetaModel, enough_to_score
from pliant_designs.records import SolvedDesigns
from pliant_designs.solved_designs import scored_states

SEED = 0
# Up to this number of designs each is left out singly: leaving more out would cost too much accuracy.
FEW = 2
DIGESTS = "digests.json"
PLACES = ("all", "interior", "border")
STEPS = 12  # of the pressure range, between two free states
NEWTON = 30
MOST_LEVELS = 400  # of several actuations together, on a grid
# Newton's tolerance relative to the law's size; and the longest step, in the unit of u (rad, or shares of the box).
TOLERANCE = 1e-10
LONGEST = 0.25


@dataclass(frozen=True, eq=False)
class LeftOutResiduals:
    """Residuals of the laws of left-out designs on all their trusted states.

    Attributes:
        design: (m,) index of each state's design.
        place: (m, 1 + a) p (all of several actuations) and u, scaled to [−1, 1] on the box of the predicted law.
        miss: (m, a) predicted minus true effort, N·m (N for a prismatic joint).
        tau: (m, a) the true effort.
        counts: (m, a) whether an axis' effort is scored: lateral axes only in states that move them.
        check: (m,) whether the state has the role "check".
        size: (n, a) the predicted law's range of effort, of `effort_size`.
        doubt: (n,) uncertainty of each design by the model fitted without it (`DesignLaws.doubt`).
        free_design: (k,) design of each state of the free branch with p > 0.
        free_miss, free_angle: (k,) predicted minus true main angle (NaN if the law has no equilibrium), and true angle.
        wall_s: time of all fits.
    """

    design: NDArray[np.int64]
    place: Array
    miss: Array
    tau: Array
    counts: NDArray[np.bool_]
    check: NDArray[np.bool_]
    size: Array
    doubt: Array
    free_design: NDArray[np.int64]
    free_miss: Array
    free_angle: Array
    wall_s: float


def cross_validation_folds(
    designs: SolvedDesigns, folds: int, fewest: int, stated: bool = True
) -> list[NDArray[np.int64]]:
    """Return seeded parts of the designs, each to be left out in turn; single designs if there are few.

    Args:
        designs: all of them.
        folds: number of parts.
        fewest: designs that a fit needs.
        stated: whether the user chose `folds`; otherwise fewer designs than folds are left out singly.

    Raises:
        UserError: more parts than designs, or too few designs to leave one out.
    """
    n = len(designs)
    if stated and folds > n:
        raise UserError(
            f"meta_model.folds is {folds}, and there are {n} designs; at most {n} parts can be left out in turn."
        )
    enough_to_score(n, designs.names, fewest)
    count = min(folds, n)
    while count < n and n - -(-n // count) < max(fewest, len(designs.names) + 1):
        count += 1
    if n <= FEW * count:
        count = n
    order = np.random.default_rng(SEED).permutation(n)
    return [np.sort(part) for part in np.array_split(order, count)]


def misses_left_out(
    model: MetaModel,
    designs: SolvedDesigns,
    parts: Sequence[NDArray[np.int64]],
    partial: Path,
    progress: Progress,
) -> LeftOutResiduals:
    """Fit without each part and predict its designs; finished parts are kept in `partial` for the next attempt."""
    bar = progress.begin("designs left out", len(designs))
    found = []
    try:
        for number, part in enumerate(parts):
            bar.describe(f"fit {number + 1} of {len(parts)}")
            found.append(_part(partial / f"part-{number}", model, designs, part))
            bar.advance(len(part))
    finally:
        bar.finish()
    back = np.argsort(np.concatenate([one["part"] for one in found]))
    assert len(back) == len(designs)
    names = [name for name in found[0] if name not in ("part", "wall_s")]
    joined = {name: np.concatenate([one[name] for one in found]) for name in names}
    joined |= {name: joined[name][back] for name in ("size", "doubt")}
    return LeftOutResiduals(**joined, wall_s=float(sum(one["wall_s"] for one in found)))


def _part(folder: Path, model: MetaModel, designs: SolvedDesigns, part: NDArray[np.int64]) -> dict[str, Any]:
    """Return the residuals of one part, from its file if it is intact, else computed and saved."""
    try:
        found: dict[str, Any] = read_checked(folder, json.loads((folder / DIGESTS).read_text()))
        return found
    except (OSError, ValueError, CorruptedError):
        pass
    started = time.perf_counter()
    rest = np.ones(len(designs), bool)
    rest[part] = False
    laws = model.fit(designs.rows(rest)).laws
    doubt = np.asarray(laws.doubt(designs.values[part]), float)
    rows = [_design_residuals(laws.law(designs.values[i]), designs, int(i)) for i in part]
    found = {"part": part, "doubt": doubt, "size": np.stack([row.pop("size") for row in rows])}
    found |= {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    found["wall_s"] = time.perf_counter() - started
    with writing_in(folder.parent):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        write_value(folder, found)
        write_atomically(folder / DIGESTS, json.dumps(digests(folder)))
    return found


def _design_residuals(law: JointLaw, designs: SolvedDesigns, index: int) -> dict[str, Any]:
    """Return the residuals of the law of one design."""
    data = designs.data[index]
    keep, counts = scored_states(data)
    p, u, tau = data.actuation[keep], data.deformation[keep], data.tau[keep]
    free_miss, free_angle = free_misses(law, data)
    return {
        "design": np.full(len(p), index),
        "place": scaled(law.domain.box, p, u),
        "miss": law.evaluate(p, u).tau - tau,
        "tau": tau,
        "counts": counts,
        "check": data.role[keep] == "check",
        "size": effort_size(law),
        "free_design": np.full(len(free_miss), index),
        "free_miss": free_miss,
        "free_angle": free_angle,
    }


def scaled(box: Array, actuation: Array, deformation: Array) -> Array:
    """Return (m, 1 + a) p (all of several actuations) and u, scaled to [−1, 1] on a box."""
    values = np.column_stack([np.asarray(actuation, float), np.asarray(deformation, float)])
    places: Array = (values - box.mean(axis=1)) / (np.ptp(box, axis=1) / 2)
    return places


def effort_size(law: JointLaw) -> Array:
    """Return (a,) range of each axis' effort over p and its own u on the law's box, the other axes at rest."""
    places = axis_grids(law, 2, 3)
    return np.array([float(np.ptp(law.evaluate(p, u).tau[:, a])) for a, (p, u) in enumerate(places)])


def axis_grids(law: JointLaw, n_p: int, n_u: int) -> list[tuple[Array, Array]]:
    """Return for each axis p (g,) and u (g, a) on a grid of the law's box over p and that axis, other axes at rest.

    For m actuations p is (g, m), with fewer levels if the grid would be too large.
    """
    box, m, found = law.domain.box, len(law.actuations), []
    n_p = min(n_p, max(2, int(MOST_LEVELS ** (1 / m))))
    ticks = [*[np.linspace(0, 1, n_p)] * m, np.linspace(0, 1, n_u)]
    shares = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, m + 1)
    p = box[:m, 0] + shares[:, :m] * np.ptp(box[:m], axis=1)
    for a in range(len(law.axes)):
        deformation = np.zeros((len(p), len(law.axes)))
        deformation[:, a] = box[m + a, 0] + shares[:, m] * np.ptp(box[m + a])
        found.append((p[:, 0] if m == 1 else p, deformation))
    return found


def free_misses(law: JointLaw, data: ModuleData) -> tuple[Array, Array]:
    """Return the free branch's main deformation minus that of trusted free states with p > 0, and the latter.

    NaN if the law has no equilibrium on the branch from rest.
    """
    main = data.axes.index(data.main_axis)
    driven = np.any(data.actuation.reshape(len(data), -1) > 0, axis=1)
    rows = (data.branch == "free") & driven & np.isin(data.status, TRUSTED)
    rows &= data.explored == data.main_axis
    p, u = data.actuation[rows], data.deformation[rows]
    if p.ndim == 1:
        order = np.argsort(p, kind="stable")
        p, u = p[order], u[order]
    return free_branch(law, p)[:, main] - u[:, main], u[:, main]


def free_branch(law: JointLaw, actuation: Array) -> Array:
    """Return (n, a) equilibria without load at ascending actuations (n,), continued from rest; NaN beyond the last.

    Several actuations (n, m) have no order: each state is continued from rest separately.
    """
    m, found = len(law.actuations), np.full((len(actuation), len(law.axes)), np.nan)
    rest = np.zeros(m), np.zeros(len(law.axes))
    before, u = rest
    for index, target in enumerate(np.asarray(actuation, float).reshape(-1, m)):
        if m > 1:
            before, u = rest
        reached = _followed(law, before, target, u)
        if reached is not None:
            before, u = target, reached
            found[index] = u
        elif m == 1:
            break
    return found


def _followed(law: JointLaw, before: Array, target: Array, u: Array) -> Array | None:
    """Return the equilibrium at `target` (m,), continued in steps from u at `before`; None without one."""
    reach = LONGEST * np.ptp(law.domain.deformation, axis=1)
    for levels in np.linspace(before, target, STEPS + 1)[1:]:
        reached = _newton(law, levels if len(levels) == 1 else levels[None], u, reach)
        if reached is None:
            return None
        u = reached
    return u


def _newton(law: JointLaw, at: Array, start: Array, reach: Array) -> Array | None:
    """Return the stable equilibrium near `start` at one actuation (1,) or several (1, m), or None."""
    u = start.copy()
    for _ in range(NEWTON):
        effort = law.evaluate(at, u[None])
        slope = effort.dtau_du[0]
        try:
            step = np.linalg.solve(slope, effort.tau[0])
        except np.linalg.LinAlgError:
            return None
        if not np.all(np.isfinite(step)):
            return None
        u = u - step / max(1.0, float(np.max(np.abs(step) / reach)))
        if np.all(np.abs(step) <= TOLERANCE * reach):
            stable = np.linalg.eigvalsh(-(slope + slope.T) / 2)[0] > 0
            return u if stable else None
    return None


@dataclass(frozen=True)
class AxisScores:
    """Errors of one axis' effort on states of left-out designs.

    Attributes:
        n_states: number of states.
        r2: over all states.
        rmse, worst: in the effort's unit.
        rmse_of_range, worst_of_range: as shares of each design's own range of effort (`worst` over all states).
    """

    n_states: int
    r2: float
    rmse: float
    worst: float
    rmse_of_range: float
    worst_of_range: float


@dataclass(frozen=True)
class Scores:
    """Errors on the left-out designs of one group.

    Attributes:
        place: all, interior or border of the range of designs.
        n_designs: in the group.
        axes: axis → errors of its effort.
        free_median, free_worst: errors of the free angle, as shares of the design's largest free angle.
        free_states, free_lost: states of the free branch, and those in which the law has no equilibrium (worst = ∞).
        check_worst_of_range: worst share on states of role "check" only, over all axes.
    """

    place: str
    n_designs: int
    axes: Mapping[str, AxisScores]
    free_median: float
    free_worst: float
    free_states: int
    free_lost: int
    check_worst_of_range: float

    def _worst_axis_value(self, name: str, worst: Callable[..., float] = max) -> float:
        return worst((getattr(one, name) for one in self.axes.values()), default=np.nan)

    @property
    def r2(self) -> float:
        """R² of the worst axis."""
        return self._worst_axis_value("r2", min)

    @property
    def worst_of_range(self) -> float:
        """`worst_of_range` of the worst axis."""
        return self._worst_axis_value("worst_of_range")

    @property
    def rmse_of_range(self) -> float:
        """`rmse_of_range` of the worst axis."""
        return self._worst_axis_value("rmse_of_range")

    def as_values(self) -> dict[str, Any]:
        """Return the scores as JSON values."""
        summary = {name: getattr(self, name) for name in ("r2", "worst_of_range", "rmse_of_range")}
        return {**vars(self), **summary, "axes": {axis: dict(vars(one)) for axis, one in self.axes.items()}}

    @staticmethod
    def from_values(values: Mapping[str, Any]) -> Scores:
        """Return the scores from the output of `as_values`."""
        axes = {axis: AxisScores(**one) for axis, one in values["axes"].items()}
        names = set(Scores.__dataclass_fields__) - {"axes"}
        return Scores(axes=axes, **{name: values[name] for name in names})


def scores_by_place(designs: SolvedDesigns, misses: LeftOutResiduals) -> dict[str, Scores]:
    """Return the scores of all designs, of those inside the range and of those on its border; no empty groups."""
    border = designs.corners()
    groups = {"all": np.ones(len(designs), bool), "interior": ~border, "border": border}
    return {place: _scores(place, designs, misses, groups[place]) for place in PLACES if groups[place].any()}


def _scores(place: str, designs: SolvedDesigns, misses: LeftOutResiduals, group: NDArray[np.bool_]) -> Scores:
    rows, share, axes = group[misses.design], np.abs(shares(misses)), {}
    for a, axis in enumerate(designs.data[0].axes):
        keep = rows & misses.counts[:, a]
        if not keep.any():
            continue
        miss, tau, of_range = misses.miss[keep, a], misses.tau[keep, a], share[keep, a]
        spread = float(np.sum((tau - tau.mean()) ** 2))
        axes[axis] = AxisScores(
            n_states=len(miss),
            r2=1.0 - float(np.sum(miss**2)) / spread if spread > 0 else float("nan"),
            rmse=float(np.sqrt(np.mean(miss**2))),
            worst=float(np.abs(miss).max()),
            rmse_of_range=float(np.sqrt(np.mean(of_range**2))),
            worst_of_range=float(of_range.max()),
        )
    largest = np.full(len(misses.size), np.nan)
    for design in np.unique(misses.free_design):
        largest[design] = np.abs(misses.free_angle[misses.free_design == design]).max()
    free = np.abs(misses.free_miss) / largest[misses.free_design]
    free = np.where(np.isnan(free), np.inf, free)[group[misses.free_design]]
    kept = rows & misses.check
    check = share[kept][misses.counts[kept]]
    return Scores(
        place=place,
        n_designs=int(group.sum()),
        axes=axes,
        free_median=float(np.median(free)) if len(free) else float("nan"),
        free_worst=float(free.max(initial=0.0)) if len(free) else float("nan"),
        free_states=len(free),
        free_lost=int(np.isinf(free).sum()),
        check_worst_of_range=float(check.max()) if check.size else float("nan"),
    )


def shares(misses: LeftOutResiduals) -> Array:
    """Return (m, a) residuals as shares of the range of the true effort of that design and axis."""
    ranges: Array = np.full_like(misses.size, np.nan)
    for design in np.unique(misses.design):
        rows = misses.design == design
        for a in range(misses.size.shape[1]):
            tau = misses.tau[rows & misses.counts[:, a], a]
            ranges[design, a] = (float(np.ptp(tau)) if len(tau) else 0.0) or np.nan
    found: Array = misses.miss / ranges[misses.design]
    return found
