"""Hidden truths: one effect, two, none, or an effect that no plugin has, with random parameters.

A truth is drawn once (`draw`) and then taken at a strength for each effect (`HiddenTruth.at`), which `sets.py` scales
until the outputs change by the wanted share of the noise; two effects ("a+b") are scaled one by one. Sets for
calibrating thresholds and sets that are judged have other forms (`form_table.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from benchmarks.evidence import rod_truth
from benchmarks.evidence.bench_errors import (
    MISTAKE_CHANGES,
    MISTAKES,
    UNSCALED,
    BenchError,
    Vector,
    gravities,
)
from benchmarks.evidence.form_table import CANDIDATE_FORMS, MISTAKE_FORMS, SPLITS, Split, kind_forms
from benchmarks.evidence.forms import Forms
from benchmarks.evidence.robots import B_E, Array, Robot
from benchmarks.evidence.rod_truth import Rod
from benchmarks.evidence.sensors import Sensor
from benchmarks.evidence.skeleton import Body

Engine = Literal["functional", "mujoco", "explicit", "rod"]
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
THIRTEEN = (
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
    "end_restraint",
    "link_stretch",
)
KINDS = (*FOURTEEN, *THIRTEEN)
# Two of these are hidden together: any two, each identifiable alone on one joint.
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
    "supply_beat": ("unknown_effect",),
    "detent": ("unknown_effect",),
    "load_coupling": ("unknown_effect",),
    "tilted_sensor": ("unknown_effect",),
    "warm_sensor": ("unknown_effect",),
}
# Of them, those that are functions of the actuation and the angle of a joint alone: where the law is off anyway, "the
# law is off" says of them what can be known.
STATIC_UNKNOWN = ("gain_bump", "wall_buckling", "detent")
# An answer that reports only the law's shape as missing, and the name of that shape in classes.
LAW_OFF, LAW = "law_off", "law"
# Where a kind makes sense: most sets are made of the first robot, some of the second.
ROBOTS_OF: Mapping[str, tuple[str, str]] = {
    "tendon_friction": ("finger", "finger"),
    "base_misalignment": ("four", "four"),
    "inter_module_compliance": ("four", "four"),
    "cross_axis": ("four", "four"),
    "inertia": ("joint", "joint"),
    "end_restraint": ("finger", "four"),
    "link_stretch": ("four", "chain"),
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
    rod: Rod = field(default_factory=Rod)
    bench: BenchError = field(default_factory=BenchError)


RECORDS = (Body, Sensor, Rod, BenchError)
FIELDS = frozenset(
    (*Forms._fields, *(name for one in (Body, Sensor, BenchError) for name in one.__dataclass_fields__))
)


@dataclass(frozen=True)
class Part:
    """One hidden effect without its strength.

    Attributes:
        kind: one of `KINDS`, `UNKNOWN` or `CLEAN`; form: of the table of forms, by name.
        change: fields of `Forms`, `Body` and `Sensor` at a strength; 1 is about 2 σ under a rich protocol, 0 no change.
        largest: the strength beyond which the form is meaningless.
        drawn: its random numbers, by name.
        stated_gravity: gravity in the study, m/s²; None if it is not stated.
    """

    kind: str
    form: str
    change: Callable[[float], dict[str, float]]
    largest: float
    drawn: Mapping[str, float]
    stated_gravity: Vector | None = None

    @property
    def unscaled(self) -> bool:
        """Return whether the strength is fixed at 1."""
        return self.kind in UNSCALED


@dataclass(frozen=True)
class HiddenTruth:
    """A truth without its strengths.

    Attributes:
        parts: the hidden effects, in the order of the kind's name.
        error: fields of the model's law that are off; or `law`, the table of its error, and `pull`, that of a rod.
        drawn: the random numbers, for the sealed label.
    """

    parts: tuple[Part, ...]
    error: Mapping[str, float]
    drawn: Mapping[str, float] = field(default_factory=dict)
    law: Array | None = None
    pull: tuple[float, ...] = ()

    def at(self, *strengths: float) -> Truth:
        """Return the truth with each part at its strength; parts without one are absent."""
        changes: dict[str, float] = {}
        for part, strength in zip(self.parts, strengths, strict=False):
            changes.update(part.change(strength))

        def select_fields(names: Any) -> dict[str, float]:
            """Return fields by the record that has them; no two records have one of the same name."""
            return {name: value for name, value in changes.items() if name in names}

        shape = {} if self.law is None else {"law": self.law}
        forms = Forms(**{**self.error, **shape, **select_fields(Forms._fields)})
        body, sensor, rod, bench = (one(**select_fields(one.__dataclass_fields__)) for one in RECORDS)
        return Truth(forms, body, sensor, replace(rod, rod_pull=self.pull), bench)

    @property
    def stated_gravity(self) -> Vector | None:
        """Return the gravity in the study; None if it is not stated."""
        return next((part.stated_gravity for part in self.parts if part.stated_gravity), None)

    def alone(self, index: int) -> HiddenTruth:
        """Return the truth with only one of its parts."""
        return replace(self, parts=(self.parts[index],))


def hidden_kinds(kind: str) -> tuple[str, ...]:
    """Return the effects that a set of this kind hides: none, one, or two of "a+b"."""
    return () if kind == CLEAN else tuple(sorted(kind.split(PLUS)))


def kind_robots(kind: str) -> tuple[str, str]:
    """Return the usual robot of a kind, and the other one."""
    return ROBOTS_OF.get(kind, USUAL_ROBOTS)


def right_verdicts(kind: str) -> Right:
    """Return verdicts that count as right; `missing_effect` also needs the right kinds."""
    return ("nothing_missing",) if kind == CLEAN else UNKNOWN.get(kind, ("missing_effect",))


def right_where_the_law_is_off(kind: str) -> Right:
    """Return the right verdicts with an inexact law: LAW_OFF is also right for a clean robot and static effects."""
    if kind == CLEAN:
        return ("nothing_missing", LAW_OFF, "insufficient_data")
    return right_verdicts(kind) + ((LAW_OFF,) if kind in STATIC_UNKNOWN else ())


def _viscoelastic(s: float, v: Any) -> dict[str, float]:
    count, middle = int(v.branches), (v.branches - 1) / 2
    sizes = {f"branch_{k + 1}": 0.012 / count * s * v.tilt**k for k in range(count)}
    return sizes | {f"time_{k + 1}_s": v.time_s * v.spread ** (k - middle) for k in range(count)}


def _friction(s: float, v: Any) -> dict[str, float]:
    return {"joint_friction": 1e-3 * s} if hasattr(v, "own") else {"friction": 1e-3 * s}


def _gravity(s: float, v: Any) -> dict[str, float]:
    place = {"fitting_share": v.arm, "fitting_side_m": v.robot.length_m * v.side}
    return {"fitting_kg": 0.25 * v.robot.mass_kg * s, **place}


def _sensor_bias(s: float, v: Any) -> dict[str, float]:
    bias = {"bias_rad": 0.015 * v.read_modules * v.sign * s}
    if hasattr(v, "bias_period"):
        bias["bias_period_rad"] = v.bias_period * v.read_modules
    return bias | ({"scale": v.scale * min(s, 1.0)} if hasattr(v, "scale") else {})


def _sensor_scale(s: float, v: Any) -> dict[str, float]:
    return {"scale": 0.08 * v.sign * s, "curvature_over_rad": 0.8 * v.read_modules}


def _base_misalignment(s: float, v: Any) -> dict[str, float]:
    across = {"tilt_x_rad": 0.05 * s * np.cos(v.way), "tilt_y_rad": 0.05 * s * np.sin(v.way)}
    return {**across, "tilt_z_rad": 0.05 * s * v.third}


def _end_restraint(s: float, v: Any) -> dict[str, float]:
    per = 0.15 if hasattr(v, "gives") else 0.25
    return {"end_base": per * s * (1 - v.balance), "end_cap": per * s * v.balance}


def _sensor_wave(s: float, v: Any) -> dict[str, float]:
    return {"wave_rad": 0.025 * v.read_modules * s, "wave_period_rad": v.wave_period * v.read_modules}


def _detent(s: float, v: Any) -> dict[str, float]:
    return {
        "detent": 1e-3 * s,
        "detent_period_rad": v.detent_period,
        "detent_at_rad": getattr(v, "detent_at", 0.0),
    }


# The largest strength of each kind, and its fields at a strength s with the numbers v of its form; numbers that
# have the name of a field are that field's. `v.read_modules` is how many modules a reading of an angle adds up.
CHANGES: Mapping[str, tuple[float, Callable[[float, Any], dict[str, float]]]] = {
    CLEAN: (0.0, lambda s, v: {}),
    "stiffness": (4.0, lambda s, v: {"stiffness": 0.12 * v.sign * s}),
    "actuation_gain": (5.0, lambda s, v: {"gain": 0.07 * v.sign * s}),
    "pressure_offset": (6.0, lambda s, v: {"offset_pa": 400 * v.sign * s}),
    "dead_zone": (8.0, lambda s, v: {"dead_pa": 600 * s}),
    "supply_lag": (8.0, lambda s, v: {"lag_s": 0.5 * s}),
    "viscous_damping": (20.0, lambda s, v: {"viscous": 0.01 * s}),
    "viscoelastic": (8.0, _viscoelastic),
    "friction_hysteresis": (6.0, _friction),
    "mullins": (4.25, lambda s, v: {"mullins": min(0.2 * s, 0.85)}),
    "permanent_set": (6.0, lambda s, v: {"set_share": 0.1 * s}),
    "self_contact": (40.0, lambda s, v: {"contact": 0.04 * s}),
    "thermal_softening": (2.5, lambda s, v: {"thermal": 0.01 * s}),
    "gravity_scale": (6.0, _gravity),
    "sensor_bias": (10.0, _sensor_bias),
    "wall_thickness": (6.0, lambda s, v: {"wall": 1.0 + 0.06 * v.sign * s}),
    "leak": (10.0, lambda s, v: {"leak_1_s": 0.03 * s}),
    "tendon_friction": (8.0, lambda s, v: {"tendon": 0.15 * s}),
    "backlash": (10.0, lambda s, v: {"play_rad": 0.03 * v.read_modules * s}),
    "base_misalignment": (6.0, _base_misalignment),
    "inter_module_compliance": (10.0, lambda s, v: {"interface": 0.15 * s}),
    "cross_axis": (10.0, lambda s, v: {"twist_rad": 0.08 * v.sign * s}),
    "sensor_scale": (6.0, _sensor_scale),
    "sensor_lag": (10.0, lambda s, v: {"late_s": 0.4 * s}),
    "inertia": (4.7, lambda s, v: {"crossbar_kg_m2": 4e-5 * s}),
    "bimodulus": (5.0, lambda s, v: {"bimodulus": 0.15 * v.sign * s}),
    "end_restraint": (6.0, _end_restraint),
    "link_stretch": (9.0, lambda s, v: {"stretch": 0.03 * s}),
    "gain_bump": (5.0, lambda s, v: {"bump": 0.15 * s}),
    "torque_ripple": (10.0, lambda s, v: {"ripple": 1e-3 * s}),
    "run_slip": (20.0, lambda s, v: {"slip_rad": 0.015 * v.read_modules * s}),
    "cycle_ageing": (20.0, lambda s, v: {"ageing": 0.004 * s}),
    "filling_hysteresis": (6.0, lambda s, v: {"filling": 0.1 * v.sign * s}),
    "warm_stick": (18.0, lambda s, v: {"warm_stick": 1e-4 * s}),
    "sensor_wave": (6.0, _sensor_wave),
    "session_drift": (3.0, lambda s, v: {"drift_1_s": 2e-4 * v.sign * s}),
    "wall_buckling": (4.0, lambda s, v: {"buckling": 0.2 * s}),
    "supply_beat": (6.0, lambda s, v: {"beat": 0.05 * s}),
    "detent": (3.0, _detent),
    "load_coupling": (8.0, lambda s, v: {"load_coupling": 0.3 * v.coupling * s}),
    "tilted_sensor": (8.0, lambda s, v: {"tilted_rad": 0.02 * v.read_modules * s}),
    "warm_sensor": (20.0, lambda s, v: {"warm_rad": 0.06 * v.sign * v.read_modules * s}),
}
# The candidate's parameters, SI, by the fields of a set that has its equation.
PARAMETERS: Mapping[str, Callable[[Any], dict[str, float]]] = {
    "backlash": lambda v: {"play_rad": v.play_rad},
    "viscoelastic": lambda v: {"share": v.branch_1 / B_E, "time_s": v.time_1_s},
    "viscous_damping": lambda v: {"time_s": v.viscous / B_E},
    "supply_lag": lambda v: {"time_s": v.lag_s, "vent_ratio": v.lag_vent, "second_ratio": v.lag_second},
    "friction_hysteresis": lambda v: {"half_width_rad": v.friction / B_E, "break_away_rad": v.friction_width},
    "sensor_bias": lambda v: {"bias_rad": v.bias_rad},
    "permanent_set": lambda v: {"share": v.set_share},
}
# Kinds that draw a `sign`, before their other numbers.
SIGNED = ("stiffness", "actuation_gain", "pressure_offset", "sensor_bias", "wall_thickness", "cross_axis")
SIGNED += ("sensor_scale", "bimodulus", "filling_hysteresis", "session_drift", "warm_sensor")
SIGNED += ("wrong_payload", "wrong_clock")


def draw_part(
    kind: str, engine: Engine, robot: Robot, split: Split, rng: np.random.Generator, candidates: bool = False
) -> Part:
    """Draw one effect of one of the split's forms, or of the candidate's form, with random numbers.

    Raises:
        ValueError: a kind that this test bed has not.
    """
    if kind == CLEAN:
        return Part(kind, "", lambda s: {}, 0.0, {})
    if kind not in (rod_truth.CHANGES if engine == "rod" else {**CHANGES, **MISTAKE_CHANGES}):
        raise ValueError(f"no truth of kind '{kind}'")
    if engine == "rod":
        return _rod_part(kind, rng)
    largest, change = CHANGES.get(kind) or MISTAKE_CHANGES[kind]
    every = (CANDIDATE_FORMS[kind],) if candidates else _mistake_or_kind_forms(kind, split)
    possible = [
        form
        for form in every
        if (not form.engines or engine in form.engines) and (not form.robots or robot.name in form.robots)
    ]
    form = possible[int(rng.integers(len(possible)))]
    drawn = {"sign": float(rng.choice([-1.0, 1.0]))} if kind in SIGNED else {}
    for name, ends in form.ranges.items():
        side = float(rng.choice([-1.0, 1.0])) if name in form.either_sign else 1.0
        drawn[name] = side * float(rng.uniform(*ends))
    numbers = {**form.switch, **drawn}
    read_modules = robot.modules if "angle_rad" in robot.outputs else 1
    v = SimpleNamespace(**numbers, robot=robot, read_modules=read_modules)
    fields = {name: value for name, value in numbers.items() if name in FIELDS and name != "scale"}
    stated = gravities(v)[1] if kind == "wrong_gravity" else None
    return Part(kind, form.name, lambda s: fields | change(s, v), largest, drawn, stated)


def _mistake_or_kind_forms(kind: str, split: Split) -> tuple[Any, ...]:
    return MISTAKE_FORMS[kind][SPLITS.index(split)] if kind in MISTAKES else kind_forms(kind, split)


def hidden_parameters(part: Part, strength: float) -> dict[str, float]:
    """Return "kind.name": value of the candidate's parameters with the same readings, for a part with its equation."""
    found = PARAMETERS[part.kind](SimpleNamespace(**part.change(strength)))
    return {f"{part.kind}.{name}": value for name, value in found.items()}


