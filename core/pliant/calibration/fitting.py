"""Least squares (`pliant.least_squares`) of a black box that may refuse a trial; slopes by finite differences.

What is fitted to a test are the constants of a material's config, as numbers that a fit may change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from pliant.config.study import written_name
from pliant.errors import UserError, closest
from pliant.interfaces.material import MaterialConfig
from pliant.least_squares import Point, Steps, descend
from pliant.records.design import Array

# Numbers of a block that a static test does not decide, or hardly.
NOT_BY_DEFAULT = ("density_kg_m3", "poisson_ratio")
NEVER = "density_kg_m3"
MODULUS = "_pa"


@dataclass(frozen=True)
class MaterialConstant:
    """One number of the material's block.

    Attributes:
        field: name of the config's field.
        index: place in the field where that is a list, else None.
        written: how a study writes it: `c10`, `mu.0`.
        value: in SI.
    """

    field: str
    index: int | None
    written: str
    value: float

    @property
    def name(self) -> str:
        """The field, with the place in a list: `c10_pa`, `mu_pa.0`."""
        return self.field if self.index is None else f"{self.field}.{self.index}"

    @property
    def is_modulus(self) -> bool:
        """Whether the energy is proportional to such constants, taken together."""
        return self.field.endswith(MODULUS)

    @property
    def unit(self) -> str:
        return "Pa" if self.is_modulus else ""


def constants_of(config: MaterialConfig) -> tuple[MaterialConstant, ...]:
    """All numbers of the block but the density, in the order of its fields."""
    found = []
    for field in type(config).model_fields:
        value, written = getattr(config, field), written_name(type(config), field)
        if field != NEVER and _is_number(value):
            found.append(MaterialConstant(field, None, written, float(value)))
        elif isinstance(value, tuple) and value and all(map(_is_number, value)):
            found += [MaterialConstant(field, i, f"{written}.{i}", float(v)) for i, v in enumerate(value)]
    return tuple(found)


def chosen(config: MaterialConfig, names: Sequence[str] | None) -> tuple[MaterialConstant, ...]:
    """The constants to fit: those named, by field or as a study writes them, or all but Poisson's ratio.

    A list's name means all its numbers. Raises `UserError` for an unknown name or a material without constants.
    """
    known = constants_of(config)
    if not names:
        usual = tuple(c for c in known if c.field not in NOT_BY_DEFAULT)
        if not usual:
            raise UserError(f"material '{config.kind}' has no constants to fit; choose one that has some.")
        return usual
    found: list[MaterialConstant] = []
    for name in names:
        if name in (NEVER, "density"):
            raise UserError("--fit density: no static test depends on the density; weigh a sample.")
        named = [c for c in known if name in (c.field, c.name, c.written, c.written.partition(".")[0])]
        if not named:
            words = list(dict.fromkeys(c.written for c in known))
            raise UserError(
                f"--fit {name}: material '{config.kind}' has no such constant{closest(name, words)} "
                f"It has {', '.join(words)}."
            )
        found += [c for c in named if c not in found]
    return tuple(c for c in known if c in found)


def changed(
    config: MaterialConfig, constants: Sequence[MaterialConstant], values: Sequence[float]
) -> MaterialConfig | None:
    """The config with these values, or None where it refuses them."""
    fields: dict[str, Any] = config.model_dump()
    for constant, value in zip(constants, values, strict=True):
        if constant.index is None:
            fields[constant.field] = float(value)
        else:
            items = list(fields[constant.field])
            items[constant.index] = float(value)
            fields[constant.field] = tuple(items)
    try:
        return type(config).model_validate(fields)
    except ValidationError:
        return None


def moduli_scaled(config: MaterialConfig, factor: float) -> MaterialConfig | None:
    """The config with every modulus times `factor`: a solid whose stresses are `factor` times as large."""
    moduli = [c for c in constants_of(config) if c.is_modulus]
    return changed(config, moduli, [factor * c.value for c in moduli])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


Residuals = Callable[[Array], Array | None]
# A step may be refused until its damping is 1e12.
STEPS = Steps(most=60, tries=16, harder=10.0, easier=10.0, least_damping=1e-12, least_gain=1e-14)


@dataclass(frozen=True, eq=False)
class Fit:
    """A minimum of Σ r².

    Attributes:
        values: (k,) constants in SI.
        residuals: (n,) weighted residuals there.
        jacobian: (n, k) their slopes by the constants.
        converged: whether steps had become small when it ended.
    """

    values: Array
    residuals: Array
    jacobian: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class BlackBox:
    """What is minimised.

    Attributes:
        residuals: (n,) of the constants (k,), None where they make no sense.
        scales: (k,) the size of a change that matters, for each constant.
        step: of finite differences, in scales.
        central: whether differences are taken both ways.
        tolerance: a step below this share of the scales ends the search.
        least: a step that lowers Σ r² by less than this share ends it too.
    """

    residuals: Residuals
    scales: Array
    step: float
    central: bool
    tolerance: float
    least: float = 1e-14

    def jacobian(self, values: Array, here: Array) -> Array | None:
        """∂r/∂constants (n, k); None where a neighbour is refused on both sides."""
        columns = []
        for k, scale in enumerate(self.scales):
            move = np.zeros(len(values))
            move[k] = self.step * scale
            after = self.residuals(values + move)
            before = self.residuals(values - move) if self.central or after is None else None
            if after is None and before is None:
                return None
            if after is not None and before is not None:
                columns.append((after - before) / (2 * move[k]))
            elif after is not None:
                columns.append((after - here) / move[k])
            elif before is not None:
                columns.append((here - before) / move[k])
        return np.stack(columns, axis=1)

    def point(self, x: Array) -> Point | None:
        """The residuals, model − data turned to data − model, at x in units of the scales."""
        found = self.residuals(x * self.scales)
        return None if found is None else Point(x, -found, float(found @ found))

    def slopes(self, point: Point) -> Array | None:
        """∂residuals/∂x of a point."""
        found = self.jacobian(point.x * self.scales, -point.residual)
        return None if found is None else found * self.scales


def minimised(problem: BlackBox, start: Array) -> Fit | None:
    """The minimum nearest to `start`; None where the start itself is refused."""
    first = problem.point(np.asarray(start, float) / problem.scales)
    slopes = None if first is None else problem.slopes(first)
    if first is None or slopes is None:
        return None
    steps = replace(STEPS, least_gain=problem.least, least_step=problem.tolerance)
    free = np.full(len(start), np.inf)
    found, converged = descend(problem, replace(first, slopes=slopes), steps, (-free, free))
    assert found.slopes is not None or not converged
    known = slopes if found.slopes is None else found.slopes
    return Fit(found.x * problem.scales, -found.residual, known / problem.scales, converged)
