"""Hidden truths: one effect, two, none, or an effect that no plugin has, with random parameters.

A truth is drawn once (`draw`) and then taken at a strength for each effect (`HiddenTruth.at`), which `sets.py` scales
until the outputs change by the wanted share of the noise; two effects ("a+b") are scaled one by one. Sets for
calibrating thresholds and sets that are judged draw from other forms and ranges (`split`), so that no threshold has
seen the forms it is judged on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from benchmarks.evidence.forms import Forms
from benchmarks.evidence.robots import Robot

Split = Literal["calibration", "judged"]
Engine = Literal["functional", "mujoco"]
Right = tuple[str, ...]

CLEAN = "none"
# Between the names of two hidden effects.
PLUS = "+"
KINDS = (
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
# Two of these are hidden together: any two, each found on one joint by itself.
PAIRED = KINDS
# What no plugin has, and the verdicts that count as right. Repeats disagree in those that also allow `not_repeatable`.
UNKNOWN: Mapping[str, Right] = {
    "gain_bump": ("unknown_effect",),
    "bimodulus": ("unknown_effect",),
    "torque_ripple": ("unknown_effect",),
    "run_slip": ("not_repeatable", "unknown_effect"),
    "cycle_ageing": ("unknown_effect", "not_repeatable"),
    "filling_hysteresis": ("unknown_effect",),
    "warm_stick": ("unknown_effect",),
    "backlash": ("unknown_effect",),
}


@dataclass(frozen=True)
class Body:
    """What only an engine with bodies knows: a fitting on every piece, MuJoCo's own damping and friction."""

    fitting_kg: float = 0.0
    fitting_share: float = 0.9
    fitting_side_m: float = 0.0
    joint_damping: float = 0.0
    joint_friction: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """What the angle sensor does: scale and bias; `play_rad` is lost motion before it, `slip_rad` per run."""

    bias_rad: float = 0.0
    scale: float = 0.0
    play_rad: float = 0.0
    slip_rad: float = 0.0


@dataclass(frozen=True)
class Truth:
    """A truth at a strength."""

    forms: Forms = field(default_factory=Forms)
    body: Body = Body()
    sensor: Sensor = Sensor()


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


def right_verdicts(kind: str) -> Right:
    """Verdicts that count as right; `missing_effect` also needs the kinds selected."""
    if kind == CLEAN:
        return ("nothing_missing",)
    return UNKNOWN.get(kind, ("missing_effect",))


def draw(kind: str, engine: Engine, robot: Robot, split: Split, rng: np.random.Generator) -> HiddenTruth:
    """A truth of this kind with random parameters and a random error of the model's law.

    Raises:
        ValueError: a kind that this test bed has not.
    """
    error = {
        "actuation_error": 0.004 * float(rng.choice([-1.0, 1.0])) * rng.uniform(0.6, 1.2),
        "actuation_phase": rng.uniform(0, 2 * np.pi),
        "elastic_error": 0.003 * float(rng.choice([-1.0, 1.0])) * rng.uniform(0.6, 1.2),
        "elastic_phase": rng.uniform(0, 2 * np.pi),
    }
    parts, drawn = [], dict(error)
    for name in kind.split(PLUS):
        if name not in _EFFECTS:
            raise ValueError(f"no truth of kind '{name}'")
        dice = _Dice(rng, split, engine, robot)
        parts.append(Part(name, *_EFFECTS[name](dice)))
        drawn |= {f"{name}.{key}": value for key, value in dice.drawn.items()}
    return HiddenTruth(tuple(parts), error, drawn)


def _assembled(error: Mapping[str, float], changes: Mapping[str, float]) -> Truth:
    """Fields by the record that has them."""

    def of(record: Any) -> dict[str, float]:
        names = getattr(record, "_fields", None) or record.__dataclass_fields__
        return {name: value for name, value in changes.items() if name in names}

    return Truth(Forms(**{**error, **of(Forms)}), Body(**of(Body)), Sensor(**of(Sensor)))


