"""A policy trained on what evidence leaves possible, beside one trained on the nominal model, PI, MPC and open loop.

python -m benchmarks.trained_policy [--quick]    prints, and writes benchmarks/out/trained_policy.json

A finger with two hidden effects, drawn as the calibration sets of the evidence bed hide them, is recorded on the bed's
bench and diagnosed. Two segments of such modules then lead the tip along a circle. What `pliant extend` finds of each
explanation that `pliant diagnose` leaves credible is a model of that robot; robots are drawn from their posteriors,
some to train in, 20 others to be tested in. The tip is read 50 ms late, with the noise of the recording. Errors are
root mean squares of the true tip over the circle.
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.output import Bar, component, parser_of, write
from scipy.optimize import least_squares

from pliant import api
from pliant.diagnosis.kept_posterior import block_of
from pliant.records.design import Array
from pliant_plugins.envs.baselines import BASELINES, Nominal, score
from pliant_plugins.envs.control import MeasuredEnv
from pliant_plugins.envs.registration import register
from pliant_plugins.envs.trained import FEATURES, Episode, LinearResidual, train

RECORDED = SetSpec("viscous_damping+stiffness", 1, "functional", "chain", "rates", "calibration")
CREDIBLE = 0.05  # the least probability of an explanation that robots are drawn from
TRAINED_IN, TESTED_IN, CANDIDATES = 6, 20, 36
TRAINING_SEED, TEST_SEED = 1, 2
BAR = 1.5
# The circle: centre by shares of both pressures, radius; the way there, a wait, and one turn.
CENTRE, RADIUS_M = (0.4, 0.2), 0.015
TO_IT_S, WAIT_S, TURN_S = 1.0, 1.0, 4.0
CHAIN = {
    "module_length": "11 mm",
    "module_mass": "1.6 g",
    "module_radius": "7 mm",
    "segments": [
        {"modules": 4, "actuators": [{"input": "pressure_1_pa", "sign": 1}]},
        {"modules": 8, "rotation": "90 deg", "actuators": [{"input": "pressure_2_pa", "sign": 1}]},
    ],
}
PHYSICS = {"kind": "mujoco", "timestep": "10 ms", "joint_damping": 0}


class Explanation(NamedTuple):
    """Kinds of effects, their probability, and the study of the robot with them."""

    kinds: tuple[str, ...]
    probability: float
    study: Path


def main() -> None:
    quick = parser_of(__doc__, "a short training").parse_args().quick
    register()
    with tempfile.TemporaryDirectory() as place:
        print(json.dumps(measured(Path(place), 20 if quick else CANDIDATES), indent=1))


def measured(folder: Path, candidates: int) -> dict[str, Any]:
    """Errors of all controllers in the robots of the test, mm."""
    bare, found = diagnosed(folder)
    total = sum(one.probability for one in found)
    for one in found:
        print(f"{' and '.join(one.kinds)}: {100 * one.probability / total:.0f} % of the robots")
    mean_env = environment(found[0].study)
    bare_env = environment(bare, noise_m=mean_env.noise_m)
    training = [e for one in found for e in robots(one, total, TRAINED_IN, TRAINING_SEED)]
    tests = [e for one in found for e in robots(one, total, TESTED_IN, TEST_SEED)]
    options = {"path_m": circle(mean_env), "skip": round((TO_IT_S + WAIT_S) / mean_env.control_s)}
    print(
        f"{len(training)} robots to train in, {len(tests)} to be tested in; noise {1e3 * mean_env.noise_m:.2f} mm"
    )
    trained = {
        "trained on the posterior": (mean_env, training),
        "trained on its mean": (mean_env, [Episode(mean_env, k, -1) for k in range(len(training))]),
        "trained on the nominal model": (bare_env, [Episode(bare_env, k, -1) for k in range(len(training))]),
    }
    errors: dict[str, Array] = {}

    def tested(name: str, controller: Any) -> None:
        errors[name] = 1e3 * np.array(
            [score(env, controller, range(k, k + 1), world=world, **options)[0] for env, k, world in tests]
        )
        print(f"{name}: median {np.median(errors[name]):.2f}, worst {errors[name].max():.2f} mm", flush=True)

    for name, (env, episodes) in trained.items():
        started = time.process_time()
        policy = LinearResidual(env, np.zeros(len(FEATURES)))
        optimizer = component("optimizer", "cmaes")
        done = train(policy, episodes, candidates=candidates, optimizer=optimizer, **options)
        told = ", ".join(f"{gain} {value:.2f}" for gain, value in zip(FEATURES, policy.gains, strict=True))
        spent = time.process_time() - started
        print(
            f"{name}: {1e3 * done.errors_m[0]:.2f} → {1e3 * done.errors_m.min():.2f} mm in {spent:.0f} s ({told})"
        )
        tested(name, policy)
    for name, kind in BASELINES.items():
        tested(f"{name}, mean of the posterior", kind(mean_env))
        tested(f"{name}, nominal model", kind(bare_env))
    worst = errors["trained on the nominal model"].max() / errors["trained on the posterior"].max()
    bar = Bar(
        "worst error, trained on the nominal model over trained on the posterior", worst, BAR, "×", False
    )
    result = {"errors_mm": {name: values.tolist() for name, values in errors.items()}, "worst_ratio": worst}
    write("trained_policy", result, [bar])
    return {name: [float(np.median(v)), float(v.max())] for name, v in errors.items()}


def diagnosed(folder: Path) -> tuple[Path, list[Explanation]]:
    """The study of the robot by the model as it was, and those of what a recording of one finger leaves credible."""
    made = make_set(RECORDED, "finger")
    (folder / "finger.csv").write_text(made.csv)
    (folder / "finger.yaml").write_text(made.study + "measurements: {file: finger.csv}\n")
    opened = api.open_study(folder / "finger.yaml", store=folder / "store")
    judged = api.diagnose(opened).judgement
    print(f"hidden: {' and '.join(made.label['kinds'])}; diagnosed: {judged.verdict}")
    found = []
    for number, (kinds, probability) in enumerate(judged.probability.items()):
        if probability < CREDIBLE or not kinds or "unknown" in kinds:
            continue
        extension = api.extend(opened, kinds)
        values = ", ".join(
            f"{name} {value:.4g} ± {sd:.2g}"
            for name, value, sd in zip(
                extension.posterior.names, extension.posterior.values, extension.posterior.sd, strict=True
            )
        )
        print(f"{100 * probability:.0f} % {' and '.join(kinds)}: {values}")
        block = block_of(extension.posterior, extension.scatter).model_dump(mode="json")
        effects = [effect.model_dump(mode="json") for effect in extension.effects]
        study = robot(folder / f"robot_{number}.yaml", opened, effects=effects, posterior=block)
        found.append(Explanation(kinds, probability, study))
    return robot(folder / "robot.yaml", opened), found


def robot(path: Path, opened: api.OpenStudy, **found: Any) -> Path:
    """The study of two segments of the finger's modules; JSON is YAML."""
    law = opened.study.surrogate
    assert law is not None
    said = {
        "pliant": 1,
        "name": path.stem,
        "surrogate": law.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        | {"kind": law.kind},
        "chain": CHAIN,
        "physics": PHYSICS,
        "task": {"kind": "free_bending", "pressure": "15 kPa"},
        **found,
    }
    path.write_text(json.dumps(said))
    return path


