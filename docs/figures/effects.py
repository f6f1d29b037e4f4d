"""Draw docs/pictures/effects/KIND.png: the run that shows each effect, with and without it.

Run: python docs/figures/effects.py [KIND …]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pliant.formatting import named_unit
from pliant.interfaces.effect import EffectConfig, Model
from pliant.records.chain import Actuator
from pliant.records.history import History
from pliant.registry.discovery import Registry, discover
from pliant.testing.effect_bench import run_readings
from pliant.testing.histories import triangles
from pliant.testing.samples import sample_chain, softening_law
from pliant.units import si_unit

OUT = Path(__file__).parent.parent / "pictures" / "effects"
DARK = "#222222"
WITH: dict[str, Any] = {"color": "#D55E00", "lw": 1.8}
WITHOUT: dict[str, Any] = {"color": "#555555", "lw": 1.2, "ls": (0, (4, 2))}
KPA, MNM = 1e3, 1e-3  # of the pressures and loads that the scenes apply
PASCALS_PER_NEWTON = 1500.0  # the sample law's, as a tendon of 10 N


@dataclass(frozen=True)
class Abscissa:
    """The abscissa of a picture: its name, its SI unit and its values in that unit."""

    label: str
    si: str
    of: Callable[[History], Any]


PRESSURE = Abscissa("pressure", "Pa", lambda history: history.actuation["pressure_pa"])
TENSION = Abscissa("tendon force", "N", lambda history: history.actuation["tendon_force_n"])
SECOND = Abscissa(
    "pressure of the first less the second chamber",
    "Pa",
    lambda history: history.actuation["pressure_1_pa"] - history.actuation["pressure_2_pa"],
)
CLOCK = Abscissa("time", "s", lambda history: history.time_s)
LOAD = Abscissa("load moment", "N*m", lambda history: history.moment_n_m)
PITCH = Abscissa("pitch of the base", "rad", lambda history: history.base_angles_rad[:, 1])


@dataclass(frozen=True)
class Scene:
    """The runs of one picture, their abscissa, and the feature to look at.

    `reads` is the reading that is drawn, `name` its label and `note` the text after the label of the abscissa.
    """

    runs: Sequence[History]
    over: Abscissa
    look: str
    modules: int = 1
    strength: float | None = None  # of the effect's first parameter, the others at their neutral values
    values: Mapping[str, Any] | None = None
    reads: str = "angle_rad"
    name: str = "angle"
    note: str = ""


def ramps(levels: tuple[float, ...], rate: float, holds_s: float = 0.0, **more: Any) -> History:
    """Return pressure ramps through levels in kPa at a rate in kPa/s."""
    time_s, value = triangles(levels, rate, min(0.1, 1.0 / rate), holds_s)
    return History.from_arrays({"pressure_pa": KPA * value}, time_s, **more)


def opposed(kpa: Sequence[float]) -> History:
    """Return a cycle of the first of two opposed chambers, then the same of the second."""
    there, none = KPA * np.asarray(kpa), np.zeros(len(kpa))
    signals = {"pressure_1_pa": np.append(there, none), "pressure_2_pa": np.append(none, there)}
    return History.from_arrays(signals, 0.5 * np.arange(2.0 * len(there)))


def loads(pressure_kpa: float, temperature_c: float = 22.0) -> History:
    """Return loads up and down at constant pressure."""
    moments = MNM * np.concatenate([np.linspace(0, 6, 25), np.linspace(6, -6, 49)])
    return History.from_arrays(
        {"pressure_pa": KPA * pressure_kpa}, moment_n_m=moments, temperature_c=temperature_c
    )


def ramps_then_load() -> History:
    """Return a ramp up, a hold, a ramp down, then a load on and off at constant pressure."""
    time_s, value = triangles((12.0, 5.0), 6.0, 0.05, holds_s=3.0)
    more = 0.05 * np.arange(1, 121)
    moment = np.where((more > 1.0) & (more < 4.0), 4 * MNM, 0.0)
    return History.from_arrays(
        {"pressure_pa": KPA * np.append(value, np.full(120, 5.0))},
        np.append(time_s, time_s[-1] + more),
        moment_n_m=np.append(np.zeros(len(time_s)), moment),
    )


def closed_valve() -> History:
    """Return a ramp up and a hold, then a valve closed for a minute."""
    time_s = 0.25 * np.arange(300)
    pressed = np.minimum(KPA * 4.0 * time_s, 12.0 * KPA)
    return History.from_arrays({"pressure_pa": pressed}, time_s, valve_open=np.where(time_s < 15.0, 1.0, 0.0))


def step() -> History:
    """Return a step of the pressure within a millisecond."""
    time_s = 1e-3 * np.arange(601)
    return History.from_arrays({"pressure_pa": np.where(time_s > 0.05, 8.0 * KPA, 0.0)}, time_s)


def pulls(*levels: float) -> History:
    """Return a tendon pulled to these levels, N; to three and released by default."""
    time_s, force = triangles(levels or (3.0, 0.0, 6.0, 0.0, 9.0, 0.0), 1.0, 0.05)
    return History.from_arrays({"tendon_force_n": force}, time_s)


def scenes() -> dict[str, Scene]:
    """Return kind → picture."""
    turns = np.zeros((61, 3))
    turns[:, 1] = np.linspace(-np.pi / 2, np.pi / 2, 61)
    return {
        "learned": Scene(
            [ramps((15.0,), 1.0)],
            PRESSURE,
            "nothing outside its data (4 to 12 kPa)",
            values={
                "acts_on": "input",
                "covariates": [{"name": "actuation", "low": 4 * KPA, "high": 12 * KPA}],
                "value": [0.0, 600.0, 1500.0, 1200.0, 400.0, 0.0],
            },
        ),
        "stiffness": Scene([loads(0.0), loads(10.0)], LOAD, "vented (lower curves): off too"),
        "actuation_gain": Scene([loads(0.0), loads(10.0)], LOAD, "vented (lower curves): no error"),
        "pressure_offset": Scene(
            [ramps((12.0,), 2.0), ramps((12.0,), 2.0, moment_n_m=6 * MNM)],
            PRESSURE,
            "bent at zero pressure",
            strength=1.2e3,
        ),
        "dead_zone": Scene(
            [ramps((6.0, 0.0), 1.0)],
            PRESSURE,
            "still at first",
            strength=1e3,
        ),
        "supply_lag": Scene([ramps_then_load()], CLOCK, "the load step (right) is followed at once"),
        "viscous_damping": Scene(
            [ramps_then_load()],
            CLOCK,
            "the load step (right) is delayed too",
            strength=0.6,
        ),
        "viscoelastic": Scene(
            [ramps((12.0, 0.0), 12.0, holds_s=90.0)], CLOCK, "drift in the hold and after venting"
        ),
        "friction_hysteresis": Scene(
            [ramps((12.0, 7.0, 9.0, 5.0, 12.0, 0.0), rate) for rate in (0.5, 5.0)],
            PRESSURE,
            "the same loop slow and fast",
        ),
        "mullins": Scene(
            [ramps((4.0, 0.0, 4.0, 0.0, 8.0, 0.0, 8.0, 0.0, 12.0, 0.0, 12.0, 0.0), 2.0)],
            PRESSURE,
            "first loadings lie on the model's line",
            strength=0.35,
        ),
        "permanent_set": Scene(
            [ramps((4.0, 0.0, 8.0, 0.0, 12.0, 0.0), 4.0, holds_s=4.0)],
            CLOCK,
            "what stays grows with the largest angle",
            strength=0.12,
        ),
        "gravity_scale": Scene(
            [History.from_arrays({"pressure_pa": np.full(61, 4e3)}, base_angles_rad=turns)],
            PITCH,
            "the error turns with the base",
            modules=8,
            strength=1.5,
        ),
        "self_contact": Scene([ramps((14.0, 0.0), 2.0)], PRESSURE, "a kink at one angle"),
        "thermal_softening": Scene(
            [loads(0.0, t) for t in (2.0, 22.0, 42.0)],
            LOAD,
            "right at 22 °C",
            note=", at 2, 22 and 42 °C",
            strength=0.01,
        ),
        "wall_thickness": Scene(
            [loads(0.0), loads(10.0)],
            LOAD,
            "vented and pressed: stiffer",
            strength=1.15,
        ),
        "leak": Scene([closed_valve()], CLOCK, "the valve closes at 15 s", strength=0.02),
        "bimodulus": Scene(
            [loads(0.0)],
            LOAD,
            "too far one way, too little the other",
            strength=0.3,
        ),
        "inertia": Scene([step()], CLOCK, "overshoots and rings", modules=8),
        "tendon_friction": Scene(
            [pulls()],
            TENSION,
            "the loop grows with the tension",
            modules=8,
            strength=0.3,
        ),
        "sensor_bias": Scene(
            [ramps((12.0, 0.0), 2.0)],
            PRESSURE,
            "the same everywhere",
            strength=0.05,
        ),
        "sensor_scale": Scene(
            [loads(0.0), loads(10.0)],
            LOAD,
            "off by a share of the angle, right at zero",
            strength=0.15,
        ),
        "sensor_lag": Scene(
            [ramps_then_load()],
            CLOCK,
            "the load step (right) is late too",
            strength=0.5,
        ),
        "backlash": Scene(
            [ramps((12.0, 7.0, 9.0, 5.0, 12.0, 0.0), 2.0)],
            PRESSURE,
            "stands still after every reversal",
            strength=0.06,
        ),
        "base_misalignment": Scene(
            [History.from_arrays({"pressure_pa": np.zeros(61)}, base_angles_rad=turns)],
            PITCH,
            "the error is largest where the chain hangs",
            modules=8,
            strength=0.15,
        ),
        "inter_module_compliance": Scene(
            [loads(0.0)],
            LOAD,
            "the middle joint of three: twice an end's error",
            modules=3,
            strength=0.3,
            reads="joint_2_angle_rad",
            name="angle of joint 2",
        ),
        "end_restraint": Scene(
            [loads(10.0)],
            LOAD,
            "the last of three joints bends too little",
            modules=3,
            values={"cap_share": 0.65},
            reads="joint_3_angle_rad",
            name="angle of joint 3",
        ),
        "link_stretch": Scene(
            [ramps((12.0, 0.0), 2.0)],
            PRESSURE,
            "the tip is farther out, the more the higher the pressure",
            modules=8,
            strength=8.0,
            reads="tip_x_m",
            name="tip beside the base",
        ),
        "payload_error": Scene(
            [ramps((12.0, 0.0), 2.0, payload_kg=mass) for mass in (0.0, 0.01)],
            PRESSURE,
            "without a payload (upper curves) no error",
            modules=8,
            strength=1.5,
        ),
        "gravity_error": Scene(
            [ramps((12.0, 0.0), 2.0)],
            PRESSURE,
            "gravity acts across the chain, too",
            modules=8,
            values={"x_m_s2": 3.0},
        ),
        "tendon_slack": Scene(
            [pulls(8.0, -8.0, 0.0)],
            TENSION,
            "the chain hardly bends where the tendon is paid out",
            modules=8,
        ),
        "unequal_actuators": Scene(
            [opposed(triangles((12.0, 0.0), 2.0, 0.5)[1])],
            SECOND,
            "right while the first chamber acts, too weak beyond",
            modules=8,
            values={"second": 0.8},
        ),
        "load_error": Scene([loads(0.0), loads(10.0)], LOAD, "no error without a load", strength=1.4),
        "clock_offset": Scene(
            [ramps_then_load()], CLOCK, "late in all, and nothing is rounded", strength=0.5
        ),
        "clock_drift": Scene(
            [ramps((12.0, 5.0) * 3, 6.0, holds_s=3.0)],
            CLOCK,
            "in time at first, then later and later",
            strength=0.03,
        ),
        "cross_axis": Scene(
            [ramps((12.0, 0.0), 2.0)],
            PRESSURE,
            "the tip leaves the plane as the chain bends",
            modules=8,
            strength=0.2,
            reads="tip_y_m",
            name="tip across the plane",
        ),
    }


def drawn(registry: Registry, scene: Scene, effect: Any | None) -> list[Any]:
    """Return the scene's reading in SI units, as the sensors measure it, in each run."""
    law = softening_law()
    if "tendon_force_n" in scene.runs[0].actuation:
        gains = {"k_n": PASCALS_PER_NEWTON * law.k_n, "m_a": PASCALS_PER_NEWTON * law.m_a}
        law = replace(law, actuation_name="tendon_force_n", **gains)
    bare = sample_chain(law, modules=scene.modules, gravity=(0, 0, -9.81 if scene.modules > 1 else 0))
    if "pressure_2_pa" in scene.runs[0].actuation:
        bare = bare.with_(actuators=(Actuator("pressure_1_pa"), Actuator("pressure_2_pa", -1.0)))
    model = effect.apply(Model(bare)) if effect else Model(bare)
    component = registry.get("physics", "quasistatic")
    engine = component.build(component.config_model()(kind="quasistatic"))
    reached = [model.commanded(history) for history in scene.runs]
    paths = engine.follow(model.chain, reached)[0]
    return [run_readings(model, p.joint_angles, h)[scene.reads] for p, h in zip(paths, reached, strict=True)]


