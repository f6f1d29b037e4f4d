"""Hidden truths: one effect, two, none, or an effect that no plugin has, with random parameters.

A truth is drawn once (`strengths.draw`) and then taken at a strength for each effect (`HiddenTruth.at`), which
`sets.py` scales until the outputs change by the wanted share of the noise; two effects ("a+b") are scaled one by one.
Sets for calibrating thresholds and sets that are judged draw from other forms and ranges (`split`), so that no
threshold has seen the forms it is judged on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from benchmarks.evidence.forms import Forms
from benchmarks.evidence.sensors import Sensor
from benchmarks.evidence.skeleton import Body

Split = Literal["calibration", "judged"]
Engine = Literal["functional", "mujoco", "explicit"]
Right = tuple[str, ...]

CLEAN = "none"
# Between the names of two hidden effects.
PLUS = "+"
FOURTEEN = (
    "stiffness",
    "actuation_gain",
    "pressure_offset",
    "dead_zone",
    "supply_lag",
    "viscous_damping",
    "viscoelastic",
    "friction_hysteresis",
    "mullins",
    "permanent_set",
    "self_contact",
    "thermal_softening",
    "gravity_scale",
    "sensor_bias",
)
ELEVEN = (
    "wall_thickness",
    "leak",
    "tendon_friction",
    "backlash",
    "base_misalignment",
    "inter_module_compliance",
    "cross_axis",
    "sensor_scale",
    "sensor_lag",
    "inertia",
    "bimodulus",
)
KINDS = (*FOURTEEN, *ELEVEN)
# Two of these are hidden together: any two, each found on one joint by itself.
PAIRED = FOURTEEN
# What no plugin has, and the verdicts that count as right. Repeats disagree in those that also allow `not_repeatable`.
UNKNOWN: Mapping[str, Right] = {
    "gain_bump": ("unknown_effect",),
    "torque_ripple": ("unknown_effect",),
    "run_slip": ("not_repeatable", "unknown_effect"),
    "cycle_ageing": ("unknown_effect", "not_repeatable"),
    "filling_hysteresis": ("unknown_effect",),
    "warm_stick": ("unknown_effect",),
    "sensor_wave": ("unknown_effect",),
    "session_drift": ("unknown_effect", "not_repeatable"),
    "wall_buckling": ("unknown_effect",),
}
# Where a kind makes sense: most sets are made of the first robot, some of the second.
ROBOTS_OF: Mapping[str, tuple[str, str]] = {
    "tendon_friction": ("finger", "finger"),
    "base_misalignment": ("four", "four"),
    "inter_module_compliance": ("four", "four"),
    "cross_axis": ("four", "four"),
    "inertia": ("joint", "joint"),
    "backlash": ("joint", "finger"),
    "friction_hysteresis": ("joint", "finger"),
    "actuation_gain": ("joint", "finger"),
    "stiffness": ("joint", "four"),
    "sensor_bias": ("joint", "four"),
    "gravity_scale": ("joint", "four"),
}
USUAL_ROBOTS = ("joint", "chain")


@dataclass(frozen=True)
class Truth:
    """A truth at a strength."""

    forms: Forms = field(default_factory=Forms)
    body: Body = field(default_factory=Body)
    sensor: Sensor = field(default_factory=Sensor)


Change = Callable[[float], dict[str, float]]


@dataclass(frozen=True)
class Part:
    """One hidden effect without its strength.

    Attributes:
        kind: one of `KINDS`, `UNKNOWN` or `CLEAN`.
        change: fields of `Forms`, `Body` and `Sensor` at a strength; 1 is about 2 σ under a rich protocol, 0 is none.
        largest: the strength beyond which the form makes no sense.
    """

    kind: str
    change: Change
    largest: float


@dataclass(frozen=True)
class HiddenTruth:
    """A truth without its strengths.

    Attributes:
        parts: the hidden effects, in the order of the kind's name.
        error: fields of the model's law that are off.
        drawn: the random numbers, for the sealed label.
    """

    parts: tuple[Part, ...]
    error: Mapping[str, float]
    drawn: Mapping[str, float] = field(default_factory=dict)

    def at(self, *strengths: float) -> Truth:
        """The truth with each part at its strength; parts without one are absent."""
        changes: dict[str, float] = {}
        for part, strength in zip(self.parts, strengths, strict=False):
            changes.update(part.change(strength))
        return _assembled(self.error, changes)

    def alone(self, index: int) -> HiddenTruth:
        """The same truth with one of its parts only."""
        return replace(self, parts=(self.parts[index],))


def hidden_kinds(kind: str) -> tuple[str, ...]:
    """The effects that a set of this kind hides: none, one, or two of "a+b"."""
    return () if kind == CLEAN else tuple(sorted(kind.split(PLUS)))


def robots_of(kind: str) -> tuple[str, str]:
    """The usual robot of a kind, and the other one."""
    return ROBOTS_OF.get(kind, USUAL_ROBOTS)


def right_verdicts(kind: str) -> Right:
    """Verdicts that count as right; `missing_effect` also needs the kinds selected."""
    if kind == CLEAN:
        return ("nothing_missing",)
    return UNKNOWN.get(kind, ("missing_effect",))


def _assembled(error: Mapping[str, float], changes: Mapping[str, float]) -> Truth:
    """Fields by the record that has them; no two records have one of the same name."""

    def of(record: Any) -> dict[str, float]:
        names = getattr(record, "_fields", None) or record.__dataclass_fields__
        return {name: value for name, value in changes.items() if name in names}

    return Truth(Forms(**{**error, **of(Forms)}), Body(**of(Body)), Sensor(**of(Sensor)))
