"""Which equations are hidden: for every kind, the forms of the calibration split and those of the judged one.

Thresholds of the diagnosis may look at calibration sets. What is judged must be something else, so every kind, and
every unknown effect, has other forms in either split: another equation (`switch` says which), or the same one with
numbers of ranges that have no point in common. `tests/testbed/test_form_table.py` derives that from this table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from benchmarks.evidence import forms as f

Split = Literal["calibration", "judged"]
Range = tuple[float, float]
SPLITS: tuple[Split, Split] = ("calibration", "judged")
# Where something happens to be put, not what equation it has: these ranges may be the same.
PLACES = ("ripple_phase", "wave_phase", "tilted_phase", "way")


@dataclass(frozen=True)
class Form:
    """One equation of an effect.

    Attributes:
        name: of the equation, or of its numbers' range.
        switch: fields that choose the equation; forms with the same switch have the same equation.
        ranges: ranges of the uniform draws for each set, in this order.
        either_sign: ranges whose numbers get a sign by chance.
        engines, robots: that can follow it; empty means all.
    """

    name: str
    switch: Mapping[str, float] = field(default_factory=dict)
    ranges: Mapping[str, Range] = field(default_factory=dict)
    either_sign: tuple[str, ...] = ()
    engines: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()


def _make_form(
    name: str, *either_sign: str, switch: Mapping[str, float] | None = None, **ranges: Range
) -> Form:
    return Form(name, switch or {}, ranges, either_sign)


FRICTIONLOSS = Form("MuJoCo's own", {"own": 1.0}, engines=("mujoco",), robots=("joint",))
# Where friction falls with speed, a light joint with inertia sticks and slips in microseconds.
LUGRE = Form(
    "LuGre",
    {"friction_shape": f.DAHL, "falls": 1.0},
    {"friction_width": (0.015, 0.04), "friction_stribeck": (0.04, 0.1)},
    engines=("functional",),
)
# Of each kind: the forms of the calibration split, and those of the judged one.
FORMS: Mapping[str, tuple[tuple[Form, ...], tuple[Form, ...]]] = {
    "stiffness": (
        (
            _make_form("quadratic part more", stiffness_quadratic=(1.15, 1.4)),
            _make_form(
                "more along the square of the angle",
                switch={"stiffness_shape": f.SQUARE},
                stiffness_fading=(0.1, 0.25),
            ),
        ),
        (
            _make_form("quadratic part less", stiffness_quadratic=(0.6, 0.85)),
            _make_form(
                "less, soon", switch={"stiffness_shape": f.SATURATING}, stiffness_fading=(-0.25, -0.1)
            ),
        ),
    ),
    "actuation_gain": (
        (
            _make_form("changes evenly", "gain_fading", gain_fading=(0.05, 0.15)),
            _make_form(
                "changes with the square",
                "gain_fading",
                switch={"gain_shape": f.SQUARE},
                gain_fading=(0.05, 0.15),
            ),
        ),
        (
            _make_form(
                "changes beyond half", "gain_fading", switch={"gain_shape": f.KINK}, gain_fading=(0.05, 0.15)
            ),
            _make_form(
                "changes soon", "gain_fading", switch={"gain_shape": f.SATURATING}, gain_fading=(0.05, 0.15)
            ),
        ),
    ),
    "pressure_offset": (
        (
            _make_form("changes evenly", "offset_fading", offset_fading=(0.05, 0.15)),
            _make_form(
                "changes soon",
                "offset_fading",
                switch={"offset_shape": f.SATURATING},
                offset_fading=(0.05, 0.15),
            ),
        ),
        (
            _make_form(
                "changes beyond half",
                "offset_fading",
                switch={"offset_shape": f.KINK},
                offset_fading=(0.05, 0.15),
            ),
            _make_form(
                "changes with the square",
                "offset_fading",
                switch={"offset_shape": f.SQUARE},
                offset_fading=(0.05, 0.15),
            ),
        ),
    ),
    "dead_zone": (
        (_make_form("softplus", dead_width=(0.15, 0.3)),),
        (
            _make_form("root", switch={"dead_shape": f.ROOT}, dead_width=(0.2, 0.5)),
            _make_form("parabola", switch={"dead_shape": f.PARABOLA}, dead_width=(0.2, 0.5)),
        ),
    ),
    "supply_lag": (
        (
            _make_form(
                "orifice, wide laminar",
                lag_vent=(1.0, 1.35),
                lag_second=(0.16, 0.25),
                lag_linear=(0.08, 0.16),
            ),
            _make_form(
                "dead time and first order",
                switch={"lag_shape": f.DEAD_TIME},
                lag_vent=(1.0, 1.4),
                lag_second=(0.15, 0.35),
            ),
        ),
        (
            _make_form(
                "orifice, turbulent", lag_vent=(1.4, 1.8), lag_second=(0.08, 0.15), lag_linear=(0.02, 0.06)
            ),
            _make_form(
                "second order",
                switch={"lag_shape": f.SECOND_ORDER},
                lag_vent=(1.0, 1.3),
                lag_second=(0.7, 0.95),
            ),
        ),
    ),
    "viscous_damping": (
        (
            _make_form("power, little thinning", viscous_power=(0.84, 0.95)),
            _make_form("power, thickening", viscous_power=(1.05, 1.2)),
        ),
        (
            _make_form("power, shear thinning", viscous_power=(0.6, 0.8)),
            _make_form("quadratic part", switch={"viscous_power": 1.0}, viscous_quadratic=(0.3, 0.8)),
        ),
    ),
    "viscoelastic": (
        (
            _make_form(
                "two times", switch={"branches": 2.0}, time_s=(3.0, 9.0), spread=(3.0, 6.0), tilt=(0.8, 1.3)
            ),
            _make_form(
                "three times, close",
                switch={"branches": 3.0},
                time_s=(1.5, 3.5),
                spread=(1.6, 2.4),
                tilt=(1.05, 1.3),
            ),
        ),
        (
            _make_form(
                "three times, wide",
                switch={"branches": 3.0},
                time_s=(4.0, 10.0),
                spread=(2.7, 3.8),
                tilt=(0.7, 1.0),
            ),
            _make_form(
                "Eyring",
                switch={"branches": 2.0, "eyring": 1.0},
                time_s=(4.0, 12.0),
                spread=(2.0, 3.0),
                tilt=(0.8, 1.2),
                eyring_rad=(0.2, 0.5),
            ),
        ),
    ),
    "friction_hysteresis": (
        (
            _make_form("three stops", switch={"friction_shape": f.STOPS}, friction_width=(0.02, 0.05)),
            _make_form(
                "Dahl",
                switch={"friction_shape": f.DAHL, "friction_stribeck": 0.0},
                friction_width=(0.02, 0.05),
            ),
        ),
        (
            _make_form("Bouc-Wen", switch={"friction_shape": f.BOUC_WEN}, friction_width=(0.015, 0.04)),
            LUGRE,
            FRICTIONLOSS,
        ),
    ),
    "mullins": (
        (_make_form("exponential", mullins_scale=(0.06, 0.2)),),
        (
            _make_form("tanh", switch={"mullins_shape": f.TANH}, mullins_scale=(0.08, 0.25)),
            _make_form("ratio of angles", switch={"mullins_shape": f.RATIO}, mullins_scale=(0.02, 0.06)),
        ),
    ),
    "permanent_set": (
        (
            _make_form("power, low", set_power=(1.15, 1.4)),
            _make_form("power, high", set_power=(1.6, 1.9)),
        ),
        (
            _make_form("saturating", switch={"saturates": 1.0}, set_limit=(0.8, 1.4)),
            _make_form("delayed", switch={"delayed": 1.0}, set_power=(1.0, 1.1), set_delay_s=(2.0, 6.0)),
        ),
    ),
    "self_contact": (
        (_make_form("softplus", contact_at=(0.2, 0.3), contact_width=(0.02, 0.05)),),
        (
            _make_form(
                "quadratic",
                switch={"contact_power": 2.0},
                contact_at=(0.17, 0.26),
                contact_width=(0.02, 0.05),
            ),
            _make_form(
                "power 3/2",
                switch={"contact_power": 1.5},
                contact_at=(0.17, 0.26),
                contact_width=(0.02, 0.05),
            ),
        ),
    ),
    "thermal_softening": (
        (
            _make_form(
                "less when hot, quadratic part more",
                thermal_curvature=(-0.008, -0.002),
                thermal_quadratic=(1.1, 1.3),
            ),
        ),
        (
            _make_form(
                "more when hot, quadratic part less",
                thermal_curvature=(0.003, 0.01),
                thermal_quadratic=(0.7, 0.9),
            ),
        ),
    ),
    "gravity_scale": (
        (_make_form("fittings at the near half", arm=(0.3, 0.6), side=(-0.02, -0.005)),),
        (_make_form("fittings at the far half", arm=(0.7, 1.0), side=(0.005, 0.02)),),
    ),
    "sensor_bias": (
        (_make_form("with a scale", "scale", scale=(0.003, 0.006)),),
        (
            _make_form(
                "warming up", switch={"warming": 1.0}, bias_warming=(0.1, 0.25), bias_warming_s=(6.0, 20.0)
            ),
            _make_form("eccentric", switch={"eccentric": 1.0}, bias_wave=(0.08, 0.2), bias_period=(0.4, 0.9)),
        ),
    ),
    "wall_thickness": (
        (
            _make_form(
                "low powers",
                wall_linear=(2.0, 2.2),
                wall_quadratic=(2.3, 2.5),
                wall_gain=(0.2, 0.35),
                wall_fading=(0.5, 0.7),
            ),
        ),
        (
            _make_form(
                "high powers",
                wall_linear=(2.4, 2.8),
                wall_quadratic=(1.6, 1.9),
                wall_gain=(0.4, 0.6),
                wall_fading=(0.2, 0.4),
            ),
        ),
    ),
    "leak": (
        (_make_form("power above 1", leak_power=(1.15, 1.4), leak_filling_s=(0.2, 0.3)),),
        (
            _make_form("orifice", leak_power=(0.5, 0.85), leak_filling_s=(0.1, 0.19)),
            _make_form(
                "crack that opens", switch={"cracks": 1.0}, leak_crack=(0.8, 2.0), leak_crack_at=(0.3, 0.5)
            ),
        ),
    ),
    "tendon_friction": (
        (_make_form("Bouc-Wen", tendon_rest_rad=(0.0, 0.1), tendon_width=(0.015, 0.03)),),
        (
            _make_form(
                "Dahl",
                switch={"tendon_shape": f.DAHL},
                tendon_rest_rad=(0.05, 0.15),
                tendon_width=(0.008, 0.02),
            ),
            _make_form("Bouc-Wen, stiff", tendon_rest_rad=(0.11, 0.18), tendon_width=(0.006, 0.014)),
        ),
    ),
    "backlash": (
        (_make_form("three plays, alike", play_knee=(0.1, 0.25)),),
        (
            _make_form("three plays, unlike", play_knee=(0.35, 0.5)),
            _make_form("cushioned", switch={"play_knee": 0.0}, play_cushion=(0.08, 0.18)),
        ),
    ),
    "base_misalignment": (
        (_make_form("little third angle", "third", way=(0.0, 6.283), third=(0.02, 0.1)),),
        (_make_form("third angle", "third", way=(0.0, 6.283), third=(0.15, 0.3)),),
    ),
    "inter_module_compliance": (
        (_make_form("stiffening little", interface_cubic=(0.03, 0.12)),),
        (_make_form("stiffening", interface_cubic=(0.2, 0.6)),),
    ),
    "cross_axis": (
        (_make_form("little tilt", "twist_tilt", twist_tilt=(0.02, 0.12)),),
        (
            _make_form("tilt along the chain", "twist_tilt", twist_tilt=(0.18, 0.35)),
            _make_form("bow along the chain", "twist_bow", switch={"twist_tilt": 0.0}, twist_bow=(0.2, 0.5)),
        ),
    ),
    "sensor_scale": (
        (
            _make_form("changes evenly", "curvature", curvature=(0.05, 0.15)),
            _make_form(
                "changes soon", "curvature", switch={"curvature_shape": f.SATURATING}, curvature=(0.05, 0.15)
            ),
        ),
        (
            _make_form(
                "changes beyond half", "curvature", switch={"curvature_shape": f.KINK}, curvature=(0.05, 0.15)
            ),
            _make_form(
                "changes with the square",
                "curvature",
                switch={"curvature_shape": f.SQUARE},
                curvature=(0.05, 0.15),
            ),
        ),
    ),
    "sensor_lag": (
        (_make_form("two stages, slow falling", late_second=(0.05, 0.18), late_falling=(1.1, 1.3)),),
        (
            _make_form("two stages", switch={"late_falling": 1.0}, late_second=(0.22, 0.4)),
            _make_form("moving average", switch={"late_average": 1.0}),
        ),
    ),
    "inertia": (
        (_make_form("bars in light oil", bar_drag_1_s=(3.6, 4.4)),),
        (_make_form("bars in heavier oil", bar_drag_1_s=(5.0, 7.0)),),
    ),
    "bimodulus": (
        (
            _make_form(
                "jump",
                switch={"bimodulus_jump": 1.0},
                bimodulus_quadratic=(1.1, 1.3),
                bimodulus_width=(0.003, 0.01),
            ),
        ),
        (_make_form("tanh", bimodulus_quadratic=(0.7, 0.9), bimodulus_width=(0.04, 0.08)),),
    ),
    "end_restraint": (
        (_make_form("springs beside the end joints", balance=(0.3, 0.9), end_cubic=(0.1, 0.5)),),
        (
            _make_form(
                "stiff ends that give way", switch={"gives": 1.0}, balance=(0.2, 0.8), end_giving=(0.15, 0.5)
            ),
        ),
    ),
    "link_stretch": (
        (_make_form("power of the pressure", stretch_power=(1.1, 1.4), stretch_taper=(-0.2, -0.05)),),
        (
            _make_form(
                "soon, the tip more",
                switch={"saturates": 1.0},
                stretch_saturating=(0.6, 1.5),
                stretch_taper=(0.1, 0.3),
            ),
        ),
    ),
    "gain_bump": (
        (_make_form("bump", bump_at=(0.3, 0.7), bump_width=(0.12, 0.18)),),
        (
            _make_form(
                "rise and dip", switch={"bump_turns": 1.0}, bump_at=(0.35, 0.65), bump_width=(0.1, 0.15)
            ),
        ),
    ),
    "torque_ripple": (
        (_make_form("sine", ripple_period_s=(20.0, 60.0), ripple_phase=(0.0, 6.283)),),
        (
            _make_form(
                "saw", switch={"ripple_saw": 1.0}, ripple_period_s=(17.0, 47.0), ripple_phase=(0.0, 6.283)
            ),
        ),
    ),
    "run_slip": (
        (_make_form("normal", switch={"slip_sides": 0.0}),),
        (_make_form("to either side", switch={"slip_sides": 1.0}),),
    ),
    "cycle_ageing": (
        (_make_form("with the cycles", ageing_power=(0.9, 1.1)),),
        (_make_form("with their root", ageing_power=(0.5, 0.7)),),
    ),
    "filling_hysteresis": (
        (_make_form("in the middle of the range", switch={"filling_power": 0.0}),),
        (_make_form("towards the top", filling_power=(1.0, 2.0)),),
    ),
    "warm_stick": (
        (_make_form("three stops", switch={"friction_shape": f.STOPS}, friction_width=(0.02, 0.03)),),
        (_make_form("Bouc-Wen", switch={"friction_shape": f.BOUC_WEN}, friction_width=(0.025, 0.04)),),
    ),
    "sensor_wave": (
        (_make_form("sine", wave_period=(0.08, 0.2), wave_phase=(0.0, 6.283)),),
        (
            _make_form(
                "triangle", switch={"wave_triangle": 1.0}, wave_period=(0.09, 0.15), wave_phase=(0.0, 6.283)
            ),
        ),
    ),
    "session_drift": (
        (_make_form("even", switch={"drift_settles_s": 0.0}),),
        (_make_form("settling", drift_settles_s=(400.0, 900.0)),),
    ),
    "wall_buckling": (
        (_make_form("for good", buckling_at=(0.35, 0.75)),),
        (
            _make_form(
                "and back", switch={"springs_back": 1.0}, buckling_at=(0.3, 0.5), buckling_until=(0.2, 0.35)
            ),
        ),
    ),
    "supply_beat": (
        (_make_form("sine", beat_period_s=(6.0, 11.0)),),
        (_make_form("two levels", switch={"beat_steps": 1.0}, beat_period_s=(9.0, 17.0)),),
    ),
    "detent": (
        (_make_form("many", detent_period=(0.36, 0.5)),),
        (_make_form("one catch", switch={"one": 1.0}, detent_at=(0.2, 0.3), detent_period=(0.06, 0.1)),),
    ),
    "load_coupling": (
        (_make_form("with the pressure", "coupling", switch={"load_bending": 0.0}, coupling=(1.0, 1.0)),),
        (_make_form("with the bending", "coupling", switch={"load_bending": 1.0}, coupling=(1.0, 1.0)),),
    ),
    "tilted_sensor": (
        (_make_form("three times around", tilted_turns=(2.8, 3.2), tilted_phase=(0.0, 6.283)),),
        (_make_form("four times around", tilted_turns=(3.8, 4.4), tilted_phase=(0.0, 6.283)),),
    ),
    "warm_sensor": (
        (_make_form("at once", switch={"warm_s": 0.0}),),
        (_make_form("after a while", warm_s=(6.0, 15.0)),),
    ),
}
# Errors of a bench's records, as effects: the forms of either split.
MISTAKE_FORMS: Mapping[str, tuple[tuple[Form, ...], tuple[Form, ...]]] = {
    "wrong_payload": (
        (
            _make_form("all by a factor", switch={"factor": 1.0}),
            _make_form("one run", switch={"one_run": 1.0}, at=(0.0, 1.0)),
        ),
        (
            _make_form("a hook that was not weighed", switch={"hook": 1.0}),
            _make_form("the heavier of two payloads", switch={"level": 1.0}),
        ),
    ),
    "wrong_clock": (
        (
            _make_form("an offset", switch={"offset": 1.0, "clock_jitter": 0.0}),
            _make_form("a drift within each run", switch={"drift": 1.0}),
        ),
        (
            _make_form("offsets of each run", switch={"offset": 1.0}, clock_jitter=(0.3, 0.6)),
            _make_form("a drift over the session", switch={"session": 1.0}),
        ),
    ),
    "wrong_gravity": (
        (
            _make_form("forgotten", switch={"forgotten": 1.0, "mounted": 0.0}, way=(0.0, 0.0)),
            _make_form("half a turn", switch={"turned": math.pi}, way=(0.0, 0.0)),
        ),
        (
            _make_form(
                "forgotten on an inclined bench",
                switch={"forgotten": 1.0},
                mounted=(0.6, 1.5),
                way=(0.0, 6.283),
            ),
            _make_form("a quarter of a turn", switch={"turned": math.pi / 2}, way=(0.0, 6.283)),
        ),
    ),
}
# The equations of the candidates themselves, to see whether stated intervals hold: of one equation no two splits can
# have other forms, and these sets say nothing about which effect is named.
CANDIDATE_FORMS: Mapping[str, Form] = {
    "backlash": _make_form("the candidate's", switch={"play_knee": 0.0}),
    "viscoelastic": _make_form(
        "the candidate's", switch={"branches": 1.0, "spread": 1.0, "tilt": 1.0}, time_s=(3.0, 20.0)
    ),
    "viscous_damping": _make_form("the candidate's", switch={"viscous_power": 1.0}),
    "supply_lag": _make_form(
        "the candidate's", switch={"lag_linear": 1.0}, lag_vent=(0.8, 1.6), lag_second=(0.08, 0.3)
    ),
    "friction_hysteresis": _make_form(
        "the candidate's", switch={"friction_shape": f.ONE_STOP}, friction_width=(0.005, 0.02)
    ),
    "sensor_bias": _make_form("the candidate's"),
    "permanent_set": _make_form("the candidate's", switch={"set_power": 1.0}),
}
# Of the error of a law that is off: the bases of the calibration split, and those of the judged one. Cycles over the
# working range, widths and distances of knots in shares of it.
LAW_SHAPES: tuple[tuple[Form, ...], tuple[Form, ...]] = (
    (
        _make_form("plane waves", switch={"waves": 1.0}, cycles=(0.5, 1.1)),
        _make_form("products of waves", switch={"waves": 2.0}, cycles=(0.4, 0.8)),
    ),
    (
        _make_form("rational bumps", switch={"bumps": 1.0}, width=(0.2, 0.4)),
        _make_form("tanh ridges", switch={"ridges": 1.0}, width=(0.15, 0.4)),
        _make_form("rounded folds", switch={"folds": 1.0}, width=(0.08, 0.2)),
    ),
)


def kind_forms(kind: str, split: Split) -> tuple[Form, ...]:
    """Return the forms of a kind in a split."""
    return FORMS[kind][SPLITS.index(split)]
