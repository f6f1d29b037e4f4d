"""Hidden truths: one effect, two, none, or an effect that no plugin has, with random parameters.

A truth is drawn once (`draw`) and then taken at a strength for each effect (`HiddenTruth.at`), which `sets.py` scales
until the outputs change by the wanted share of the noise; two effects ("a+b") are scaled one by one. Sets for
calibrating thresholds and sets that are judged draw from other ranges, and where a form has a switch, other forms
(`split`), so that no threshold has seen the forms it is judged on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from benchmarks.evidence.forms import Forms
from benchmarks.evidence.robots import Robot
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


@dataclass(frozen=True)
class Part:
    """One hidden effect without its strength.

    Attributes:
        kind: one of `KINDS`, `UNKNOWN` or `CLEAN`.
        change: fields of `Forms`, `Body` and `Sensor` at a strength; 1 is about 2 σ under a rich protocol, 0 is none.
        largest: the strength beyond which the form makes no sense.
        drawn: its random numbers, by name.
    """

    kind: str
    change: Callable[[float], dict[str, float]]
    largest: float
    drawn: Mapping[str, float]


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

        def of(names: Any) -> dict[str, float]:
            """Fields by the record that has them; no two records have one of the same name."""
            return {name: value for name, value in changes.items() if name in names}

        forms = Forms(**{**self.error, **of(Forms._fields)})
        return Truth(forms, Body(**of(Body.__dataclass_fields__)), Sensor(**of(Sensor.__dataclass_fields__)))

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
    return ("nothing_missing",) if kind == CLEAN else UNKNOWN.get(kind, ("missing_effect",))


def _viscoelastic(s: float, v: Any) -> dict[str, float]:
    branches = {f"branch_{k + 1}": 0.004 * s * v.tilt**k for k in range(3)}
    return branches | {f"time_{k + 1}_s": v.time_s * v.spread ** (k - 1) for k in range(3)}


def _self_contact(s: float, v: Any) -> dict[str, float]:
    shape = {"contact_at": v.at, "contact_width": v.width, "contact_quadratic": v.calibration}
    return {"contact": 0.04 * s, **shape}


def _gravity(s: float, v: Any) -> dict[str, float]:
    place = {"fitting_share": v.arm, "fitting_side_m": v.robot.length_m * v.side}
    return {"fitting_kg": 0.25 * v.robot.mass_kg * s, **place}


def _supply_lag(s: float, v: Any) -> dict[str, float]:
    return {"lag_s": 0.5 * s, "lag_vent": v.vent, "lag_second": v.second, "lag_linear": v.linear}


def _wall_thickness(s: float, v: Any) -> dict[str, float]:
    powers = {"wall_linear": v.linear, "wall_quadratic": v.quadratic, "wall_gain": v.gain}
    return {"wall": 1.0 + 0.06 * v.sign * s, **powers}


def _base_misalignment(s: float, v: Any) -> dict[str, float]:
    across = {"tilt_x_rad": 0.05 * s * np.cos(v.way), "tilt_y_rad": 0.05 * s * np.sin(v.way)}
    return {**across, "tilt_z_rad": 0.05 * s * v.third}


def _backlash(s: float, v: Any) -> dict[str, float]:
    share = v.robot.modules if "angle_rad" in v.robot.outputs else 1
    return {"play_rad": 0.03 * share * s, "play_knee": v.knee}


def _sensor_wave(s: float, v: Any) -> dict[str, float]:
    n = v.robot.modules
    return {"wave_rad": 0.025 * n * s, "wave_period_rad": v.period_rad * n, "wave_phase": v.phase}


def _bimodulus(s: float, v: Any) -> dict[str, float]:
    shape = {"bimodulus_width": v.width, "bimodulus_quadratic": v.quadratic}
    return {"bimodulus": 0.15 * v.sign * s, **shape}


def _friction(s: float, v: Any) -> dict[str, float]:
    return {"friction": 1e-3 * s, "friction_width": v.width, "friction_stops": v.calibration}


def _sensor_bias(s: float, v: Any) -> dict[str, float]:
    return {"bias_rad": 0.015 * v.robot.modules * v.sign * s, "scale": v.scale * min(s, 1.0)}


def _tendon_friction(s: float, v: Any) -> dict[str, float]:
    return {"tendon": 0.15 * s, "tendon_rest_rad": v.rest_rad, "tendon_width": v.width}


def _torque_ripple(s: float, v: Any) -> dict[str, float]:
    return {"ripple": 1e-3 * s, "ripple_period_s": v.period_s, "ripple_phase": v.phase}


# The largest strength of each kind, and its fields at a strength s with the numbers v that were drawn for it.
CHANGES: Mapping[str, tuple[float, Callable[[float, Any], dict[str, float]]]] = {
    CLEAN: (0.0, lambda s, v: {}),
    "stiffness": (4.0, lambda s, v: {"stiffness": 0.12 * v.sign * s, "stiffness_quadratic": v.quadratic}),
    "actuation_gain": (5.0, lambda s, v: {"gain": 0.07 * v.sign * s, "gain_fading": v.fading}),
    "pressure_offset": (6.0, lambda s, v: {"offset_pa": 400 * v.sign * s, "offset_fading": v.fading}),
    "dead_zone": (8.0, lambda s, v: {"dead_pa": 600 * s, "dead_width": v.width}),
    "supply_lag": (8.0, _supply_lag),
    "viscous_damping": (20.0, lambda s, v: {"viscous": 0.01 * s, "viscous_power": v.power}),
    "viscoelastic": (8.0, _viscoelastic),
    "friction_hysteresis": (6.0, _friction),
    "mullins": (4.25, lambda s, v: {"mullins": min(0.2 * s, 0.85), "mullins_scale": v.scale}),
    "permanent_set": (6.0, lambda s, v: {"set_share": 0.1 * s, "set_power": v.power}),
    "self_contact": (40.0, _self_contact),
    "thermal_softening": (2.5, lambda s, v: {"thermal": 0.01 * s, "thermal_curvature": v.curvature}),
    "gravity_scale": (6.0, _gravity),
    "sensor_bias": (10.0, _sensor_bias),
    "wall_thickness": (6.0, _wall_thickness),
    "leak": (10.0, lambda s, v: {"leak_1_s": 0.03 * s, "leak_power": v.power, "leak_filling_s": v.filling_s}),
    "tendon_friction": (8.0, _tendon_friction),
    "backlash": (10.0, _backlash),
    "base_misalignment": (6.0, _base_misalignment),
    "inter_module_compliance": (10.0, lambda s, v: {"interface": 0.15 * s, "interface_cubic": v.cubic}),
    "cross_axis": (10.0, lambda s, v: {"twist_rad": 0.08 * v.sign * s, "twist_tilt": v.tilt}),
    "sensor_scale": (6.0, lambda s, v: {"scale": 0.08 * v.sign * s, "curvature": v.curvature}),
    "sensor_lag": (
        10.0,
        lambda s, v: {"late_s": 0.4 * s, "late_second": v.second, "late_falling": v.falling},
    ),
    "inertia": (4.7, lambda s, v: {"crossbar_kg_m2": 4e-5 * s}),
    "bimodulus": (5.0, _bimodulus),
    "gain_bump": (5.0, lambda s, v: {"bump": 0.15 * s, "bump_at": v.at, "bump_width": v.width}),
    "torque_ripple": (10.0, _torque_ripple),
    "run_slip": (20.0, lambda s, v: {"slip_rad": 0.015 * v.robot.modules * s}),
    "cycle_ageing": (6.0, lambda s, v: {"ageing": 0.004 * s}),
    "filling_hysteresis": (6.0, lambda s, v: {"filling": 0.1 * v.sign * s}),
    "warm_stick": (18.0, lambda s, v: {"warm_stick": 1e-4 * s, "friction_width": 0.03}),
    "sensor_wave": (6.0, _sensor_wave),
    "session_drift": (3.0, lambda s, v: {"drift_1_s": 2e-4 * v.sign * s}),
    "wall_buckling": (4.0, lambda s, v: {"buckling": 0.2 * s, "buckling_at": v.at}),
}
# MuJoCo's own damping and, of one joint, friction: light joints creep through its soft one.
OWN_DAMPING = (20.0, lambda s, v: {"joint_damping": 0.01 * s})
OWN_FRICTION = (6.0, lambda s, v: {"joint_friction": 1e-3 * s})
# Kinds that draw a `sign`, before their other numbers.
SIGNED = ("stiffness", "actuation_gain", "pressure_offset", "sensor_bias", "wall_thickness", "cross_axis")
SIGNED += ("sensor_scale", "bimodulus", "filling_hysteresis", "session_drift")
ANYWHERE, ROUND = ((0.0, 6.28), (0.0, 6.28)), ((0.0, 2 * np.pi), (0.0, 2 * np.pi))
FADING = ((0.05, 0.15), (-0.15, -0.05))
# Numbers of a kind in the order in which they are drawn: their ranges in judged and in calibration sets.
RANGES: Mapping[str, dict[str, tuple[tuple[float, float], tuple[float, float]]]] = {
    "stiffness": {"quadratic": ((0.6, 0.85), (1.15, 1.4))},
    "actuation_gain": {"fading": FADING},
    "pressure_offset": {"fading": FADING},
    "dead_zone": {"width": ((0.1, 0.2), (0.2, 0.3))},
    "supply_lag": {
        "vent": ((1.3, 1.8), (1.0, 1.4)),
        "second": ((0.08, 0.15), (0.12, 0.25)),
        "linear": ((0.02, 0.06), (0.08, 0.16)),
    },
    "viscous_damping": {"power": ((0.75, 0.9), (0.85, 1.0))},
    "viscoelastic": {
        "time_s": ((3.0, 10.0), (2.0, 14.0)),
        "spread": ((2.6, 3.6), (1.8, 2.8)),
        "tilt": ((0.7, 1.0), (0.9, 1.3)),
    },
    "friction_hysteresis": {"width": ((0.015, 0.04), (0.02, 0.05))},
    "mullins": {"scale": ((0.04, 0.12), (0.1, 0.25))},
    "permanent_set": {"power": ((1.5, 2.0), (1.2, 1.6))},
    "self_contact": {"at": ((0.17, 0.26), (0.2, 0.3)), "width": ((0.02, 0.05), (0.02, 0.05))},
    "thermal_softening": {"curvature": ((0.003, 0.01), (-0.008, 0.0))},
    "gravity_scale": {"arm": ((0.7, 1.0), (0.3, 0.6)), "side": ((0.0, 0.02), (-0.02, 0.0))},
    "sensor_bias": {"scale": ((-0.004, 0.004), (-0.006, 0.006))},
    "wall_thickness": {
        "linear": ((2.4, 2.8), (2.0, 2.2)),
        "quadratic": ((1.6, 1.9), (2.3, 2.5)),
        "gain": ((0.4, 0.6), (0.2, 0.4)),
    },
    "leak": {"power": ((0.6, 0.85), (1.15, 1.4)), "filling_s": ((0.1, 0.2), (0.2, 0.3))},
    "tendon_friction": {"rest_rad": ((0.05, 0.15), (0.0, 0.1)), "width": ((0.008, 0.02), (0.015, 0.03))},
    "backlash": {"knee": ((0.3, 0.5), (0.1, 0.3))},
    "base_misalignment": {"way": ROUND, "third": ((-0.2, 0.2), (-0.1, 0.1))},
    "inter_module_compliance": {"cubic": ((0.2, 0.6), (-0.1, 0.1))},
    "cross_axis": {"tilt": ((-0.3, 0.3), (-0.15, 0.15))},
    "sensor_scale": {"curvature": FADING},
    "sensor_lag": {"second": ((0.2, 0.4), (0.05, 0.2)), "falling": ((1.0, 1.0), (1.1, 1.3))},
    "bimodulus": {"quadratic": ((0.7, 0.9), (1.1, 1.3)), "width": ((0.04, 0.08), (0.003, 0.01))},
    "gain_bump": {"at": ((0.35, 0.65), (0.3, 0.7)), "width": ((0.1, 0.15), (0.12, 0.18))},
    "torque_ripple": {"period_s": ((27, 47), (20, 60)), "phase": ANYWHERE},
    "sensor_wave": {"period_rad": ((0.09, 0.15), (0.08, 0.2)), "phase": ANYWHERE},
    "wall_buckling": {"at": ((0.4, 0.7), (0.35, 0.75))},
}


def draw_part(kind: str, engine: Engine, robot: Robot, split: Split, rng: np.random.Generator) -> Part:
    """One effect with random shapes; `v.calibration` is 1 in calibration sets.

    Raises:
        ValueError: a kind that this test bed has not.
    """
    if kind not in CHANGES:
        raise ValueError(f"no truth of kind '{kind}'")
    (largest, change), drawn = CHANGES[kind], {}
    if engine == "mujoco" and kind == "viscous_damping":
        largest, change = OWN_DAMPING
    elif engine == "mujoco" and kind == "friction_hysteresis" and robot.modules == 1:
        largest, change = OWN_FRICTION
    else:
        if kind in SIGNED:
            drawn["sign"] = float(rng.choice([-1.0, 1.0]))
        for name, ranges in RANGES.get(kind, {}).items():
            drawn[name] = float(rng.uniform(*ranges[split == "calibration"]))
    v = SimpleNamespace(**drawn, robot=robot, calibration=float(split == "calibration"))
    return Part(kind, lambda s: change(s, v), largest, drawn)


def draw(kind: str, engine: Engine, robot: Robot, split: Split, rng: np.random.Generator) -> HiddenTruth:
    """A truth of this kind with random parameters and a random error of the model's law.

    Raises:
        ValueError: a kind that this test bed has not.
    """
    error = {}
    for name, size in (("actuation", 0.004), ("elastic", 0.003)):
        error[f"{name}_error"] = size * float(rng.choice([-1.0, 1.0])) * rng.uniform(0.6, 1.2)
        error[f"{name}_phase"] = rng.uniform(0, 2 * np.pi)
    parts = tuple(draw_part(name, engine, robot, split, rng) for name in kind.split(PLUS))
    drawn = {f"{part.kind}.{key}": value for part in parts for key, value in part.drawn.items()}
    return HiddenTruth(parts, error, error | drawn)
