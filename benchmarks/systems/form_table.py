"""What is hidden, by kind: where it acts, and its equations in calibration sets and in judged ones.

Two forms differ in their equation or its shape, or in a number whose ranges have no point in common;
`tests/testbed/test_systems_bed.py` derives from the table that no form of a kind is in both splits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from benchmarks.evidence.form_table import Split
from benchmarks.systems import force_equations as f
from benchmarks.systems import number_equations as n
from benchmarks.systems import shapes as c
from benchmarks.systems import signal_equations as s

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
        place: input, all_inputs, output, vector, joint, joints (all of them together), spring (a joint with one),
            drive (a joint with a position drive), tendon, pulled (a tendon with one), body, or world.
        calibration, judged: its forms in either split.
        signed: its strength has either sign.
        alone: it is at one place only.
    """

    place: str
    calibration: tuple[Form, ...]
    judged: tuple[Form, ...]
    signed: bool = False
    alone: bool = False

    def of(self, split: Split) -> tuple[Form, ...]:
        """Return the forms of a split."""
        return self.calibration if split == "calibration" else self.judged


def a(name: str, equation: Callable[..., Any], shape: Any = None, **ranges: Range) -> Form:
    """Return a form."""
    return Form(name, equation, shape, ranges)


def _levels(equation: Callable[..., Any]) -> tuple[tuple[Form, ...], tuple[Form, ...]]:
    """Return forms of what is a constant in the plugin."""
    less = a("less, with the square", equation, c.square, a=(-0.4, -0.2))
    warming = a("warming up", equation, c.warming, a=(0.2, 0.4), T=(1.0, 2.5))
    return (a("more at larger levels", equation, c.evenly, a=(0.15, 0.35)),), (less, warming)


