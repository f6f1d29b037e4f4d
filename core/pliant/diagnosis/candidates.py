"""Candidates: sets of effects whose parameters may be fitted, and where to start."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from pydantic import ValidationError

from pliant.errors import UserError
from pliant.interfaces.effect import EffectConfig, EffectParameter
from pliant.records.design import Array
from pliant.registry.discovery import Registry

# Half-width of a central 90 % interval in standard deviations.
NINETY = 1.6449
# Where fits of a strength start, as a share of the way from neutral to the far end of the plausible range.
START_SHARE = 0.3
MOST_STARTS = 3


@dataclass(frozen=True)
class Knob:
    """One parameter of one effect of a candidate, seen as a number x of order 1.

    x = (v − neutral) / reach for strengths and shapes with a normal prior, with reach the distance from neutral
    to the far end of the plausible range; x = ln(v / middle) / s with a log-normal prior.
    """

    effect: int
    kind: str
    parameter: EffectParameter

    @property
    def name(self) -> str:
        return f"{self.kind}.{self.parameter.name}"

    def value(self, x: float) -> float:
        """The parameter's value within its bounds."""
        p = self.parameter
        v = p.neutral + x * self._reach if p.prior == "normal" else self._middle * math.exp(x * self._spread)
        return min(max(v, p.bounds[0]), p.bounds[1])

    def x(self, value: float) -> float:
        """The number that gives this value."""
        if self.parameter.prior == "normal":
            return (value - self.parameter.neutral) / self._reach
        return math.log(value / self._middle) / self._spread

    def slope(self, x: float) -> float:
        """dv/dx."""
        return self._reach if self.parameter.prior == "normal" else self.value(x) * self._spread

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds in x."""
        low, high = self.parameter.bounds
        if self.parameter.prior == "log_normal":
            low = max(low, 1e-6 * self._middle)
        return self.x(low), self.x(high)

    @property
    def is_strength(self) -> bool:
        return self.parameter.role == "strength"

    @property
    def plausible(self) -> tuple[float, float]:
        """The plausible range in x."""
        low, high = self.parameter.plausible
        return self.x(low), self.x(high)

    def starts(self) -> tuple[float, ...]:
        """Where fits begin: one strength, two shapes."""
        low, high = self.plausible
        if self.is_strength:
            return (START_SHARE * (high if abs(high) >= abs(low) else low),)
        return (low + 0.25 * (high - low), low + 0.75 * (high - low))

    @property
    def _reach(self) -> float:
        p = self.parameter
        return max(abs(p.plausible[0] - p.neutral), abs(p.plausible[1] - p.neutral))

    @property
    def _middle(self) -> float:
        return math.sqrt(self.parameter.plausible[0] * self.parameter.plausible[1])

    @property
    def _spread(self) -> float:
        return math.log(self.parameter.plausible[1] / self.parameter.plausible[0]) / (2 * NINETY)


@dataclass(frozen=True)
class Candidate:
    """A set of effects, in the order in which they are applied; the empty set is the model as it is."""

    kinds: tuple[str, ...]
    knobs: tuple[Knob, ...]
    models: tuple[type[EffectConfig], ...]

    @staticmethod
    def of(registry: Registry, kinds: Sequence[str]) -> Candidate:
        """Raises `UserError` for an unknown kind, and for one whose config refuses its own parameters or bounds."""
        components = [registry.get("effect", kind) for kind in kinds]
        models = tuple(cast(type[EffectConfig], component.config_model()) for component in components)
        knobs = tuple(
            Knob(index, kind, parameter)
            for index, (kind, model) in enumerate(zip(kinds, models, strict=True))
            for parameter in model.fit_parameters()
        )
        found = Candidate(tuple(kinds), knobs, models)
        for end in found.limits():
            found.configs(np.where(np.isfinite(end), end, 0.0))
        return found

    def __len__(self) -> int:
        return len(self.knobs)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """The effects at x (k,); raises `UserError` where a plugin's config refuses its own parameters."""
        values: list[dict[str, float]] = [{} for _ in self.kinds]
        for knob, number in zip(self.knobs, x, strict=True):
            values[knob.effect][knob.parameter.name] = knob.value(float(number))
        return tuple(
            _config(model, kind, given)
            for model, kind, given in zip(self.models, self.kinds, values, strict=True)
        )

    def values(self, x: Array) -> dict[str, float]:
        """Parameter values by ``kind.name``."""
        return {knob.name: knob.value(float(n)) for knob, n in zip(self.knobs, x, strict=True)}

    def limits(self) -> tuple[Array, Array]:
        """(k,) lowest and highest x."""
        pairs = np.array([knob.limits for knob in self.knobs], float).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def starts(self, known: dict[str, float] | None = None) -> list[Array]:
        """Points (k,) from which fits begin; `known` fixes the start of some knobs by name."""
        known = known or {}
        options = [(known[knob.name],) if knob.name in known else knob.starts() for knob in self.knobs]
        found = [np.array(point, float) for point in itertools.product(*options)]
        if len(found) <= MOST_STARTS:
            return found
        return [found[k] for k in np.linspace(0, len(found) - 1, MOST_STARTS).round().astype(int)]


def _config(model: type[EffectConfig], kind: str, given: dict[str, float]) -> EffectConfig:
    try:
        return model.model_validate({"kind": kind, **given})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(map(str, first["loc"]))
        raise UserError(
            f"The parameters of effect '{kind}' and the fields of its config disagree ({field}: {first['msg']}); "
            f"'pliant check effect {kind}' tells what is asked of them."
        ) from None
