"""What is hidden, by kind: where it acts, and its equations in calibration sets and in judged ones.

Two forms differ in their equation or its shape, or in a number whose ranges have no point in common;
`tests/systems_bed/test_forms.py` derives from the table that no form of a kind is in both splits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from benchmarks.evidence.form_table import Split
from benchmarks.systems import equations as e

Range = tuple[float, float]
# Numbers that say where something happens to be, not what equation it has: these ranges may be the same.
PLACES = ("phase", "x", "y", "z", "way")
PHASE: Range = (0.0, 6.28)
WAY: dict[str, Range] = dict.fromkeys("xyz", (-1.0, 1.0))


@dataclass(frozen=True)
class Form:
    """One equation of an effect, with a shape and ranges of its uniformly drawn numbers."""

    name: str
    equation: Callable[..., Any]
    shape: Any = None
    ranges: Mapping[str, Range] = field(default_factory=dict)


@dataclass(frozen=True)
class Kind:
    """An effect that is hidden.

    Attributes:
        place: input, all_inputs, output, vector, joint, spring (a joint with one), drive (a joint with a position drive),
            tendon, pulled (a tendon with one), body, or world.
        largest: strength beyond which it is meaningless, in the units of its equations.
        forms: of the calibration split, and of the judged one.
        signed: its strength has either sign.
        alone: it is at one place only.
    """

    place: str
    largest: float
    forms: tuple[tuple[Form, ...], tuple[Form, ...]]
    signed: bool = False
    alone: bool = False

    def of(self, split: Split) -> tuple[Form, ...]:
        """Return the forms of a split."""
        return self.forms[0 if split == "calibration" else 1]


def f(name: str, equation: Callable[..., Any], shape: Any = None, **ranges: Range) -> Form:
    return Form(name, equation, shape, ranges)


def _levels(equation: Callable[..., Any]) -> tuple[tuple[Form, ...], tuple[Form, ...]]:
    """Return forms of what is a constant in the plugin."""
    calibration = f("more at larger levels", equation, e.evenly, a=(0.15, 0.35))
    square = f("less, with the square", equation, e.square, a=(-0.4, -0.2))
    return (calibration,), (square, f("warming up", equation, e.warming, a=(0.2, 0.4), T=(1.0, 2.5)))


LAGS = (
    (f("two stages", e.stages, a=(0.35, 0.5)),),
    (f("second order", e.oscillating, z=(0.75, 1.1)), f("lag and moving average", e.average, a=(0.3, 0.5))),
)
LATE = (
    (f("later at larger levels", e.late_by_level, a=(0.15, 0.3)),),
    (f("sampled and held", e.held, a=(0.3, 0.5)),),
)
FRICTION = (
    (f("tanh", e.rubbing, e.tanh, w=(0.02, 0.04)),),
    (f("root", e.rubbing, e.rooted, w=(0.01, 0.02)), f("Dahl", e.bristle, p=(1.0, 1.0), slip=(0.01, 0.02))),
)
SPRINGS = (
    (f("stiffening", e.spring, e.evenly, a=(0.15, 0.35)),),
    (f("softening", e.spring, e.thinning, a=(0.3, 0.6)), f("soon", e.spring, e.soon, a=(0.2, 0.35))),
)
GAPS = (
    (f("softplus", e.gap, e.softplus, a=(0.1, 0.2)),),
    (f("root", e.gap, e.root, a=(0.15, 0.3)),),
)
KINDS: Mapping[str, Kind] = {
    "actuation_gain": Kind("input", 0.6, _levels(e.gain), signed=True),
    "input_offset": Kind("input", 0.5, _levels(e.offset), signed=True),
    "dead_zone": Kind(
        "input",
        0.6,
        (
            (f("softplus", e.dead, e.softplus, a=(0.1, 0.2)),),
            (f("root", e.dead, e.root, a=(0.15, 0.3)),),
        ),
    ),
    "supply_lag": Kind(
        "input", 1.0, (LAGS[0], (LAGS[1][0], f("orifice", e.orifice, a=(0.2, 0.5))))
    ),
    "dead_time": Kind("input", 0.5, LATE),
    "backlash": Kind(
        "input",
        0.6,
        (
            (f("three plays, alike", e.plays, (-1.0, 0.0, 1.0), a=(0.1, 0.2)),),
            (f("two plays, unlike", e.plays, (-1.0, 1.0), a=(0.3, 0.5)),),
        ),
    ),
    "saturation": Kind(
        "input", 0.75, ((f("rounded", e.clipped, p=(6.0, 9.0)),), (f("knee", e.knee, a=(0.15, 0.3)),))
    ),
    "leak": Kind(
        "input",
        5.0,
        (
            (f("power above 1", e.leaking, p=(1.15, 1.35), part=(1.0, 1.0)),),
            (
                f("power below 1", e.leaking, p=(0.7, 0.85), part=(1.0, 1.0)),
                f("not all of it", e.leaking, p=(1.0, 1.0), part=(0.75, 0.9)),
            ),
        ),
    ),
    "sensor_bias": Kind(
        "output",
        0.5,
        (
            (f("with a scale", e.offset, e.evenly, a=(0.1, 0.25)),),
            (
                f("warming up", e.offset, e.warming, a=(0.2, 0.4), T=(1.0, 2.5)),
                f("eccentric", e.eccentric, a=(0.15, 0.3), phase=PHASE),
            ),
        ),
        signed=True,
    ),
    "sensor_scale": Kind("output", 0.5, _levels(e.gain), signed=True),
    "sensor_lag": Kind("output", 0.5, LAGS),
    "sensor_delay": Kind("output", 0.6, LATE),
    "misaligned_frame": Kind(
        "vector",
        0.6,
        (
            (f("and sheared", e.sheared, ((0, 1, 0), (0, 0, 0), (0, 0, 0)), a=(0.05, 0.15), **WAY),),
            (f("and stretched", e.sheared, ((1, 0, 0), (0, -1, 0), (0, 0, 0)), a=(0.05, 0.15), **WAY),),
        ),
    ),
    "stiffness": Kind("joint", 20.0, SPRINGS),
    "rest_angle": Kind(
        "spring",
        1.0,
        (
            (f("warming up", e.shifted, e.warming, a=(0.15, 0.3), T=(1.0, 2.0)),),
            (f("more when bent", e.shifted, e.evenly, a=(0.1, 0.25)),),
        ),
        signed=True,
    ),
    "viscous_damping": Kind(
        "joint",
        20.0,
        (
            (f("power", e.dashpot, e.power, p=(0.7, 0.85)),),
            (
                f("quadratic part", e.dashpot, e.evenly, a=(0.3, 0.6)),
                f("shear thinning", e.dashpot, e.thinning, a=(0.3, 0.6)),
            ),
        ),
    ),
    "coulomb_friction": Kind("joint", 5.0, FRICTION),
    "stribeck_friction": Kind(
        "joint",
        10.0,
        (
            (f("exponential", e.falling, e.exponential, fall=(0.15, 0.3)),),
            (f("Lorentz", e.falling, e.lorentz, fall=(0.15, 0.3)),),
        ),
    ),
    "friction_hysteresis": Kind(
        "joint",
        10.0,
        (
            (f("three stops", e.stops, (0.6, 1.0, 1.6), slip=(0.12, 0.3)),),
            (
                f("Bouc-Wen", e.bristle, p=(1.8, 2.5), slip=(0.12, 0.3)),
                f("Dahl", e.bristle, p=(1.0, 1.0), slip=(0.2, 0.4)),
            ),
        ),
    ),
    "viscoelastic": Kind(
        "joint",
        20.0,
        (
            (f("two times", e.relaxing, (0.6, 1.6), T=(0.2, 0.6)),),
            (f("three times", e.relaxing, (0.35, 1.0, 2.5), T=(0.2, 0.6)),),
        ),
    ),
    "joint_play": Kind("drive", 0.5, GAPS),
    "tendon_friction": Kind(
        "tendon",
        3.0,
        (
            (f("three stops", e.stops, (0.7, 1.0, 1.3), slip=(0.02, 0.04)),),
            (
                f("Bouc-Wen", e.bristle, p=(1.8, 2.5), slip=(0.02, 0.05)),
                f("Dahl", e.bristle, p=(1.0, 1.0), slip=(0.02, 0.04)),
            ),
        ),
    ),
    "tendon_stiffness": Kind("tendon", 20.0, SPRINGS),
    "tendon_slack": Kind(
        "pulled",
        0.9,
        (
            (f("softplus", e.gap, e.softplus, a=(0.1, 0.2), one_way=(1.0, 1.0)),),
            (f("root", e.gap, e.root, a=(0.15, 0.3), one_way=(1.0, 1.0)),),
        ),
    ),
    "body_mass": Kind(
        "body",
        2.0,
        (
            (f("inertia by a higher power", e.heavier, p=(1.2, 1.5)),),
            (
                f("partly from its neighbour", e.heavier, p=(1.0, 1.0), taken=(0.1, 0.25)),
                f("inertia by a lower power", e.heavier, p=(0.4, 0.8)),
            ),
        ),
        signed=True,
    ),
    "centre_of_mass": Kind(
        "body",
        4.0,
        (
            (f("with some mass", e.beside, mass=(0.01, 0.03), **WAY),),
            (f("with some inertia", e.beside, inertia=(0.05, 0.15), **WAY),),
        ),
        alone=True,
    ),
    "body_inertia": Kind(
        "body",
        20.0,
        (
            (f("unequal axes", e.turning, (0.0, 1.0, -1.0), a=(0.1, 0.2)),),
            (f("with some mass", e.turning, (0.0, 0.0, 0.0), a=(0.0, 0.0), mass=(0.005, 0.02)),),
        ),
        alone=True,
    ),
    "payload": Kind(
        "body",
        4.0,
        (
            (f("a point, aside", e.loaded, away=(0.1, 0.25), ball=(0.0, 0.0), **WAY),),
            (f("a ball, farther aside", e.loaded, away=(0.3, 0.5), ball=(0.01, 0.02), **WAY),),
        ),
        alone=True,
    ),
    "gravity_scale": Kind(
        "world",
        0.8,
        (
            (f("more at the far bodies", e.lighter, lambda r: r, a=(0.1, 0.25)),),
            (f("more at the near bodies", e.lighter, lambda r: 1.0 - r * r, a=(0.1, 0.25)),),
        ),
        signed=True,
    ),
    "gravity_direction": Kind(
        "world",
        0.6,
        ((f("and less", e.tilted, a=(-0.15, -0.05), way=PHASE),), (f("and more", e.tilted, a=(0.05, 0.15), way=PHASE),)),
    ),
    "base_misalignment": Kind(
        "world",
        0.6,
        (
            (f("with a lever below", e.mounted, way=PHASE, third=(-0.3, 0.3), lever_m=(0.01, 0.02)),),
            (f("with a lever above", e.mounted, way=PHASE, third=(-0.3, 0.3), lever_m=(-0.02, -0.01)),),
        ),
    ),
}  # fmt: skip
# Effects without a plugin.
UNKNOWN: Mapping[str, Kind] = {
    "torque_ripple": Kind(
        "joint",
        10.0,
        ((f("sine", e.ripple, n=(2.0, 3.0), phase=PHASE),), (f("teeth", e.cogged, n=(2.0, 4.0), phase=PHASE),)),
    ),
    "joint_coupling": Kind(
        "joints", 10.0, ((f("by positions", e.coupled, a=(0.2, 0.5)),), (f("by speeds", e.dragged, p=(0.8, 1.2)),))
    ),
    "moment_arm": Kind(
        "joint", 3.0, ((f("sine", e.arm, n=(2.5, 3.5), phase=PHASE),), (f("parabola", e.lost_arm, a=(-0.6, 0.6)),))
    ),
    "draught": Kind(
        "joint",
        10.0,
        (
            (f("one wave", e.gusts, (1.0,), hz=(0.3, 0.6), phase=PHASE),),
            (f("three waves", e.gusts, (1.0, 1.62, 2.7), hz=(0.3, 0.6), phase=PHASE),),
        ),
        alone=True,
    ),
    "varying_payload": Kind(
        "body", 3.0, ((f("draining", e.draining, T=(1.0, 2.5)),), (f("swashing", e.draining, hz=(0.6, 1.2)),)), alone=True
    ),
    "encoder_marks": Kind(
        "output",
        0.5,
        (
            (f("one harmonic", e.wavy, (1.0,), n=(3.0, 4.5), phase=PHASE),),
            (f("two harmonics", e.wavy, (1.0, 2.3), n=(2.5, 4.0), phase=PHASE),),
        ),
        alone=True,
    ),
    "supply_sag": Kind(
        "all_inputs", 0.9, ((f("at once", e.sagging, p=(1.0, 1.0)),), (f("late", e.sagging, p=(1.5, 2.5), T=(0.3, 0.8)),))
    ),
}  # fmt: skip
EVERY: Mapping[str, Kind] = {**KINDS, **UNKNOWN}
