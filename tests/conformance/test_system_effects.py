"""The suite of effects of users' own models: shipped ones pass, each broken one fails by the check that it breaks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import SystemParts, effect_kind
from pliant.records.design import Array
from pliant.registry.component import Component
from pliant.testing import BoundCheck, CheckFailure, Subject, checks_of, parametrize_with_checks
from pliant.units import Ratio
from pliant_systems import manifest
from pliant_systems.signals import InputEffect

SHIPPED = list(manifest.pliant_components())


@parametrize_with_checks(SHIPPED)
def test_shipped(check: BoundCheck) -> None:
    check()


class CubedConfig(EffectConfig):
    """The config of an input that is cubed by a share."""

    kind: str = effect_kind("cubed")
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.9), plausible=(0.0, 0.5), example=0.1)
    """share of the cube"""


class Cubed(InputEffect):
    """u' = (1 − s) u + s u³."""

    config: CubedConfig

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return (1.0 - self.config.share) * values + self.config.share * values**3


GOOD = Component(
    "effect", "cubed", f"{__name__}:CubedConfig", f"{__name__}:Cubed", "inputs are cubed", models=("python",)
)


def test_a_good_effect_passes() -> None:
    for check in checks_of(GOOD):
        check.run(Subject(GOOD))


class NoStrengthConfig(EffectConfig):
    """A config with a shape only."""

    kind: str = effect_kind("cubed")
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.9), plausible=(0.0, 0.5), role="shape")


class WideConfig(CubedConfig):
    """A config without its bounds."""

    @classmethod
    def model_validate(cls, obj: Any, **more: Any) -> Any:
        return cls.model_construct(**obj)


class NamedOnceConfig(CubedConfig):
    """A config that takes no places."""

    kind: str = "other"


def shifted(self: Cubed, values: Array, time_s: Array, scale: float) -> Array:
    return values + 0.1


def unchanged(self: Cubed, values: Array, time_s: Array, scale: float) -> Array:
    return values


def in_place(self: Cubed, values: Array, time_s: Array, scale: float) -> Array:
    values *= 1.0 - self.config.share
    return values


def reads_too(self: Cubed, parts: SystemParts) -> SystemParts:
    marked = parts.with_output(
        lambda readings: {**readings, "probe_x_m": 2 * np.asarray(readings["probe_x_m"])}
    )
    return InputEffect.act(self, marked)


def replaced(self: Cubed, parts: SystemParts) -> SystemParts:
    return InputEffect.act(self, parts.with_(inputs=()))


def everywhere(self: Cubed, names: Any) -> tuple[str, ...]:
    return tuple(names)


def with_chains(self: Cubed, model: Any) -> Any:
    return self.act(model) if isinstance(model, SystemParts) else model


def grown(self: Cubed, parts: SystemParts) -> SystemParts:
    object.__setattr__(parts, "changes", (*parts.changes, "mine"))
    return InputEffect.act(self, parts.with_(changes=()))


CASES: list[tuple[str, dict[str, Any]]] = [
    ("declares_place_and_parameters", {"place": "nowhere"}),
    ("neutral_values_change_nothing", {"transform": shifted}),
    ("plausible_values_change_something", {"transform": unchanged}),
    ("acts_only_at_its_place", {"act": reads_too}),
    ("leaves_the_parts_alone", {"act": grown}),
    ("keeps_earlier_effects", {"act": replaced}),
    ("input_maps_keep_the_run", {"transform": in_place}),
    ("refuses_a_place_that_the_model_lacks", {"chosen": everywhere}),
    ("refuses_a_chain", {"apply": with_chains}),
    ("notes_are_plain", {"notes": EffectNotes(confounder="stiffness")}),
]


def _fails(component: Component, name: str) -> None:
    check = {c.name: c for c in checks_of(component)}[name]
    with pytest.raises(CheckFailure, match=f"fails '{name}'"):
        check.run(Subject(component))


@pytest.mark.parametrize(("name", "members"), CASES, ids=[name for name, _ in CASES])
def test_a_broken_effect_fails(name: str, members: dict[str, Callable[..., Any]]) -> None:
    cls = type("Broken", (Cubed,), {**members, "__module__": __name__, "__doc__": "A broken one."})
    globals()[f"Broken_{name}"] = cls
    _fails(Component(**{**vars(GOOD), "implementation": f"{__name__}:Broken_{name}"}), name)


@pytest.mark.parametrize(
    ("name", "config"),
    [
        ("declares_place_and_parameters", "NoStrengthConfig"),
        ("config_keeps_the_bounds", "WideConfig"),
        ("config_names_its_kind", "NamedOnceConfig"),
    ],
)
def test_a_broken_config_fails(name: str, config: str) -> None:
    _fails(Component(**{**vars(GOOD), "config": f"{__name__}:{config}"}), name)


def test_every_check_has_its_broken_effect() -> None:
    own = {c.name for c in checks_of(GOOD) if c.function.__module__ == "pliant.testing.system_effect"}
    assert {name for name, _ in CASES} | {"config_keeps_the_bounds"} == own
