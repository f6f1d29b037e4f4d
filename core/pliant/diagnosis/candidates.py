"""Candidates: sets of effects whose parameters may be fitted, and the starts of their fits."""

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
# Weight of the prior in units of squared residuals: a parameter without influence on the data stays near its middle.
PRIOR_WEIGHT = 0.1
# Start of fits of a strength, as a share of the way from neutral to the far end of the plausible range.
START_SHARE = 0.3
MOST_STARTS = 3


def candidate_kinds(registry: Registry, kinds: Sequence[str] | None = None) -> list[str]:
    """Return the kinds of effects that a diagnosis may fit, each once; all with a number to fit if none are named.

    Raises:
        UserError: an unknown kind, or one without a number to fit.
    """
    if kinds is None:
        return [kind for kind in registry.kinds("effect") if _fitted(registry, kind)]
    for kind in kinds:
        if not _fitted(registry, kind):
            raise UserError(
                f"effect '{kind}' has no number that can be fitted alone, so that it is no candidate; "
                + ("'pliant improve --learned' learns one." if kind == "learned" else "name others.")
            )
    return list(dict.fromkeys(kinds))


def _fitted(registry: Registry, kind: str) -> bool:
    return bool(registry.fit_parameters(kind))


@dataclass(frozen=True)
class FitParameter:
    """One parameter of one effect of a candidate, scaled to a number x of order 1.

    x = (v − neutral) / reach for strengths and shapes with a normal prior, where reach is the distance from neutral to
    the far end of the plausible range; for forms it is that distance / 1.645, a standard deviation; with a log-normal
    prior x = ln(v / middle) / s.
    """

    effect: int
    kind: str
    declared: EffectParameter

    @property
    def name(self) -> str:
        return f"{self.kind}.{self.declared.name}"

    def value(self, x: float) -> float:
        """Return the parameter's value within its bounds."""
        p = self.declared
        v = p.neutral + x * self._reach if p.prior == "normal" else self._middle * math.exp(x * self._spread)
        return min(max(v, p.bounds[0]), p.bounds[1])

    def x(self, value: float) -> float:
        """Return the number x that gives this value."""
        if self.declared.prior == "normal":
            return (value - self.declared.neutral) / self._reach
        return math.log(value / self._middle) / self._spread

    def slope(self, x: float) -> float:
        """Return dv/dx: the derivative of the parameter's value by its scaled coordinate x."""
        return self._reach if self.declared.prior == "normal" else self.value(x) * self._spread

    @property
    def limits(self) -> tuple[float, float]:
        """Return the parameter's bounds as bounds of x."""
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
        """Return the weight of the prior in x², in units of squared residuals; weak except for forms.

        It only keeps parameters without influence in place. Forms are nuisances with a standard normal prior in x.
        """
        return 1.0 if self.is_form else PRIOR_WEIGHT

    @property
    def plausible(self) -> tuple[float, float]:
        """Return the plausible range in x."""
        low, high = self.declared.plausible
        return self.x(low), self.x(high)

    def starts(self) -> tuple[float, ...]:
        """Return the starts of fits: one strength, two shapes, the plain form."""
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
    """A set of effects, in the order in which they are applied; the empty set is the unchanged model.

    Parameters of the role `form` are among `parameters` if they may vary; otherwise they keep their neutral value.
    """

    kinds: tuple[str, ...]
    parameters: tuple[FitParameter, ...]
    models: tuple[type[EffectConfig], ...]

    @staticmethod
    def from_kinds(registry: Registry, kinds: Sequence[str], forms: Collection[str] = ()) -> EffectSet:
        """Return the effects of these kinds; those that are also among `forms` get free forms.

        Raises `UserError` for an unknown kind, and for one whose config refuses its own parameters or bounds.
        """
        components = [registry.get("effect", kind) for kind in kinds]
        models = tuple(cast(type[EffectConfig], component.config_model()) for component in components)
        parameters = tuple(
            FitParameter(index, kind, parameter)
            for index, kind in enumerate(kinds)
            for parameter in (
                *registry.fit_parameters(kind),
                *(registry.fit_parameters(kind, forms=True) if kind in forms else ()),
            )
        )
        found = EffectSet(tuple(kinds), parameters, models)
        for end in found.limits():
            found.configs(np.where(np.isfinite(end), end, 0.0))
        return found

    def __len__(self) -> int:
        return len(self.parameters)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """Return the effects at x (k,); raise `UserError` if a plugin's config refuses its own parameters."""
        values: list[dict[str, float]] = [{} for _ in self.kinds]
        for parameter, number in zip(self.parameters, x, strict=True):
            values[parameter.effect][parameter.declared.name] = parameter.value(float(number))
        return tuple(
            _config(model, kind, given)
            for model, kind, given in zip(self.models, self.kinds, values, strict=True)
        )

    def values(self, x: Array) -> dict[str, float]:
        """Return parameter values by ``kind.name``."""
        return {
            parameter.name: parameter.value(float(n)) for parameter, n in zip(self.parameters, x, strict=True)
        }

    @property
    def forms(self) -> tuple[str, ...]:
        """Return the kinds with forms that may vary."""
        return tuple(dict.fromkeys(parameter.kind for parameter in self.parameters if parameter.is_form))

    def limits(self) -> tuple[Array, Array]:
        """Return (k,) lowest and highest x."""
        pairs = np.array([parameter.limits for parameter in self.parameters], float).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def starts(self, known: dict[str, float] | None = None) -> list[Array]:
        """Return points (k,) at which fits begin; `known` fixes the start of some parameters by name."""
        known = known or {}
        options = [
            (known[parameter.name],) if parameter.name in known else parameter.starts()
            for parameter in self.parameters
        ]
        found = [np.array(point, float) for point in itertools.product(*options)]
        if len(found) <= MOST_STARTS:
            return found
        return [found[k] for k in np.linspace(0, len(found) - 1, MOST_STARTS).round().astype(int)]