class _Dice:
    """Random parameters that are remembered for the label."""

    def __init__(self, rng: np.random.Generator, split: Split, engine: Engine, robot: Robot) -> None:
        self.rng, self.split, self.engine, self.robot = rng, split, engine, robot
        self.drawn: dict[str, float] = {}

    def uniform(self, name: str, judged: tuple[float, float], calibration: tuple[float, float]) -> float:
        """A number in the split's range."""
        low, high = judged if self.split == "judged" else calibration
        return self._note(name, float(self.rng.uniform(low, high)))

    def sign(self) -> float:
        return self._note("sign", float(self.rng.choice([-1.0, 1.0])))

    def _note(self, name: str, value: float) -> float:
        self.drawn[name] = value
        return value


def _stiffness(d: _Dice) -> tuple[Change, float]:
    sign, share = d.sign(), d.uniform("quadratic", (0.6, 0.85), (1.15, 1.4))
    return lambda s: {"stiffness": 0.12 * sign * s, "stiffness_quadratic": share}, 4.0


def _actuation_gain(d: _Dice) -> tuple[Change, float]:
    sign, fading = d.sign(), d.uniform("fading", (0.05, 0.15), (-0.15, -0.05))
    return lambda s: {"gain": 0.07 * sign * s, "gain_fading": fading}, 5.0


def _pressure_offset(d: _Dice) -> tuple[Change, float]:
    sign, fading = d.sign(), d.uniform("fading", (0.05, 0.15), (-0.15, -0.05))
    return lambda s: {"offset_pa": 400 * sign * s, "offset_fading": fading}, 6.0


def _dead_zone(d: _Dice) -> tuple[Change, float]:
    width = d.uniform("width", (0.1, 0.2), (0.2, 0.3))
    return lambda s: {"dead_pa": 600 * s, "dead_width": width}, 8.0


def _supply_lag(d: _Dice) -> tuple[Change, float]:
    vent, second = d.uniform("vent", (1.2, 1.6), (1.0, 1.3)), d.uniform("second", (0.15, 0.35), (0.3, 0.5))
    return lambda s: {"lag_s": 0.5 * s, "lag_vent": vent, "lag_second": second}, 8.0


def _viscous(d: _Dice) -> tuple[Change, float]:
    if d.engine == "mujoco":
        return lambda s: {"joint_damping": 0.01 * s}, 20.0
    power = d.uniform("power", (0.75, 0.9), (0.85, 1.0))
    return lambda s: {"viscous": 0.01 * s, "viscous_power": power}, 20.0


def _viscoelastic(d: _Dice) -> tuple[Change, float]:
    time = d.uniform("time_s", (3.0, 10.0), (2.0, 14.0))
    spread = d.uniform("spread", (2.6, 3.6), (1.8, 2.8))
    tilt = d.uniform("tilt", (0.7, 1.0), (0.9, 1.3))

    def change(s: float) -> dict[str, float]:
        branches = {f"branch_{k + 1}": 0.004 * s * tilt**k for k in range(3)}
        return branches | {f"time_{k + 1}_s": time * spread ** (k - 1) for k in range(3)}

    return change, 8.0


def _friction(d: _Dice) -> tuple[Change, float]:
    if d.engine == "mujoco" and d.robot.modules == 1:  # light joints creep through MuJoCo's soft friction
        return lambda s: {"joint_friction": 1e-3 * s}, 6.0
    width = d.uniform("width", (0.015, 0.04), (0.02, 0.05))
    stops = float(d.split == "calibration")
    return lambda s: {"friction": 1e-3 * s, "friction_width": width, "friction_stops": stops}, 6.0


def _mullins(d: _Dice) -> tuple[Change, float]:
    scale = d.uniform("scale", (0.04, 0.12), (0.1, 0.25))
    return lambda s: {"mullins": min(0.2 * s, 0.85), "mullins_scale": scale}, 4.25


def _permanent_set(d: _Dice) -> tuple[Change, float]:
    power = d.uniform("power", (1.5, 2.0), (1.2, 1.6))
    return lambda s: {"set_share": 0.1 * s, "set_power": power}, 6.0


