"""A correct model of a mass on a spring, and models that break one rule each."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.errors import UserError
from pliant.interfaces.effect import AT, EffectParameter
from pliant.interfaces.model import Channel, Drive, ModelConfig, SystemModel, SystemParts, SystemReadings
from pliant.records.design import Array
from pliant.registry.component import Component


class SpringConfig(ModelConfig):
    """The config of a spring with a stated stiffness; its effects are those of Python models."""

    kind: Literal["python"] = "python"
    stiffness: float = 4.0


class Spring(SystemModel):
    """x = F / k exp(−t / 1 s): a spring whose force fades."""

    config: SpringConfig

    @property
    def inputs(self) -> tuple[Channel, ...]:
        return (Channel("force_n", "N", "force", -3.0, 3.0),)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        return (Channel("way_m", "m", "way"),)

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        return {"parameter": ("stiffness",)}

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        return [*(kind for kind in kinds if kind not in ("parameter", "state")), "parameter@stiffness"]

    def adapted(self, kind: str, declared: EffectParameter) -> EffectParameter:
        if kind.partition(AT)[0] != "parameter":
            return declared
        return replace(declared, neutral=4.0, bounds=(0.1, 100.0), plausible=(2.0, 8.0))

    def stiffness(self, parts: SystemParts) -> float:
        """Return the stiffness, the changed one if there is a change."""
        for change in parts.changes:
            if change.name != "stiffness":
                raise UserError(f"no parameter '{change.name}'")
        return parts.changes[-1].value if parts.changes else self.config.stiffness

    def one(self, drive: Drive, stiffness: float) -> Array:
        """Return the way of one run."""
        time_s = drive.history.time_s
        assert time_s is not None
        return np.asarray(drive.history.actuation["force_n"] / stiffness * np.exp(-time_s))

    def simulate(self, parts: SystemParts, drives: Sequence[Drive]) -> tuple[SystemReadings, ...]:
        stiffness = self.stiffness(parts)
        return tuple({"way_m": self.one(drive, stiffness)} for drive in drives)

    def vary(
        self, parts: SystemParts, towards: Sequence[SystemParts], drives: Sequence[Drive]
    ) -> tuple[tuple[SystemReadings, ...], tuple[tuple[SystemReadings, ...], ...]]:
        base, k = self.simulate(parts, drives), self.stiffness(parts)
        changes = [-(self.stiffness(other) - k) / k for other in towards]
        return base, tuple(tuple({"way_m": c * run["way_m"]} for run in base) for c in changes)

    def fingerprint(self) -> Mapping[str, Any]:
        return {"stiffness": self.config.stiffness}


variants = Variants(
    Component("model", "python", f"{__name__}:SpringConfig", f"{__name__}:Spring", "a spring")
)
broken = variants.row_adder(Spring)
_state = {"calls": 0}


def _counted(up: Any, self: Any, parts: SystemParts, drives: Sequence[Drive]) -> Any:
    _state["calls"] += 1
    return tuple({"way_m": run["way_m"] * _state["calls"]} for run in up(parts, drives))


def _after(up: Any, self: Any, parts: SystemParts, drives: Sequence[Drive]) -> Any:
    """Start each run where the one before it ends."""
    found, last = [], 0.0
    for run in up(parts, drives):
        found.append({"way_m": run["way_m"] + last})
        last = float(found[-1]["way_m"][-1]) + 1.0
    return tuple(found)


def _own(self: Spring) -> tuple[Any, ...]:
    return type(self), (SpringConfig(stiffness=5.0),)


def _random(up: Any, self: Any) -> dict[str, str]:
    _state["calls"] += 1
    return {"it": hashlib.sha256(str(_state["calls"]).encode()).hexdigest()}


broken("declares_its_channels", outputs=property(lambda self: (Channel("way_m", "mm"),)))
broken("declares_its_channels", inputs=property(lambda self: ()))
broken("declares_its_channels", outputs=property(lambda self: (Channel("force_n", "N"),)))
broken("declares_its_places", attachments=property(lambda self: {"input": ("force_n",)}))
broken("declares_its_places", attachments=property(lambda self: {"joint": ("a", "a")}))
broken(
    "gives_every_output_at_every_sample",
    simulate=lambda up, self, *given: tuple({"way_m": run["way_m"][1:]} for run in up(*given)),
)
broken(
    "gives_every_output_at_every_sample",
    simulate=lambda up, self, *given: tuple(
        {"way_m": np.where(np.arange(len(run["way_m"])) == 5, np.nan, run["way_m"])} for run in up(*given)
    ),
)
broken(
    "inputs_drive_it",
    simulate=lambda up, self, *given: tuple({"way_m": 0.0 * run["way_m"]} for run in up(*given)),
)
broken("repeats_itself", simulate=_counted)
broken("runs_do_not_affect_each_other", simulate=_after)
broken("survives_pickling", __reduce__=lambda up, self: _own(self))
broken("fingerprint_identifies_the_files", fingerprint=_random)
broken("proposes_effects_that_it_can_have", default_kinds=lambda up, self, kinds: ["stifness"])
broken(
    "proposes_effects_that_it_can_have",
    adapted=lambda up, self, kind, declared: replace(declared, bounds=(1.0, -1.0)),
)
broken(
    "derivatives_are_slopes",
    vary=lambda up, self, parts, towards, drives: (
        (found := up(parts, towards, drives))[0],
        tuple(tuple({"way_m": 2 * run["way_m"]} for run in one) for one in found[1]),
    ),
)
broken("remarks_are_sentences", remarks=lambda up, self, drives: ("contacts chatter",))