def is_neutral(config: EffectConfig) -> bool:
    """Return whether every strength of an effect has its neutral value, at which it changes nothing."""
    strengths = [one for one in type(config).fit_parameters() if one.role == "strength"]
    return bool(strengths) and all(getattr(config, one.name) == one.neutral for one in strengths)


def _config(model: type[EffectConfig], kind: str, given: dict[str, float]) -> EffectConfig:
    try:
        return model.model_validate({"kind": kind, **given})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(map(str, first["loc"]))
        raise UserError(
            f"The parameters of effect '{kind}' and the fields of its config disagree ({field}: {first['msg']}); "
            f"'pliant check effect {kind}' lists the requirements."
        ) from None


@dataclass(frozen=True)
class StudyCandidate(EffectSet):
    """Effects to fit in the order of a study, with the study's other effects between them.

    Attributes:
        fixed: the study's effects in their order, then those that it does not have yet.
        slots: for each effect that is fitted its index in `fixed`.
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
        """Return the candidate that fits these kinds: existing ones in place, others appended; `forms` as for `of`.

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
        plain = EffectSet.from_kinds(registry, kinds, forms)
        begun = plain.configs(plain.starts()[0])
        fixed = (*effects, *(config for config in begun if config.kind not in all_kinds))
        places = [effect.kind for effect in fixed]
        slots = tuple(places.index(kind) for kind in kinds)
        return StudyCandidate(plain.kinds, plain.parameters, plain.models, fixed, slots)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """Return all effects of the study, with the fitted ones at x (k,)."""
        return self.with_values(self.values(x))

    def with_values(self, values: Mapping[str, float]) -> tuple[EffectConfig, ...]:
        """Return all effects of the study, with the fitted ones at these values by ``kind.parameter``."""
        effects = list(self.fixed)
        for parameter in self.parameters:
            slot = self.slots[parameter.effect]
            effects[slot] = effects[slot].model_copy(update={parameter.declared.name: values[parameter.name]})
        return tuple(effects)

    def present(self) -> Array:
        """Return (k,) x of the present values of the effects."""
        return np.array(
            [k.x(float(getattr(self.fixed[self.slots[k.effect]], k.declared.name))) for k in self.parameters]
        )