def _self_contact(d: _Dice) -> tuple[Change, float]:
    at = d.uniform("at", (0.17, 0.26), (0.2, 0.3))
    width = d.uniform("width", (0.02, 0.05), (0.02, 0.05))
    quadratic = float(d.split == "calibration")
    return (
        lambda s: {
            "contact": 0.04 * s,
            "contact_at": at,
            "contact_width": width,
            "contact_quadratic": quadratic,
        },
        40.0,
    )


def _thermal(d: _Dice) -> tuple[Change, float]:
    curvature = d.uniform("curvature", (0.003, 0.01), (-0.008, 0.0))
    return lambda s: {"thermal": 0.01 * s, "thermal_curvature": curvature}, 2.5


def _gravity(d: _Dice) -> tuple[Change, float]:
    share = d.uniform("arm", (0.7, 1.0), (0.3, 0.6))
    side = d.robot.length_m * d.uniform("side", (0.0, 0.02), (-0.02, 0.0))
    fitting = 0.25 * d.robot.mass_kg
    return lambda s: {"fitting_kg": fitting * s, "fitting_share": share, "fitting_side_m": side}, 6.0


def _bias(d: _Dice) -> tuple[Change, float]:
    sign, scale = d.sign(), d.uniform("scale", (-0.004, 0.004), (-0.006, 0.006))
    return lambda s: {"bias_rad": 0.015 * d.robot.modules * sign * s, "scale": scale * min(s, 1.0)}, 10.0


def _gain_bump(d: _Dice) -> tuple[Change, float]:
    at, width = d.uniform("at", (0.35, 0.65), (0.3, 0.7)), d.uniform("width", (0.1, 0.15), (0.12, 0.18))
    return lambda s: {"bump": 0.15 * s, "bump_at": at, "bump_width": width}, 5.0


def _bimodulus(d: _Dice) -> tuple[Change, float]:
    sign = d.sign()
    return lambda s: {"bimodulus": 0.3 * sign * s}, 3.0


def _torque_ripple(d: _Dice) -> tuple[Change, float]:
    period, phase = d.uniform("period_s", (27, 47), (20, 60)), d.uniform("phase", (0, 6.28), (0, 6.28))
    return lambda s: {"ripple": 1e-3 * s, "ripple_period_s": period, "ripple_phase": phase}, 10.0


def _run_slip(d: _Dice) -> tuple[Change, float]:
    return lambda s: {"slip_rad": 0.015 * d.robot.modules * s}, 20.0


def _cycle_ageing(d: _Dice) -> tuple[Change, float]:
    return lambda s: {"ageing": 0.004 * s}, 6.0


def _filling(d: _Dice) -> tuple[Change, float]:
    sign = d.sign()
    return lambda s: {"filling": 0.1 * sign * s}, 6.0


def _warm_stick(d: _Dice) -> tuple[Change, float]:
    return lambda s: {"warm_stick": 1e-4 * s, "friction_width": 0.03}, 18.0


def _backlash(d: _Dice) -> tuple[Change, float]:
    return lambda s: {"play_rad": 0.02 * d.robot.modules * s}, 8.0


def _nothing(d: _Dice) -> tuple[Change, float]:
    return lambda s: {}, 0.0


_EFFECTS: Mapping[str, Callable[[_Dice], tuple[Change, float]]] = {
    CLEAN: _nothing,
    "stiffness": _stiffness,
    "actuation_gain": _actuation_gain,
    "pressure_offset": _pressure_offset,
    "dead_zone": _dead_zone,
    "supply_lag": _supply_lag,
    "viscous_damping": _viscous,
    "viscoelastic": _viscoelastic,
    "friction_hysteresis": _friction,
    "mullins": _mullins,
    "permanent_set": _permanent_set,
    "self_contact": _self_contact,
    "thermal_softening": _thermal,
    "gravity_scale": _gravity,
    "sensor_bias": _bias,
    "gain_bump": _gain_bump,
    "bimodulus": _bimodulus,
    "torque_ripple": _torque_ripple,
    "run_slip": _run_slip,
    "cycle_ageing": _cycle_ageing,
    "filling_hysteresis": _filling,
    "warm_stick": _warm_stick,
    "backlash": _backlash,
}