# fmt: off
ORDERS = a("second order", s.oscillating, z=(0.75, 1.1))
LAG = (a("two stages", s.stages, a=(0.35, 0.5)),)
LATE = (a("later at larger levels", s.late_by_level, a=(0.15, 0.3)),), (a("sampled and held", s.held, a=(0.3, 0.5)),)
SPRINGS = (
    (a("stiffening", f.spring, c.evenly, a=(0.15, 0.35)),),
    (a("softening", f.spring, c.thinning, a=(0.3, 0.6)), a("soon", f.spring, c.soon, a=(0.2, 0.35))),
)
ROUND, ROOT = {"a": (0.1, 0.2)}, {"a": (0.15, 0.3)}
ONE_WAY = {"one_way": (1.0, 1.0)}
KINDS: Mapping[str, Kind] = {
    "actuation_gain": Kind("input", *_levels(s.gain), signed=True),
    "input_offset": Kind("input", *_levels(s.offset), signed=True),
    "dead_zone": Kind("input",
        (a("softplus", s.dead, c.softplus, **ROUND),), (a("root", s.dead, c.root, **ROOT),)),
    "supply_lag": Kind("input", LAG, (ORDERS, a("orifice", s.orifice, a=(0.2, 0.5)))),
    "dead_time": Kind("input", *LATE),
    "backlash": Kind("input",
        (a("three plays, alike", s.plays, (-1.0, 0.0, 1.0), a=(0.1, 0.2)),),
        (a("two plays, unlike", s.plays, (-1.0, 1.0), a=(0.3, 0.5)),)),
    "saturation": Kind("input", (a("rounded", s.clipped, p=(6.0, 9.0)),), (a("knee", s.knee, a=(0.15, 0.3)),)),
    "leak": Kind("input",
        (a("power above 1", s.leaking, p=(1.15, 1.35), part=(1.0, 1.0)),),
        (a("power below 1", s.leaking, p=(0.7, 0.85), part=(1.0, 1.0)),
         a("not all of it", s.leaking, p=(1.0, 1.0), part=(0.75, 0.9)))),
    "sensor_bias": Kind("output",
        (a("with a scale", s.offset, c.evenly, a=(0.1, 0.25)),),
        (a("warming up", s.offset, c.warming, a=(0.2, 0.4), T=(1.0, 2.5)),
         a("eccentric", s.eccentric, a=(0.15, 0.3), phase=PHASE)), signed=True),
    "sensor_scale": Kind("output", *_levels(s.gain), signed=True),
    "sensor_lag": Kind("output", LAG, (ORDERS, a("lag and moving average", s.average, a=(0.3, 0.5)))),
    "sensor_delay": Kind("output", *LATE),
    "misaligned_frame": Kind("vector",
        (a("and sheared", s.sheared, ((0, 1, 0), (0, 0, 0), (0, 0, 0)), a=(0.05, 0.15), **WAY),),
        (a("and stretched", s.sheared, ((1, 0, 0), (0, -1, 0), (0, 0, 0)), a=(0.05, 0.15), **WAY),)),
    "stiffness": Kind("joint", *SPRINGS),
    "rest_angle": Kind("spring",
        (a("warming up", f.shifted, c.warming, a=(0.15, 0.3), T=(1.0, 2.0)),),
        (a("more when bent", f.shifted, c.evenly, a=(0.1, 0.25)),), signed=True),
    "viscous_damping": Kind("joint",
        (a("power", f.dashpot, c.power, p=(0.7, 0.85)),),
        (a("quadratic part", f.dashpot, c.evenly, a=(0.3, 0.6)),
         a("shear thinning", f.dashpot, c.thinning, a=(0.3, 0.6)))),
    "coulomb_friction": Kind("joint",
        (a("tanh", f.rubbing, c.tanh, w=(0.02, 0.04)),),
        (a("root", f.rubbing, c.rooted, w=(0.01, 0.02)), a("Dahl", f.bristle, p=(1.0, 1.0), slip=(0.01, 0.02)))),
    "stribeck_friction": Kind("joint",
        (a("exponential", f.falling, c.exponential, fall=(0.15, 0.3)),),
        (a("Lorentz", f.falling, c.lorentz, fall=(0.15, 0.3)),)),
    "friction_hysteresis": Kind("joint",
        (a("three stops", f.stops, (0.6, 1.0, 1.6), slip=(0.12, 0.3)),),
        (a("Bouc-Wen", f.bristle, p=(1.8, 2.5), slip=(0.12, 0.3)),
         a("Dahl", f.bristle, p=(1.0, 1.0), slip=(0.2, 0.4)))),
    "viscoelastic": Kind("joint",
        (a("two times", f.relaxing, (0.6, 1.6), T=(0.2, 0.6)),),
        (a("three times", f.relaxing, (0.35, 1.0, 2.5), T=(0.2, 0.6)),)),
    "joint_play": Kind("drive", (a("softplus", f.gap, c.softplus, **ROUND),), (a("root", f.gap, c.root, **ROOT),)),
    "tendon_friction": Kind("tendon",
        (a("three stops", f.stops, (0.7, 1.0, 1.3), slip=(0.02, 0.04)),),
        (a("Bouc-Wen", f.bristle, p=(1.8, 2.5), slip=(0.02, 0.05)),
         a("Dahl", f.bristle, p=(1.0, 1.0), slip=(0.02, 0.04)))),
    "tendon_stiffness": Kind("tendon", *SPRINGS),
    "tendon_slack": Kind("pulled",
        (a("softplus", f.gap, c.softplus, **ROUND, **ONE_WAY),), (a("root", f.gap, c.root, **ROOT, **ONE_WAY),)),
    "body_mass": Kind("body",
        (a("inertia by a higher power", n.heavier, p=(1.2, 1.5)),),
        (a("partly from its neighbour", n.heavier, p=(1.0, 1.0), taken=(0.1, 0.25)),
         a("inertia by a lower power", n.heavier, p=(0.4, 0.8))), signed=True),
    "centre_of_mass": Kind("body",
        (a("with some mass", n.beside, mass=(0.01, 0.03), **WAY),),
        (a("with some inertia", n.beside, inertia=(0.05, 0.15), **WAY),), alone=True),
    "body_inertia": Kind("body",
        (a("unequal axes", n.turning, (0.0, 1.0, -1.0), a=(0.1, 0.2)),),
        (a("with some mass", n.turning, (0.0, 0.0, 0.0), a=(0.0, 0.0), mass=(0.005, 0.02)),), alone=True),
    "payload": Kind("body",
        (a("a point, aside", n.loaded, away=(0.1, 0.25), ball=(0.0, 0.0), **WAY),),
        (a("a ball, farther aside", n.loaded, away=(0.3, 0.5), ball=(0.01, 0.02), **WAY),), alone=True),
    "gravity_scale": Kind("world",
        (a("more at the far bodies", n.lighter, n.far, a=(0.1, 0.25)),),
        (a("more at the near bodies", n.lighter, n.near, a=(0.1, 0.25)),), signed=True),
    "gravity_direction": Kind("world",
        (a("and less", n.tilted, a=(-0.15, -0.05), way=PHASE),), (a("and more", n.tilted, a=(0.05, 0.15), way=PHASE),)),
    "base_misalignment": Kind("world",
        (a("with a lever below", n.mounted, way=PHASE, third=(-0.3, 0.3), lever_m=(0.01, 0.02)),),
        (a("with a lever above", n.mounted, way=PHASE, third=(-0.3, 0.3), lever_m=(-0.02, -0.01)),)),
}
# Effects without a plugin.
UNKNOWN: Mapping[str, Kind] = {
    "torque_ripple": Kind("joint",
        (a("sine", f.ripple, n=(2.0, 3.0), phase=PHASE),), (a("teeth", f.cogged, n=(2.0, 4.0), phase=PHASE),)),
    "joint_coupling": Kind("joints",
        (a("by positions", f.coupled, a=(0.2, 0.5)),), (a("by speeds", f.dragged, p=(0.8, 1.2)),)),
    "moment_arm": Kind("joint",
        (a("sine", f.arm, n=(2.5, 3.5), phase=PHASE),), (a("parabola", f.lost_arm, a=(-0.6, 0.6)),)),
    "draught": Kind("joint",
        (a("one wave", f.gusts, (1.0,), hz=(0.3, 0.6), phase=PHASE),),
        (a("three waves", f.gusts, (1.0, 1.62, 2.7), hz=(0.3, 0.6), phase=PHASE),), alone=True),
    "varying_payload": Kind("body",
        (a("draining", n.draining, T=(1.0, 2.5)),), (a("swashing", n.draining, hz=(0.6, 1.2)),), alone=True),
    "encoder_marks": Kind("output",
        (a("one harmonic", s.wavy, (1.0,), n=(3.0, 4.5), phase=PHASE),),
        (a("two harmonics", s.wavy, (1.0, 2.3), n=(2.5, 4.0), phase=PHASE),), alone=True),
    "supply_sag": Kind("all_inputs",
        (a("at once", s.sagging, p=(1.0, 1.0)),), (a("late", s.sagging, p=(1.5, 2.5), T=(0.3, 0.8)),)),
}
# fmt: on
EVERY: Mapping[str, Kind] = {**KINDS, **UNKNOWN}