def draw(registry: Registry, kind: str, scene: Scene) -> Figure:
    """Draw one picture."""
    component = registry.get("effect", kind)
    model = cast(type[EffectConfig], component.config_model())
    values = scene.values or component.smallest_block()
    if scene.strength is not None:
        values = {model.fit_parameters()[0].name: scene.strength}
    effect = component.build(model.model_validate({"kind": kind, **values}))
    figure = Figure(figsize=(4.6, 2.9), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    across, up = named_unit(scene.over.label, scene.over.si), named_unit(scene.name, si_unit(scene.reads))
    for name, present, style in (("with the effect", effect, WITH), ("model", None, WITHOUT)):
        for number, (run, read) in enumerate(zip(scene.runs, drawn(registry, scene, present), strict=True)):
            points = across.factor * scene.over.of(run), up.factor * read
            ax.plot(*points, label=name if number == 0 else None, **style)
    ax.set_xlabel(across.axis + scene.note)
    ax.set_ylabel(up.axis)
    ax.set_title(scene.look, fontsize=10, color=DARK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize=8, loc="best")
    return figure


def main() -> None:
    """Write the pictures."""
    registry = discover()
    chosen = sys.argv[1:]
    OUT.mkdir(parents=True, exist_ok=True)
    for kind, scene in scenes().items():
        if not chosen or kind in chosen:
            draw(registry, kind, scene).savefig(OUT / f"{kind}.png", metadata={"Software": None})


if __name__ == "__main__":
    main()
