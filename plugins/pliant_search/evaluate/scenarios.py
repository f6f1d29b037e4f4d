"""Scenarios of a design's uncertainty, in which every candidate is evaluated.

The scenarios are drawn once from a seed and are the same for all candidates (common random numbers), so that chance
does not affect comparisons. Each varied key has a Latin hypercube with a separate random stream (McKay, Beckman,
Conover, Technometrics 21, 1979): any number of samples covers each key's range evenly, ends included. For additive
effects, as those of small tolerances nearly are, the mean has a far lower variance than that of independent draws
(Stein, Technometrics 29, 1987). Sobol points would be equally good only for powers of two.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from pliant.config.design_parameters import MATERIAL, shown
from pliant.config.study import Study
from pliant.config.study_keys import KeyPath, study_key
from pliant.errors import UserError
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.registry.discovery import Registry
from pliant.units import UnitError, parse_quantity
from pliant_designs.solved_designs import ROUNDING, solved_designs
from pliant_search.config import RobustConfig
from pliant_search.evaluate.fast_path import LawDraw
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.problem.study_setter import number_at, overridden, written_path

# A normal deviation is truncated at this number of standard deviations.
CUT = 3.0
TINY = float(np.finfo(float).tiny)
FORMS = "'5 %' (half width, relative), '0.1 mm' (half width) or {sd: 0.03} (normal deviation)"


@dataclass(frozen=True)
class Deviation:
    """Uncertainty of a key: the half width of a uniform or the standard deviation of a normal distribution.

    Attributes:
        key: as the study writes it.
        path: of the key.
        size: in the key's SI unit, or a share of its value.
        relative: whether it is a share.
        normal: whether it is a standard deviation.
    """

    key: str
    path: KeyPath
    size: float
    relative: bool
    normal: bool

    def amounts(self, count: int, seed: int) -> Array:
        """Return (count,) amounts of a Latin hypercube, in the unit of `size`; each key has a separate stream."""
        random = np.random.default_rng([seed, zlib.crc32(self.key.encode())])
        shares = (random.permutation(count) + random.random(count)) / count
        if not self.normal:
            return np.asarray(self.size * (2.0 * shares - 1.0))
        normal = NormalDist()
        low = normal.cdf(-CUT)
        return np.array([self.size * normal.inv_cdf(low + share * (1 - 2 * low)) for share in shares])

    def moved(self, value: float, amount: float) -> float:
        """Return the value, shifted by an amount."""
        return value * (1.0 + amount) if self.relative else value + amount

    @property
    def reach(self) -> float:
        """The largest amount, in the unit of `size`."""
        return CUT * self.size if self.normal else self.size

    def room(self, box: tuple[float, float]) -> tuple[float, float]:
        """Return the interval of positive values that stay in a range under every deviation."""
        low, high = box
        if self.relative:
            return low / max(1.0 - self.reach, TINY), high / (1.0 + self.reach)
        return low + self.reach, high - self.reach

    @property
    def parameter(self) -> str:
        """The parameter of a meta-model that it varies (`wall_m`, `material.shear_modulus_pa`); "" for other keys."""
        head, *rest = self.path
        if head == "family" or (self.path[:2] == ("chain", "segments") and self.path[3:4] == ("family",)):
            return str(rest[-1])
        return f"{MATERIAL}{rest[0]}" if head == "material" else ""


@dataclass(frozen=True)
class Scenario:
    """One realisation of the uncertain keys and laws.

    Attributes:
        name: for messages.
        deviations: pairs (deviation, amount) of this scenario.
        law: index of the drawn law of each design; None uses the laws without a draw.
    """

    name: str
    deviations: tuple[tuple[Deviation, float], ...] = ()
    law: LawDraw | None = None

    def changes(self, study: Study) -> dict[KeyPath, float]:
        """Return key → value for the keys that differ in this scenario, relative to the candidate's own values.

        A key of `family` also deviates in each segment that states its own value, relative to that value.

        Raises:
            UserError: the study has no number at the key.
        """
        found: dict[KeyPath, float] = {}
        for deviation, amount in self.deviations:
            for path in (deviation.path, *overridden(study, deviation.path)):
                found[path] = deviation.moved(number_at(study, path), amount)
        return found


def draw_scenarios(problem: SearchProblem, registry: Registry, config: RobustConfig) -> tuple[Scenario, ...]:
    """Return the scenarios of a robust search; `problem` is its `SearchProblem`.

    Raises:
        UserError: nothing is varied, or a key cannot be varied.
    """
    if not config.laws and not config.vary:
        raise UserError("search.robust varies nothing: set 'laws: true', or name keys in 'vary'.")
    deviations = [_deviation(problem.study, registry, key, said) for key, said in config.vary.items()]
    amounts = [one.amounts(config.samples, config.seed) for one in deviations]
    return tuple(
        Scenario(
            f"scenario {k + 1}",
            tuple((one, float(column[k])) for one, column in zip(deviations, amounts, strict=True)),
            LawDraw(k, config.samples, config.seed) if config.laws else None,
        )
        for k in range(config.samples)
    )


def measure(values: Sequence[float], config: RobustConfig) -> float:
    """Return the mean, worst or CVaR of minimised objectives over scenarios; NaN if one of them is NaN.

    CVaR is the mean of the worst 1 − level (Rockafellar, Uryasev, J. Risk 2, 2000); if (1 − level) n is no integer, the
    last scenario counts in part.
    """
    ordered = np.sort(np.asarray(values, float))[::-1]
    if not len(ordered) or np.isnan(ordered).any():
        return math.nan
    if config.measure == "mean":
        return float(ordered.mean())
    if config.measure == "worst":
        return float(ordered[0])
    tail = (1.0 - config.level) * len(ordered)
    weights = np.clip(tail - np.arange(len(ordered)), 0.0, 1.0)
    weights[0] = max(weights[0], TINY)
    with np.errstate(invalid="ignore"):  # an infinite objective of weight 0 would give 0 · ∞
        return float(np.sum(np.where(weights > 0, weights * ordered, 0.0)) / weights.sum())


def _deviation(study: Study, registry: Registry, written: str, said: Any) -> Deviation:
    place = f"search.robust.vary.{written}"
    if "." not in written:
        raise UserError(
            f"{place}: name a key of the study by dots, such as task.friction or effects.0.factor."
        )
    key = study_key(study, registry, written, "search.robust.vary")
    if key.sort != "real":
        raise UserError(f"{place}: only numbers with decimals can be varied, and this key holds none.")
    normal = isinstance(said, Mapping)
    if normal and set(said) != {"sd"}:
        raise UserError(f"{place} is {dict(said)}; write {FORMS}.")
    width = said["sd"] if isinstance(said, Mapping) else said
    relative = isinstance(width, str) and width.strip().endswith("%")
    try:
        if isinstance(width, str):
            size = parse_quantity(width, "dimensionless" if relative or not key.unit else key.unit)
        elif isinstance(width, int | float) and not isinstance(width, bool):
            size = float(width)
        else:
            raise UnitError(f"{width!r} is no width")
    except UnitError as error:
        raise UserError(f"{place}: {error}; write {FORMS}.") from None
    if not (math.isfinite(size) and size > 0):
        raise UserError(f"{place} is {width}; a width is above 0: write {FORMS}.")
    return Deviation(written, key.path, size, relative, normal)


def tolerance_notes(
    context: RunContext, problem: SearchProblem, scenarios: tuple[Scenario, ...]
) -> list[str]:
    """Return a note for each tolerance that takes candidates out of the meta-model's range, with a remedy.

    Args:
        context: plugins and store; unsolved designs of a sweep are solved.
        problem: of the robust search.
        scenarios: of the robust search; all have the same keys.

    Raises:
        UserError: no candidate stays inside the range.
    """
    block = problem.study.block("meta_model")
    deviations = [one for one, _ in scenarios[0].deviations if one.parameter]
    if block is None or block.extrapolate or not deviations:
        return []
    designs = solved_designs(context, problem.study).designs
    boxes = dict(zip(designs.names, designs.box.tolist(), strict=True))
    notes = []
    for deviation in deviations:
        # The key, and for a family's key also those of segments that state it or whose variables set it.
        own = [
            key
            for variable in problem.variables
            for key in variable.keys
            if deviation.path[0] == "family"
            and key[:2] == ("chain", "segments")
            and key[3:] == deviation.path
        ]
        paths = dict.fromkeys((deviation.path, *overridden(problem.study, deviation.path), *own))
        if deviation.parameter in boxes:
            notes += [_note(problem, deviation, path, boxes[deviation.parameter]) for path in paths]
    return [note for note in notes if note]


def _note(problem: SearchProblem, deviation: Deviation, path: KeyPath, box: tuple[float, float]) -> str:
    """Return a sentence if the key at a path leaves the box, else ""."""
    everywhere, held = False, list[float]()  # its lowest and highest values without a deviation
    setters = [one for one in problem.variables if path in one.keys]
    for one in setters:
        everywhere |= len(one.conditions) == len(problem.conditions)
        held += one.settings.values() or (one.variable.low, one.variable.high)
    stated = [condition.changes[path] for condition in problem.conditions if path in condition.changes]
    held += stated
    if not everywhere and len(stated) < len(problem.conditions):
        held.append(number_at(problem.study, path))
    low, high = min(held), max(held)
    reached = deviation.moved(low, -deviation.reach), deviation.moved(high, deviation.reach)
    slack = ROUNDING * (box[1] - box[0])
    if box[0] - slack <= reached[0] and reached[1] <= box[1] + slack:
        return ""

    def said(ends: tuple[float, float]) -> str:
        return " to ".join(dict.fromkeys(shown(deviation.parameter, end) for end in ends))

    key, names = written_path(path), [one.name for one in setters]
    who = f"{key} ({', '.join(names)})" if names and names != [key] else key
    leaves = (
        f"search.robust.vary: with its tolerance {who}, {said((low, high))}, comes to {said(reached)}, outside the "
        f"meta-model's range {said(box)}"
    )
    room = deviation.room(box)
    inside = max(room[0], low), min(room[1], high)
    remedy = "solve designs beyond, or set meta_model.extrapolate: true."
    if inside[0] > inside[1] + slack:
        raise UserError(f"{leaves}, and no candidate stays inside; make the tolerance smaller, {remedy}")
    return f"{leaves}, where candidates fail; keep it within {said(inside)}, {remedy}"
