"""Policies trained on the posterior of a recording, tested on hidden robots of the evidence bed, and baselines.

python -m benchmarks.trained_policy [--quick]    prints, writes benchmarks/out/trained_policy.json and its page's table

Twenty truths of two hidden effects, of the forms that judged sets have. Each is recorded on the bed's bench and
diagnosed; `pliant extend` fits a model of that robot for every credible explanation, and a policy is trained in robots
drawn from their posteriors. Then two segments of such modules lead the tip along a circle, with the truth in the bed's
MuJoCo engine. The tip is read 50 ms late, with the noise of the recording. Errors are root mean squares of the true tip
over the circle. Finished truths are stored in benchmarks/out/trained_policy, and the next call continues after them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from benchmarks.evidence.robots import ROBOTS, TIPS
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.evidence.truths import Truth, draw
from benchmarks.output import OUT, ROOT, Bar, component, make_parser, read, write
from benchmarks.truth_robot import TruthSimulation
from scipy.optimize import least_squares

from benchmarks import pages
from pliant import api
from pliant.diagnosis.kept_posterior import posterior_block
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.envs.baselines import BASELINES, Controller, Nominal, score
from pliant_plugins.envs.control import MeasuredEnv, MeasuredTrackEnv, World
from pliant_search.envs.trained import FEATURES, Episode, LinearResidual, train

HIDDEN, RECORDED, TRUTHS = "viscous_damping+stiffness", ROBOTS["chain"], 20
CREDIBLE = 0.05  # the least probability of an explanation that robots are drawn from
TRAINED_IN, CANDIDATES = 6, 72
LOOKED_AT = 4  # the first truths: seen when the number of candidates was chosen, so they are not judged
TRAINING_SEED, TEST_SEED = 1, 2
BAR = 1.5
KEPT = OUT / "trained_policy"
LOG, PAGE = KEPT / "truths.jsonl", ROOT / "docs" / "train_a_policy.md"
FIRST, SECOND = "trained on the posterior", "trained on the nominal model"
MEAN, MODEL = "most probable model", "nominal model"
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
SETTINGS: dict[str, Any] = {"delay_s": 0.05, "episode_s": TO_IT_S + WAIT_S + TURN_S}
PHYSICS = {"kind": "mujoco", "timestep": "10 ms", "joint_damping": 0}


class Explanation(NamedTuple):
    """Kinds of effects, their probability, and the study of the robot with them, by name."""

    kinds: tuple[str, ...]
    probability: float
    study: str


class HiddenRobot(MeasuredTrackEnv):
    """The robot of a study on the bench, whose only world is a truth.

    Args:
        study: the study given to the controllers.
        body: the chain without effects.
        truth: of every joint.
    """

    def __init__(self, study: Path, body: ChainModel, truth: Truth, **settings: Any) -> None:
        self._body, self._truth = body, truth
        super().__init__(study, **settings)

    def _build(self) -> None:
        super()._build()
        self._models = (self._model,)

    def _made(self, number: int) -> World:
        if number not in self._worlds:
            robot = TruthSimulation(self._body, self._truth)
            self._worlds[number] = World(robot, robot.snapshot(), self.nominal.statics, self.nominal.straight)
        return self._worlds[number]


def main() -> None:
    quick = make_parser(__doc__, "two truths and a short training").parse_args().quick
    count, candidates = (2, 6) if quick else (TRUTHS, CANDIDATES)
    KEPT.mkdir(parents=True, exist_ok=True)
    done = {one["seed"]: one for one in kept() if one["candidates"] == candidates}
    judged = range(LOOKED_AT + 1, LOOKED_AT + count + 1)
    for seed in judged:
        if seed not in done:
            gains = next((one["nominal_gains"] for one in done.values()), None)
            done[seed] = measured(KEPT / f"truth_{seed}", seed, candidates, gains)
            with LOG.open("a") as log:
                log.write(json.dumps(done[seed]) + "\n")
            report([done[one] for one in judged if one in done], publish=not quick)
    report([done[one] for one in judged], publish=not quick)


def kept() -> list[dict[str, Any]]:
    """Return truths of earlier calls."""
    return [json.loads(line) for line in LOG.read_text().splitlines()] if LOG.exists() else []


def measured(folder: Path, seed: int, candidates: int, gains: list[float] | None) -> dict[str, Any]:
    """Return errors of all controllers in one truth, mm, and its diagnosis.

    Args:
        folder: for the recording and its studies; what an earlier call left there is taken.
        seed: of the truth.
        candidates: rules that a training tries.
        gains: of the policy trained on the nominal model, without a recording; None: train it here.
    """
    spec = SetSpec(HIDDEN, seed, "functional", RECORDED.name, "rates", "judged")
    known, started = diagnosed(folder, spec), time.process_time()
    bare, found = folder / "robot.yaml", [Explanation(*one) for one in known["explanations"]]
    mean = folder / found[0].study if found else bare
    mean_env = environment(mean)
    noise = mean_env.noise_m or known["noise_m"]
    bare_env = environment(bare, noise_m=noise)
    model, prior = Nominal(mean_env), Nominal(bare_env)
    options: dict[str, Any] = {
        "path_m": circle(model, mean_env.control_s),
        "skip": round((TO_IT_S + WAIT_S) / mean_env.control_s),
    }
    truth = draw(spec.kind, spec.engine, RECORDED, spec.split, spec.generator())
    hidden = truth.at(*known["label"]["strengths"])
    test = HiddenRobot(mean, bare_env.chain, hidden, noise_m=noise, **SETTINGS)
    naive = [Episode(bare_env, k, -1) for k in range(TRAINED_IN)]
    nominal = LinearResidual(bare_env, np.zeros(len(FEATURES)) if gains is None else np.array(gains), prior)
    if gains is None:
        trained_in(nominal, naive, candidates, options)
    policy = LinearResidual(mean_env, np.zeros(len(FEATURES)), model)
    total = sum(one.probability for one in found)
    drawn = [e for one in found for e in robots(folder, one, total, TRAINED_IN, TRAINING_SEED)]
    reached = trained_in(policy, drawn or naive, candidates, options)
    controllers: dict[str, Controller] = {FIRST: policy, SECOND: nominal}
    for name, kind in BASELINES.items():
        controllers[f"{name}, {MEAN}"] = kind(mean_env, model=model)
        controllers[f"{name}, {MODEL}"] = kind(bare_env, model=prior)
    episode = range(TEST_SEED, TEST_SEED + 1)
    errors = {
        name: 1e3 * float(score(test, controller, episode, world=0, **options)[0])
        for name, controller in controllers.items()
    }
    label = {key: known["label"][key] for key in ("forms", "strengths", "snr_alone", "drawn")}
    print(f"truth {seed} ({', '.join(label['forms'])}): {known['verdict']}", flush=True)
    print("  " + ", ".join(f"{name} {error:.2f} mm" for name, error in errors.items()), flush=True)
    return {
        "seed": seed,
        "candidates": candidates,
        "hidden": label,
        "verdict": known["verdict"],
        "explanations": [[list(one.kinds), one.probability] for one in found],
        "noise_mm": 1e3 * noise,
        "in_training_mm": 1e3 * reached,
        "gains": policy.gains.tolist(),
        "nominal_gains": nominal.gains.tolist(),
        "errors_mm": errors,
        "cpu_s": known["cpu_s"] + time.process_time() - started,
    }


def trained_in(
    policy: LinearResidual, episodes: list[Episode], candidates: int, options: dict[str, Any]
) -> float:
    """Leave the policy with the gains that CMA-ES finds in these episodes; the mean error of the worst of them, m."""
    optimizer = component("optimizer", "cmaes")
    return float(
        train(policy, episodes, candidates=candidates, optimizer=optimizer, **options).errors_m.min()
    )


def report(done: list[dict[str, Any]], publish: bool) -> None:
    """Print medians and worst truths, and write them; with `publish` into the page too."""
    names = list(done[0]["errors_mm"])
    errors = {name: [one["errors_mm"][name] for one in done] for name in names}
    for name, values in errors.items():
        print(f"{name}: median {np.median(values):.2f}, worst {max(values):.2f} mm")
    ratio = max(errors[SECOND]) / max(errors[FIRST])
    what = f"worst error of {len(done)} truths, {SECOND} over {FIRST}"
    result = {"errors_mm": errors, "worst_ratio": ratio, "truths": done}
    write("trained_policy", result, [Bar(what, ratio, BAR, "×", False)])
    if publish:
        text = pages.rendered(PAGE.read_text(), pages.marks("policy"), TABLES, read("trained_policy"))
        PAGE.write_text(text)


def _table(result: pages.Result) -> Iterator[str]:
    """Return median and worst error of each controller."""

    def row(name: str) -> tuple[str, ...]:
        values = result["errors_mm"][name]
        return (name, f"{np.median(values):.1f} mm", f"{max(values):.1f} mm")

    return pages.table("controller | median | worst", map(row, result["errors_mm"]))


def _ratio(result: pages.Result) -> Iterator[str]:
    """Yield a comparison of the two trained policies in the worst of the truths."""
    errors, truths = result["errors_mm"], result["truths"]
    pairs = np.array(errors[SECOND]) / np.array(errors[FIRST])
    named = sum(one["verdict"] in ("missing_effect", "ambiguous") for one in truths)
    yield (
        f"{len(truths)} of {TRUTHS} truths have been run; in {named} of them the diagnosis found effects. In the worst "
        f"the policy trained on the nominal model misses by {result['worst_ratio']:.2f} × what the one trained on the "
        f"posterior does (1.5 was asked), truth by truth by {pairs.min():.2f} to {pairs.max():.2f} ×, "
        f"{np.median(pairs):.2f} × "
        "in the median."
    )


TABLES: pages.Tables = {"errors": _table, "ratio": _ratio}


def diagnosed(folder: Path, spec: SetSpec) -> dict[str, Any]:
    """Diagnose a recording of one finger; return the verdict and the credible explanations, the most probable first.

    Their studies, and the one of the model before the recording (`robot.yaml`), are written to the folder.
    """
    kept = folder / "found.json"
    if kept.exists():
        found: dict[str, Any] = json.loads(kept.read_text())
        return found
    started = time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    made = make_set(spec, "finger")
    (folder / "finger.csv").write_text(made.csv)
    (folder / "finger.yaml").write_text(made.study + "measurements: {file: finger.csv}\n")
    opened = api.open_study(folder / "finger.yaml", store=folder / "store")
    judged = api.diagnose(opened).judgement
    left = []
    for number, (kinds, probability) in enumerate(judged.probability.items()):
        if probability < CREDIBLE or not kinds or "unknown" in kinds:
            continue
        extension = api.extend(opened, kinds)
        block = posterior_block(extension.posterior, extension.scatter).model_dump(mode="json")
        effects = [effect.model_dump(mode="json") for effect in extension.effects]
        robot(folder / f"robot_{number}.yaml", opened, effects=effects, posterior=block)
        left.append(Explanation(kinds, probability, f"robot_{number}.yaml"))
    robot(folder / "robot.yaml", opened)
    said = {
        "verdict": judged.verdict,
        "explanations": sorted(left, key=lambda one: -one.probability),
        "noise_m": max(made.sigma[name] for name in TIPS),
        "label": made.label,
        "cpu_s": time.process_time() - started,
    }
    kept.write_text(json.dumps(said, default=float))
    return said


def robot(path: Path, opened: api.OpenStudy, **found: Any) -> Path:
    """Write the study of two segments of the finger's modules; JSON is YAML."""
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
    """Return the robot of a study on the bench."""
    return MeasuredTrackEnv(study, **SETTINGS, **settings)


def robots(folder: Path, one: Explanation, total: float, count: int, seed: int) -> list[Episode]:
    """Return episodes in robots drawn from an explanation, its share of `count`."""
    mine = round(count * one.probability / total)
    env = environment(folder / one.study, worlds=mine, world_seed=seed) if mine else None
    return [Episode(env, 100 * seed + k, k) for k in range(mine)] if env is not None else []


def circle(model: Nominal, control_s: float) -> Array:
    """Return (steps + 1, 3) targets: the mean robot's tip path to the circle, then a circle seen from above."""
    rate = round(1 / control_s)
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
