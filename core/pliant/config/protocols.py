"""The `protocols` block: runs that the bench can do, from which the next one is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from pydantic import Field, field_validator, model_validator

from pliant.config.chain import Count
from pliant.config.measurements import Name
from pliant.errors import closest
from pliant.interfaces.base import FrozenModel
from pliant.units import Angle, Moment, Time, UnitError, parse_quantity, strip_unit_suffix

_CYCLES = ("period_s", "cycles", "amplitudes")
# Runs of the default menu, and the keys that each allows.
OPTIONS: Mapping[str, tuple[str, ...]] = {
    "slow_cycles": _CYCLES,
    "fast_cycles": _CYCLES,
    "each_input": ("period_s",),
    "paid_out": ("period_s",),
    "small_loops": ("period_s",),
    "holds": ("levels", "hold_s"),
    "virgin": _CYCLES,
    "level": _CYCLES,
    "upside_down": _CYCLES,
    "sideways": _CYCLES,
    "warm": (*_CYCLES, "temperature_c"),
    "passive_load_steps": ("load_n_m", "hold_s"),
    "load_steps": ("load_n_m", "hold_s", "levels"),
    "payload_steps": ("period_s",),
    "blocked": ("levels", "hold_s"),
    "vented_zero": ("hold_s",),
    "closed_valve": ("levels", "hold_s"),
    "step_response": ("levels", "hold_s"),
    "second_sensor": _CYCLES,
    "custom": ("times_s", "inputs", "moments_n_m", "pitch_rad", "roll_rad", "temperature_c", "new_specimen"),
}
_ALWAYS = ("run", "name", "words", "minutes")
# Units of inputs that can drive a chain.
DRIVES = ("Pa", "N", "m")
# A larger number is not a share of the largest drive but a pressure without its unit.
LARGEST_SHARE = 3.0
Level = float | str


class ProtocolConfig(FrozenModel):
    """One run: its name in the default menu with the differences on this bench, or `custom`.

    Levels and amplitudes are texts with a unit (`5 kPa`), or plain numbers: shares of the largest that was driven.
    """

    run: str = Field(description="a run of the default menu, or `custom`")
    name: Name | None = Field(None, description="another name; needed where a run is listed twice")
    words: Name | None = Field(None, description="the order to the bench, instead of the menu's")
    minutes: float | None = Field(
        None, gt=0, le=10_000, description="of motion and set-up together, instead of the menu's"
    )
    period_s: Time | None = Field(None, gt=0, le=86_400, description="of one cycle")
    cycles: Count | None = Field(None, ge=1, le=1000, description="how many")
    amplitudes: tuple[Level, ...] = Field((), max_length=1000, description="of each cycle")
    levels: tuple[Level, ...] = Field((), max_length=1000, description="of each hold or step")
    hold_s: Time | None = Field(None, gt=0, le=86_400, description="how long a level is held")
    load_n_m: Moment | None = Field(None, gt=0, description="largest end moment of load steps")
    times_s: tuple[Time, ...] = Field(
        (), max_length=10_000, description="custom: corners of the drive, from 0"
    )
    inputs: dict[Name, tuple[Level, ...]] = Field(
        default_factory=dict,
        description="custom: each input at these times, e.g. {pressure_pa: [0, 5 kPa, 0]}",
    )
    moments_n_m: tuple[Moment, ...] = Field((), description="custom: end moment at these times")
    pitch_rad: Angle = Field(0.0, description="custom: base turned about world y")
    roll_rad: Angle = Field(0.0, description="custom: base turned about world x")
    temperature_c: float | None = Field(None, ge=-100, le=300, description="in °C")
    new_specimen: bool = Field(False, description="custom: a body never loaded before")

    @field_validator("run")
    @classmethod
    def _known(cls, run: str) -> str:
        if run not in OPTIONS:
            raise ValueError(
                f"there is no run '{run}'{closest(run, list(OPTIONS))} Runs: {', '.join(OPTIONS)}"
            )
        return run

    @field_validator("amplitudes", "levels")
    @classmethod
    def _levels(cls, levels: tuple[Level, ...]) -> tuple[Level, ...]:
        for level in levels:
            _check(level)
            if not isinstance(level, str) and abs(level) > LARGEST_SHARE:
                raise ValueError(
                    f"{level:g} would be a share of the largest drive; write a unit, such as '{level:g} Pa', or a "
                    "share such as 0.5"
                )
        return levels

    @model_validator(mode="after")
    def _fitting(self) -> ProtocolConfig:
        said = {key for key in self.model_fields_set if key not in _ALWAYS}
        allowed = OPTIONS.get(self.run, ())
        for key in sorted(said - set(allowed)):
            names = ", ".join(strip_unit_suffix(name) for name in (*allowed, "minutes", "words"))
            raise ValueError(f"run '{self.run}' takes no '{strip_unit_suffix(key)}'; it takes {names}")
        if self.run == "custom":
            if not self.name:
                raise ValueError("a custom run needs a 'name'")
            if len(self.times_s) < 2 or self.times_s[0] != 0.0:
                raise ValueError("a custom run needs 'times' from 0 on, such as [0 s, 10 s, 20 s]")
            if any(late <= early for early, late in pairwise(self.times_s)):
                raise ValueError("'times' must increase")
            if not self.inputs:
                raise ValueError("a custom run needs 'inputs', such as {pressure_pa: [0, 5 kPa, 0]}")
            for name, values in (*self.inputs.items(), ("moments", self.moments_n_m)):
                if len(values) != len(self.times_s) and (values or name != "moments"):
                    raise ValueError(
                        f"'{name}' has {len(values)} value{'s' * (len(values) != 1)} for {len(self.times_s)} times"
                    )
            for level in (level for levels in self.inputs.values() for level in levels):
                _check(level)
        if self.amplitudes and self.cycles is not None and len(self.amplitudes) != self.cycles:
            raise ValueError(
                f"{len(self.amplitudes)} amplitudes for {self.cycles} cycles; give one of the two"
            )
        return self


def _check(level: Level) -> None:
    """Check that a text is a pressure, a force or a travel."""
    if not isinstance(level, str):
        return
    problems = []
    for unit in DRIVES:
        try:
            parse_quantity(level, unit)
            return
        except UnitError as error:
            problems.append(str(error))
    raise ValueError(problems[0])
