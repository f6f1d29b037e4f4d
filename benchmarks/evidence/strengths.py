"""The random parameters of every kind of truth, and what it changes at a strength.

The two splits draw from other ranges, and where a form has a switch, other forms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from benchmarks.evidence.robots import Robot
from benchmarks.evidence.truths import CLEAN, PLUS, Change, Engine, HiddenTruth, Part, Split


class Dice:
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


def _stiffness(d: Dice) -> tuple[Change, float]:
    sign, share = d.sign(), d.uniform("quadratic", (0.6, 0.85), (1.15, 1.4))
    return lambda s: {"stiffness": 0.12 * sign * s, "stiffness_quadratic": share}, 4.0


def _actuation_gain(d: Dice) -> tuple[Change, float]:
    sign, fading = d.sign(), d.uniform("fading", (0.05, 0.15), (-0.15, -0.05))
    return lambda s: {"gain": 0.07 * sign * s, "gain_fading": fading}, 5.0


def _pressure_offset(d: Dice) -> tuple[Change, float]:
    sign, fading = d.sign(), d.uniform("fading", (0.05, 0.15), (-0.15, -0.05))
    return lambda s: {"offset_pa": 400 * sign * s, "offset_fading": fading}, 6.0


def _dead_zone(d: Dice) -> tuple[Change, float]:
    width = d.uniform("width", (0.1, 0.2), (0.2, 0.3))
    return lambda s: {"dead_pa": 600 * s, "dead_width": width}, 8.0


def _supply_lag(d: Dice) -> tuple[Change, float]:
    vent, second = d.uniform("vent", (1.3, 1.8), (1.0, 1.4)), d.uniform("second", (0.08, 0.15), (0.12, 0.25))
    linear = d.uniform("linear", (0.02, 0.06), (0.08, 0.16))
    shape = {"lag_vent": vent, "lag_second": second, "lag_linear": linear}
    return lambda s: {"lag_s": 0.5 * s, **shape}, 8.0


def _viscous(d: Dice) -> tuple[Change, float]:
    if d.engine == "mujoco":
        return lambda s: {"joint_damping": 0.01 * s}, 20.0
    power = d.uniform("power", (0.75, 0.9), (0.85, 1.0))
    return lambda s: {"viscous": 0.01 * s, "viscous_power": power}, 20.0


def _viscoelastic(d: Dice) -> tuple[Change, float]:
    time = d.uniform("time_s", (3.0, 10.0), (2.0, 14.0))
    spread = d.uniform("spread", (2.6, 3.6), (1.8, 2.8))
    tilt = d.uniform("tilt", (0.7, 1.0), (0.9, 1.3))

    def change(s: float) -> dict[str, float]:
        branches = {f"branch_{k + 1}": 0.004 * s * tilt**k for k in range(3)}
        return branches | {f"time_{k + 1}_s": time * spread ** (k - 1) for k in range(3)}

    return change, 8.0


def _friction(d: Dice) -> tuple[Change, float]:
    if d.engine == "mujoco" and d.robot.modules == 1:  # light joints creep through MuJoCo's soft friction
        return lambda s: {"joint_friction": 1e-3 * s}, 6.0
    width = d.uniform("width", (0.015, 0.04), (0.02, 0.05))
    stops = float(d.split == "calibration")
    return lambda s: {"friction": 1e-3 * s, "friction_width": width, "friction_stops": stops}, 6.0


def _mullins(d: Dice) -> tuple[Change, float]:
    scale = d.uniform("scale", (0.04, 0.12), (0.1, 0.25))
    return lambda s: {"mullins": min(0.2 * s, 0.85), "mullins_scale": scale}, 4.25


def _permanent_set(d: Dice) -> tuple[Change, float]:
    power = d.uniform("power", (1.5, 2.0), (1.2, 1.6))
    return lambda s: {"set_share": 0.1 * s, "set_power": power}, 6.0


def _self_contact(d: Dice) -> tuple[Change, float]:
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


def _thermal(d: Dice) -> tuple[Change, float]:
    curvature = d.uniform("curvature", (0.003, 0.01), (-0.008, 0.0))
    return lambda s: {"thermal": 0.01 * s, "thermal_curvature": curvature}, 2.5


def _gravity(d: Dice) -> tuple[Change, float]:
    share = d.uniform("arm", (0.7, 1.0), (0.3, 0.6))
    side = d.robot.length_m * d.uniform("side", (0.0, 0.02), (-0.02, 0.0))
    fitting = 0.25 * d.robot.mass_kg
    return lambda s: {"fitting_kg": fitting * s, "fitting_share": share, "fitting_side_m": side}, 6.0


def _bias(d: Dice) -> tuple[Change, float]:
    sign, scale = d.sign(), d.uniform("scale", (-0.004, 0.004), (-0.006, 0.006))
    return lambda s: {"bias_rad": 0.015 * d.robot.modules * sign * s, "scale": scale * min(s, 1.0)}, 10.0


def _gain_bump(d: Dice) -> tuple[Change, float]:
    at, width = d.uniform("at", (0.35, 0.65), (0.3, 0.7)), d.uniform("width", (0.1, 0.15), (0.12, 0.18))
    return lambda s: {"bump": 0.15 * s, "bump_at": at, "bump_width": width}, 5.0


def _torque_ripple(d: Dice) -> tuple[Change, float]:
    period, phase = d.uniform("period_s", (27, 47), (20, 60)), d.uniform("phase", (0, 6.28), (0, 6.28))
    return lambda s: {"ripple": 1e-3 * s, "ripple_period_s": period, "ripple_phase": phase}, 10.0


def _run_slip(d: Dice) -> tuple[Change, float]:
    return lambda s: {"slip_rad": 0.015 * d.robot.modules * s}, 20.0


def _cycle_ageing(d: Dice) -> tuple[Change, float]:
    return lambda s: {"ageing": 0.004 * s}, 6.0


def _filling(d: Dice) -> tuple[Change, float]:
    sign = d.sign()
    return lambda s: {"filling": 0.1 * sign * s}, 6.0


def _warm_stick(d: Dice) -> tuple[Change, float]:
    return lambda s: {"warm_stick": 1e-4 * s, "friction_width": 0.03}, 18.0


def _sensor_wave(d: Dice) -> tuple[Change, float]:
    period, phase = (
        d.uniform("period_rad", (0.09, 0.15), (0.08, 0.2)),
        d.uniform("phase", (0, 6.28), (0, 6.28)),
    )
    period *= d.robot.modules
    return lambda s: {
        "wave_rad": 0.025 * d.robot.modules * s,
        "wave_period_rad": period,
        "wave_phase": phase,
    }, 6.0


def _session_drift(d: Dice) -> tuple[Change, float]:
    sign = d.sign()
    return lambda s: {"drift_1_s": 2e-4 * sign * s}, 3.0


def _wall_buckling(d: Dice) -> tuple[Change, float]:
    at = d.uniform("at", (0.4, 0.7), (0.35, 0.75))
    return lambda s: {"buckling": 0.2 * s, "buckling_at": at}, 4.0


def _wall_thickness(d: Dice) -> tuple[Change, float]:
    sign = d.sign()
    linear, quadratic = (
        d.uniform("linear", (2.4, 2.8), (2.0, 2.2)),
        d.uniform("quadratic", (1.6, 1.9), (2.3, 2.5)),
    )
    gain = d.uniform("gain", (0.4, 0.6), (0.2, 0.4))
    powers = {"wall_linear": linear, "wall_quadratic": quadratic, "wall_gain": gain}
    return lambda s: {"wall": 1.0 + 0.06 * sign * s, **powers}, 6.0


def _leak(d: Dice) -> tuple[Change, float]:
    power, filling = (
        d.uniform("power", (0.6, 0.85), (1.15, 1.4)),
        d.uniform("filling_s", (0.1, 0.2), (0.2, 0.3)),
    )
    return lambda s: {"leak_1_s": 0.03 * s, "leak_power": power, "leak_filling_s": filling}, 10.0


def _tendon_friction(d: Dice) -> tuple[Change, float]:
    rest, width = (
        d.uniform("rest_rad", (0.05, 0.15), (0.0, 0.1)),
        d.uniform("width", (0.008, 0.02), (0.015, 0.03)),
    )
    return lambda s: {"tendon": 0.15 * s, "tendon_rest_rad": rest, "tendon_width": width}, 8.0


def _backlash(d: Dice) -> tuple[Change, float]:
    knee = d.uniform("knee", (0.3, 0.5), (0.1, 0.3))
    share = d.robot.modules if "angle_rad" in d.robot.outputs else 1
    return lambda s: {"play_rad": 0.03 * share * s, "play_knee": knee}, 10.0


def _base_misalignment(d: Dice) -> tuple[Change, float]:
    way = d.uniform("way", (0.0, 2 * np.pi), (0.0, 2 * np.pi))
    third = d.uniform("third", (-0.2, 0.2), (-0.1, 0.1))
    return (
        lambda s: {
            "tilt_x_rad": 0.05 * s * np.cos(way),
            "tilt_y_rad": 0.05 * s * np.sin(way),
            "tilt_z_rad": 0.05 * s * third,
        },
        6.0,
    )


def _inter_module(d: Dice) -> tuple[Change, float]:
    cubic = d.uniform("cubic", (0.2, 0.6), (-0.1, 0.1))
    return lambda s: {"interface": 0.15 * s, "interface_cubic": cubic}, 10.0


def _cross_axis(d: Dice) -> tuple[Change, float]:
    sign, tilt = d.sign(), d.uniform("tilt", (-0.3, 0.3), (-0.15, 0.15))
    return lambda s: {"twist_rad": 0.08 * sign * s, "twist_tilt": tilt}, 10.0


def _sensor_scale(d: Dice) -> tuple[Change, float]:
    sign, curvature = d.sign(), d.uniform("curvature", (0.05, 0.15), (-0.15, -0.05))
    return lambda s: {"scale": 0.08 * sign * s, "curvature": curvature}, 6.0


def _sensor_lag(d: Dice) -> tuple[Change, float]:
    second, falling = (
        d.uniform("second", (0.2, 0.4), (0.05, 0.2)),
        d.uniform("falling", (1.0, 1.0), (1.1, 1.3)),
    )
    return lambda s: {"late_s": 0.4 * s, "late_second": second, "late_falling": falling}, 10.0


def _inertia(d: Dice) -> tuple[Change, float]:
    return lambda s: {"crossbar_kg_m2": 4e-5 * s}, 4.7


def _bimodulus(d: Dice) -> tuple[Change, float]:
    sign, quadratic = d.sign(), d.uniform("quadratic", (0.7, 0.9), (1.1, 1.3))
    width = d.uniform("width", (0.04, 0.08), (0.003, 0.01))
    return lambda s: {
        "bimodulus": 0.15 * sign * s,
        "bimodulus_width": width,
        "bimodulus_quadratic": quadratic,
    }, 5.0


def _nothing(d: Dice) -> tuple[Change, float]:
    return lambda s: {}, 0.0


Drawn = Callable[[Dice], tuple[Change, float]]
EFFECTS: Mapping[str, Drawn] = {
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
    "wall_thickness": _wall_thickness,
    "leak": _leak,
    "tendon_friction": _tendon_friction,
    "backlash": _backlash,
    "base_misalignment": _base_misalignment,
    "inter_module_compliance": _inter_module,
    "cross_axis": _cross_axis,
    "sensor_scale": _sensor_scale,
    "sensor_lag": _sensor_lag,
    "inertia": _inertia,
    "bimodulus": _bimodulus,
    "gain_bump": _gain_bump,
    "torque_ripple": _torque_ripple,
    "run_slip": _run_slip,
    "cycle_ageing": _cycle_ageing,
    "filling_hysteresis": _filling,
    "warm_stick": _warm_stick,
    "sensor_wave": _sensor_wave,
    "session_drift": _session_drift,
    "wall_buckling": _wall_buckling,
}


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
        if name not in EFFECTS:
            raise ValueError(f"no truth of kind '{name}'")
        dice = Dice(rng, split, engine, robot)
        parts.append(draw_part(name, dice))
        drawn |= {f"{name}.{key}": value for key, value in dice.drawn.items()}
    return HiddenTruth(tuple(parts), error, drawn)


def draw_part(kind: str, dice: Dice) -> Part:
    """One effect with the shapes that these dice throw."""
    return Part(kind, *EFFECTS[kind](dice))
