"""Least squares (`pliant.least_squares`) of a black box that may refuse a trial; slopes by finite differences.

The fitted parameters are the numeric constants of a material's config.
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
from pliant.mechanics.homogeneous import INCOMPRESSIBLE_RATIO
from pliant.records.design import Array

# Numbers of a block that a static test does not determine, or hardly.
NEVER, RATIO = "density_kg_m3", "poisson_ratio"
NOT_BY_DEFAULT = (NEVER, RATIO)
MODULUS = "_pa"


@dataclass(frozen=True)
class MaterialConstant:
    """One number of the material's block.

    Attributes:
        field: name of the config's field.
        index: index in the field if that is a list, else None.
        written: its key in a study: `c10`, `mu.0`.
        value: in SI.
    """

    field: str
    index: int | None
    written: str
    value: float

    @property
    def name(self) -> str:
        """The field, with the index in a list: `c10_pa`, `mu_pa.0`."""
        return self.field if self.index is None else f"{self.field}.{self.index}"

    @property
    def is_modulus(self) -> bool:
        """Return whether the energy is proportional to such constants, taken together."""
        return self.field.endswith(MODULUS)

    @property
    def is_power(self) -> bool:
        """Return whether it is neither a modulus nor Poisson's ratio."""
        return not self.is_modulus and self.field != RATIO

    @property
    def unit(self) -> str:
        return "Pa" if self.is_modulus else ""


def material_constants(config: MaterialConfig) -> tuple[MaterialConstant, ...]:
    """Return all numbers of the block except the density, in the order of its fields."""
    found = []
    for field in type(config).model_fields:
        value, written = getattr(config, field), written_name(type(config), field)
        if field != NEVER and _is_number(value):
            found.append(MaterialConstant(field, None, written, float(value)))
        elif isinstance(value, tuple) and value and all(map(_is_number, value)):
            found += [MaterialConstant(field, i, f"{written}.{i}", float(v)) for i, v in enumerate(value)]
    return tuple(found)


def chosen(config: MaterialConfig, names: Sequence[str] | None) -> tuple[MaterialConstant, ...]:
    """Return the constants to fit: those named, by field or key of a study, or all except Poisson's ratio.

    The name of a list selects all its numbers. Raises `UserError` for an unknown name or a material without constants.
    """
    known = material_constants(config)
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
    """Return the config with these values, or None if it refuses them."""
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


def is_incompressible(config: MaterialConfig, constants: Sequence[MaterialConstant]) -> bool:
    """Return whether homogeneous tests are interpreted as those of an incompressible solid.

    This is so if the study states no Poisson's ratio, or the largest one, and none is fitted. A default is not a
    measurement: at large stretch its change of volume would bias the constants.
    """
    if RATIO not in type(config).model_fields or any(c.field == RATIO for c in constants):
        return False
    return RATIO not in config.model_fields_set or getattr(config, RATIO) >= INCOMPRESSIBLE_RATIO


def moduli_scaled(config: MaterialConfig, factor: float) -> MaterialConfig | None:
    """Return the config with every modulus times `factor`: a solid whose stresses are `factor` times as large."""
    moduli = [c for c in material_constants(config) if c.is_modulus]
    return changed(config, moduli, [factor * c.value for c in moduli])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


Residuals = Callable[[Array], Array | None]
# A step may be refused up to a damping of 1e12.
STEPS = Steps(most=60, tries=16, harder=10.0, easier=10.0, least_damping=1e-12, least_gain=1e-14)


@dataclass(frozen=True, eq=False)
class Fit:
    """A minimum of Σ r².

    Attributes:
        values: (k,) constants in SI.
        residuals: (n,) weighted residuals there.
        jacobian: (n, k) their slopes by the constants.
        converged: whether the last steps were small.
    """

    values: Array
    residuals: Array
    jacobian: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class BlackBox:
    """Least-squares problem to minimise.

    Attributes:
        residuals: (n,) of the constants (k,), None for invalid ones.
        scales: (k,) the size of a significant change of each constant.
        step: of finite differences, in scales.
        central: whether differences are central.
        tolerance: a step below this share of the scales ends the search.
        least: a step that lowers Σ r² by less than this share also ends it.
        limit: (k,) largest sizes of the constants; none by default.
    """

    residuals: Residuals
    scales: Array
    step: float
    central: bool
    tolerance: float
    least: float = 1e-14
    limit: Array | None = None

    def jacobian(self, values: Array, here: Array) -> Array | None:
        """Return ∂r/∂constants (n, k); None if the neighbours on both sides are refused."""
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
        """Return the residuals as data − model, with the sign changed, at x in units of the scales."""
        found = self.residuals(x * self.scales)
        with np.errstate(over="ignore"):  # invalid constants; an infinite error is refused
            return None if found is None else Point(x, -found, float(found @ found))

    def slopes(self, point: Point) -> Array | None:
        """Return ∂residuals/∂x of a point."""
        found = self.jacobian(point.x * self.scales, -point.residual)
        return None if found is None else found * self.scales


def minimised(problem: BlackBox, start: Array) -> Fit | None:
    """Return the minimum nearest to `start`; None if the start is refused."""
    first = problem.point(np.asarray(start, float) / problem.scales)
    slopes = None if first is None else problem.slopes(first)
    if first is None or slopes is None:
        return None
    steps = replace(STEPS, least_gain=problem.least, least_step=problem.tolerance)
    limit = np.full(len(start), np.inf) if problem.limit is None else problem.limit / problem.scales
    found, converged = descend(problem, replace(first, slopes=slopes), steps, (-limit, limit))
    assert found.slopes is not None or not converged
    known = slopes if found.slopes is None else found.slopes
    return Fit(found.x * problem.scales, -found.residual, known / problem.scales, converged)
