"""Candidates: sets of effects whose parameters may be fitted, and where to start."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
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
# A parameter that the data do not feel stays near the middle of its prior: its weight in units of squared residuals.
PRIOR_WEIGHT = 0.1
# Where fits of a strength start, as a share of the way from neutral to the far end of the plausible range.
START_SHARE = 0.3
MOST_STARTS = 3


def candidate_kinds(registry: Registry, kinds: Sequence[str] | None = None) -> list[str]:
    """Kinds of effects that a diagnosis may fit, each once: all that have a number to fit where none are named.

    Raises:
        UserError: a kind that is not known, or one without a number to fit.
    """
    if kinds is None:
        return [kind for kind in registry.kinds("effect") if _fitted(registry, kind)]
    for kind in kinds:
        if not _fitted(registry, kind):
            raise UserError(
                f"effect '{kind}' has no number that is fitted by itself, so it is no candidate; "
                + ("'pliant improve --learned' learns one." if kind == "learned" else "name others.")
            )
    return list(dict.fromkeys(kinds))


def _fitted(registry: Registry, kind: str) -> bool:
    return bool(cast(type[EffectConfig], registry.get("effect", kind).config_model()).fit_parameters())


@dataclass(frozen=True)
class FitParameter:
    """One parameter of one effect of a candidate, seen as a number x of order 1.

    x = (v − neutral) / reach for strengths and shapes with a normal prior, with reach the distance from neutral
    to the far end of the plausible range, for forms the standard deviation of which 90 % are that; with a log-normal
    prior x = ln(v / middle) / s.
    """

    effect: int
    kind: str
    declared: EffectParameter

    @property
    def name(self) -> str:
        return f"{self.kind}.{self.declared.name}"

    def value(self, x: float) -> float:
        """The parameter's value within its bounds."""
        p = self.declared
        v = p.neutral + x * self._reach if p.prior == "normal" else self._middle * math.exp(x * self._spread)
        return min(max(v, p.bounds[0]), p.bounds[1])

    def x(self, value: float) -> float:
        """The number that gives this value."""
        if self.declared.prior == "normal":
            return (value - self.declared.neutral) / self._reach
        return math.log(value / self._middle) / self._spread

    def slope(self, x: float) -> float:
        """dv/dx: the parameter's value by its scaled coordinate x."""
        return self._reach if self.declared.prior == "normal" else self.value(x) * self._spread

    @property
    def limits(self) -> tuple[float, float]:
        """The parameter's bounds as bounds of x."""
        low, high = self.declared.bounds
        if self.declared.prior == "log_normal":
            low = max(low, 1e-6 * self._middle)
        return self.x(low), self.x(high)

    @property
    def is_strength(self) -> bool:
        return self.declared.role == "strength"

    @property
    def is_form(self) -> bool:
        return self.declared.role == "form"

    @property
    def pull(self) -> float:
        """Weight of the prior in x², in units of squared residuals: weak where it only keeps the idle in place.

        Forms are nuisances with a real prior, a standard normal one in x.
        """
        return 1.0 if self.is_form else PRIOR_WEIGHT

    @property
    def plausible(self) -> tuple[float, float]:
        """The plausible range in x."""
        low, high = self.declared.plausible
        return self.x(low), self.x(high)

    def starts(self) -> tuple[float, ...]:
        """Where fits begin: one strength, two shapes, the plain form."""
        if self.is_form:
            return (self.x(self.declared.neutral),)
        low, high = self.plausible
        if self.is_strength:
            return (START_SHARE * (high if abs(high) >= abs(low) else low),)
        return (low + 0.25 * (high - low), low + 0.75 * (high - low))

    @property
    def _reach(self) -> float:
        p = self.declared
        reach = max(abs(p.plausible[0] - p.neutral), abs(p.plausible[1] - p.neutral))
        return reach / NINETY if self.is_form else reach

    @property
    def _middle(self) -> float:
        return math.sqrt(self.declared.plausible[0] * self.declared.plausible[1])

    @property
    def _spread(self) -> float:
        return math.log(self.declared.plausible[1] / self.declared.plausible[0]) / (2 * NINETY)


