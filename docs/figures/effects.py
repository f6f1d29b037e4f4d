"""Draw docs/pictures/effects/KIND.png: the run that shows each effect, with and without it.

Run: python docs/figures/effects.py [KIND …]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pliant.interfaces.effect import Model
from pliant.records.history import History
from pliant.registry.discovery import Registry, discover
from pliant.testing.histories import triangles
from pliant.testing.samples import sample_chain

OUT = Path(__file__).parent.parent / "pictures" / "effects"
DARK = "#222222"
WITH: dict[str, Any] = {"color": "#D55E00", "lw": 1.8}
WITHOUT: dict[str, Any] = {"color": "#555555", "lw": 1.2, "ls": (0, (4, 2))}
KPA, MNM = 1e3, 1e-3
Abscissa = Callable[[History], Any]


@dataclass(frozen=True)
class Scene:
    """The runs of one picture, what they are drawn over, and what to look at."""

    runs: Sequence[History]
    over: Abscissa
    label: str
    look: str
    modules: int = 1
    values: Mapping[str, float] | None = None


def pressure(history: History) -> Any:
    return history.actuation["pressure_pa"] / KPA


def clock(history: History) -> Any:
    return history.time_s


def load(history: History) -> Any:
    return history.moment_n_m / MNM


def pitch(history: History) -> Any:
    return np.degrees(history.base_angles_rad[:, 1])


def ramps(levels: tuple[float, ...], rate: float, holds_s: float = 0.0, **more: Any) -> History:
    """Pressure ramps through levels in kPa at a rate in kPa/s."""
    time_s, value = triangles(levels, rate, min(0.1, 1.0 / rate), holds_s)
    return History.of({"pressure_pa": KPA * value}, time_s, **more)


def loads(pressure_kpa: float, temperature_c: float = 22.0) -> History:
    """Loads up and down at constant pressure."""
    moments = MNM * np.concatenate([np.linspace(0, 6, 25), np.linspace(6, -6, 49)])
    return History.of({"pressure_pa": KPA * pressure_kpa}, moment_n_m=moments, temperature_c=temperature_c)


def ramps_then_load() -> History:
    """Up, hold, down, then a load on and off at constant pressure."""
    time_s, value = triangles((12.0, 5.0), 6.0, 0.05, holds_s=3.0)
    more = 0.05 * np.arange(1, 121)
    moment = np.where((more > 1.0) & (more < 4.0), 4 * MNM, 0.0)
    return History.of(
        {"pressure_pa": KPA * np.append(value, np.full(120, 5.0))},
        np.append(time_s, time_s[-1] + more),
        moment_n_m=np.append(np.zeros(len(time_s)), moment),
    )


def scenes() -> dict[str, Scene]:
    """Kind → picture."""
    turns = np.zeros((61, 3))
    turns[:, 1] = np.linspace(-np.pi / 2, np.pi / 2, 61)
    return {
        "stiffness": Scene(
            [loads(0.0), loads(10.0)], load, "load moment / mN·m", "vented (lower curves): off too"
        ),
        "actuation_gain": Scene(
            [loads(0.0), loads(10.0)], load, "load moment / mN·m", "vented (lower curves): no error"
        ),
        "pressure_offset": Scene(
            [ramps((12.0,), 2.0), ramps((12.0,), 2.0, moment_n_m=6 * MNM)],
            pressure,
            "pressure / kPa",
            "bent at zero pressure",
            values={"offset_pa": 1.2e3},
        ),
        "dead_zone": Scene(
            [ramps((6.0, 0.0), 1.0)],
            pressure,
            "pressure / kPa",
            "still at first",
            values={"threshold_pa": 1e3},
        ),
        "supply_lag": Scene(
            [ramps_then_load()], clock, "time / s", "the load step (right) is followed at once"
        ),
        "viscous_damping": Scene(
            [ramps_then_load()],
            clock,
            "time / s",
            "the load step (right) is delayed too",
            values={"time_s": 0.6},
        ),
        "viscoelastic": Scene(
            [ramps((12.0, 0.0), 12.0, holds_s=90.0)], clock, "time / s", "drift in the hold and after venting"
        ),
        "friction_hysteresis": Scene(
            [ramps((12.0, 7.0, 9.0, 5.0, 12.0, 0.0), rate) for rate in (0.5, 5.0)],
            pressure,
            "pressure / kPa",
            "the same loop slow and fast",
        ),
        "mullins": Scene(
            [ramps((4.0, 0.0, 4.0, 0.0, 8.0, 0.0, 8.0, 0.0, 12.0, 0.0, 12.0, 0.0), 2.0)],
            pressure,
            "pressure / kPa",
            "first loadings lie on the model's line",
            values={"softening": 0.35},
        ),
        "permanent_set": Scene(
            [ramps((4.0, 0.0, 8.0, 0.0, 12.0, 0.0), 4.0, holds_s=4.0)],
            clock,
            "time / s",
            "what stays grows with the largest angle",
            values={"share": 0.12},
        ),
        "gravity_scale": Scene(
            [History.of({"pressure_pa": np.full(61, 4e3)}, base_angles_rad=turns)],
            pitch,
            "pitch of the base / °",
            "the error turns with the base",
            modules=8,
            values={"factor": 1.5},
        ),
        "self_contact": Scene([ramps((14.0, 0.0), 2.0)], pressure, "pressure / kPa", "a kink at one angle"),
        "thermal_softening": Scene(
            [loads(0.0, t) for t in (2.0, 22.0, 42.0)],
            load,
            "load moment / mN·m, at 2, 22 and 42 °C",
            "right at 22 °C",
            values={"loss_per_k": 0.01},
        ),
        "sensor_bias": Scene(
            [ramps((12.0, 0.0), 2.0)],
            pressure,
            "pressure / kPa",
            "the same everywhere",
            values={"bias_rad": 0.05},
        ),
    }


def angles(registry: Registry, scene: Scene, effect: Any | None) -> list[Any]:
    """Sum of joint angles in degrees, as read, in each run."""
    bare = sample_chain(modules=scene.modules, gravity=(0, 0, -9.81 if scene.modules > 1 else 0))
    model = effect.apply(Model(bare)) if effect else Model(bare)
    component = registry.get("physics", "quasistatic")
    engine = component.build(component.config_model()(kind="quasistatic"))
    runs = engine.follow(model.chain, [model.commanded(h) for h in scene.runs])[0]
    read = [model.reported({"angle_rad": run.joint_angles.sum(axis=(1, 2))}) for run in runs]
    return [np.degrees(r["angle_rad"]) for r in read]


def draw(registry: Registry, kind: str, scene: Scene) -> Figure:
    """One picture."""
    component = registry.get("effect", kind)
    values = scene.values or component.example
    effect = component.build(component.config_model().model_validate({"kind": kind, **values}))
    figure = Figure(figsize=(4.6, 2.9), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    for name, present, style in (("with the effect", effect, WITH), ("model", None, WITHOUT)):
        for number, (run, angle) in enumerate(zip(scene.runs, angles(registry, scene, present), strict=True)):
            ax.plot(scene.over(run), angle, label=name if number == 0 else None, **style)
    ax.set_xlabel(scene.label)
    ax.set_ylabel("angle / °")
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