def environment(study: Path, **settings: Any) -> MeasuredEnv:
    """The robot of a study on the bench."""
    seconds = TO_IT_S + WAIT_S + TURN_S
    env: Any = gymnasium.make("pliant/Track-v0", study=study, delay_s=0.05, episode_s=seconds, **settings)
    found: MeasuredEnv = env.unwrapped
    return found


def robots(one: Explanation, total: float, count: int, seed: int) -> list[Episode]:
    """Episodes in robots drawn from an explanation, its share of `count`."""
    mine = round(count * one.probability / total)
    env = environment(one.study, worlds=mine, world_seed=seed) if mine else None
    return [Episode(env, 100 * seed + k, k) for k in range(mine)] if env is not None else []


def circle(env: MeasuredEnv) -> Array:
    """(steps + 1, 3) targets: where the mean robot's tip settles on the way there, then seen from above a circle."""
    model, rate = Nominal(env), round(1 / env.control_s)
    centre = model.tip_m(np.array(CENTRE))[:2]
    turns = 2 * np.pi * np.arange(round(TURN_S * rate) + 1) / round(TURN_S * rate)
    shares = np.array(CENTRE)
    on_it = []
    for place in centre + RADIUS_M * np.stack([np.cos(turns), np.sin(turns)], axis=1):
        fit = least_squares(
            lambda x, to=place: 1e3 * (model.tip_m(x)[:2] - to), shares, bounds=(0.0, 1.0), diff_step=1e-3
        )
        assert fit.cost < 1e-6, "the circle leaves what the robot reaches"
        shares = fit.x
        on_it.append(shares)
    way = np.linspace(0.0, 1.0, round(TO_IT_S * rate), endpoint=False)[:, None] * on_it[0]
    wait = np.tile(on_it[0], (round(WAIT_S * rate), 1))
    return np.array([model.tip_m(one) for one in np.concatenate([way, wait, on_it])])


if __name__ == "__main__":
    main()