@dataclass(frozen=True)
class EffectSet:
    """A set of effects, in the order in which they are applied; the empty set is the model as it is.

    Parameters of the role `form` are among `parameters` where they may vary; elsewhere they keep their neutral value.
    """

    kinds: tuple[str, ...]
    parameters: tuple[FitParameter, ...]
    models: tuple[type[EffectConfig], ...]

    @staticmethod
    def of(registry: Registry, kinds: Sequence[str], forms: Collection[str] = ()) -> EffectSet:
        """Those of these kinds, with free forms for those that are among `forms`, too.

        Raises `UserError` for an unknown kind, and for one whose config refuses its own parameters or bounds.
        """
        components = [registry.get("effect", kind) for kind in kinds]
        models = tuple(cast(type[EffectConfig], component.config_model()) for component in components)
        parameters = tuple(
            FitParameter(index, kind, parameter)
            for index, (kind, model) in enumerate(zip(kinds, models, strict=True))
            for parameter in (*model.fit_parameters(), *(model.form_parameters() if kind in forms else ()))
        )
        found = EffectSet(tuple(kinds), parameters, models)
        for end in found.limits():
            found.configs(np.where(np.isfinite(end), end, 0.0))
        return found

    def __len__(self) -> int:
        return len(self.parameters)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """The effects at x (k,); raises `UserError` where a plugin's config refuses its own parameters."""
        values: list[dict[str, float]] = [{} for _ in self.kinds]
        for parameter, number in zip(self.parameters, x, strict=True):
            values[parameter.effect][parameter.declared.name] = parameter.value(float(number))
        return tuple(
            _config(model, kind, given)
            for model, kind, given in zip(self.models, self.kinds, values, strict=True)
        )

    def values(self, x: Array) -> dict[str, float]:
        """Parameter values by ``kind.name``."""
        return {
            parameter.name: parameter.value(float(n)) for parameter, n in zip(self.parameters, x, strict=True)
        }

    @property
    def forms(self) -> tuple[str, ...]:
        """Kinds with forms that may vary."""
        return tuple(dict.fromkeys(parameter.kind for parameter in self.parameters if parameter.is_form))

    def limits(self) -> tuple[Array, Array]:
        """(k,) lowest and highest x."""
        pairs = np.array([parameter.limits for parameter in self.parameters], float).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def starts(self, known: dict[str, float] | None = None) -> list[Array]:
        """Points (k,) from which fits begin; `known` fixes the start of some parameters by name."""
        known = known or {}
        options = [
            (known[parameter.name],) if parameter.name in known else parameter.starts()
            for parameter in self.parameters
        ]
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


@dataclass(frozen=True)
class StudyCandidate(EffectSet):
    """Effects to fit in the order of a study, the others of the study between them.

    Attributes:
        fixed: the study's effects in their order, then those that it does not have yet.
        slots: for each effect that is fitted its place among `fixed`.
    """

    fixed: tuple[EffectConfig, ...] = ()
    slots: tuple[int, ...] = ()

    @staticmethod
    def among(
        registry: Registry,
        effects: Sequence[EffectConfig],
        kinds: Sequence[str],
        forms: Collection[str] = (),
    ) -> StudyCandidate:
        """Fit these kinds: in place those that the effects have, behind them the others; `forms` as for `of`.

        Raises:
            UserError: an unknown kind, or one that the effects have twice.
        """
        all_kinds = [effect.kind for effect in effects]
        for kind in kinds:
            if all_kinds.count(kind) > 1:
                raise UserError(
                    f"The study has the effect '{kind}' {all_kinds.count(kind)} times, so it is not clear which one "
                    "to fit; keep one of them."
                )
        plain = EffectSet.of(registry, kinds, forms)
        begun = plain.configs(plain.starts()[0])
        fixed = (*effects, *(config for config in begun if config.kind not in all_kinds))
        places = [effect.kind for effect in fixed]
        slots = tuple(places.index(kind) for kind in kinds)
        return StudyCandidate(plain.kinds, plain.parameters, plain.models, fixed, slots)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """All effects of the study, those that are fitted at x (k,)."""
        return self.with_values(self.values(x))

    def with_values(self, values: Mapping[str, float]) -> tuple[EffectConfig, ...]:
        """All effects of the study, those that are fitted at these values by ``kind.parameter``."""
        effects = list(self.fixed)
        for parameter in self.parameters:
            slot = self.slots[parameter.effect]
            effects[slot] = effects[slot].model_copy(update={parameter.declared.name: values[parameter.name]})
        return tuple(effects)

    def present(self) -> Array:
        """(k,) x of the values that the effects have now."""
        return np.array(
            [k.x(float(getattr(self.fixed[self.slots[k.effect]], k.declared.name))) for k in self.parameters]
        )