def _rod_part(kind: str, rng: np.random.Generator) -> Part:
    """Return an effect of a rod, in MuJoCo's terms."""
    largest, name, size, signed = rod_truth.CHANGES[kind]
    sign = float(rng.choice([-1.0, 1.0])) if signed else 1.0
    limit = float(rng.uniform(*rod_truth.LIMITS_RAD))
    drawn = {"sign": sign, "rod_limit_rad": limit}
    return Part(
        kind, "a rod in MuJoCo", lambda s: {"rod_limit_rad": limit, name: sign * size * s}, largest, drawn
    )


def draw(
    kind: str, engine: Engine, robot: Robot, split: Split, rng: np.random.Generator, candidates: bool = False
) -> HiddenTruth:
    """Draw a truth of this kind with random parameters and a random error of the model's law.

    Raises:
        ValueError: a kind that this test bed has not.
    """
    error = {}
    for name, size in (("actuation", 0.004), ("elastic", 0.003)):
        error[f"{name}_error"] = size * float(rng.choice([-1.0, 1.0])) * rng.uniform(0.6, 1.2)
        error[f"{name}_phase"] = rng.uniform(0, 2 * np.pi)
    parts = tuple(draw_part(name, engine, robot, split, rng, candidates) for name in kind.split(PLUS))
    drawn = {f"{part.kind}.{key}": value for part in parts for key, value in part.drawn.items()}
    return HiddenTruth(parts, error, error | drawn)
