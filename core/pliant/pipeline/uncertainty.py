"""From the laws' error bars to the tip: the task again, with laws as likely as those that were fitted.

All modules of one design share one law, and so one error: draws differ by design, not by module. Draws of several
designs are independent of each other, also where one meta-model made their laws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.uncertainty import UncertaintyConfig
from pliant.errors import UserError
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.physics import PhysicsConfig
from pliant.interfaces.task import TaskConfig
from pliant.mechanics.law_draws import draws
from pliant.mechanics.shared_actuation import shared, unshared
from pliant.pipeline.simulate import ChainSource, check_capabilities, run_task
from pliant.pipeline.workbench import Workbench, content
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.records.rollout import TaskResult
from pliant.store.store import Artifact


def uncertainty_stage(
    bench: Workbench,
    source: ChainSource,
    physics: PhysicsConfig,
    task: TaskConfig,
    effects: Sequence[EffectConfig],
    config: UncertaintyConfig,
) -> Artifact:
    """Run the task with `config.samples` drawn chains; the artifact's value is the dict of `spread`.

    Raises:
        UserError: no law of the chain states an error.
    """
    backend, built = bench.build("physics", physics), bench.build("task", task)
    built_effects = [bench.build("effect", effect) for effect in effects]
    check_capabilities(backend, source.chain, physics.kind)
    drawn = drawn_chains(source.chain, config.samples, config.seed)

    def compute(partial: Path) -> dict[str, Any]:
        bar = bench.progress.begin("drawn laws", len(drawn))
        results = []
        try:
            for chain in drawn:
                results.append(run_task(backend, built, built_effects, chain))
                bar.advance()
        finally:
            bar.finish()
        return spread(results, config.level)

    components = [
        *source.components,
        bench.component("physics", physics),
        bench.component("task", task),
        *(bench.component("effect", effect) for effect in effects),
    ]
    settings = {
        **source.config,
        "physics": content(physics),
        "task": content(task),
        "effects": [content(effect) for effect in effects],
        "uncertainty": content(config),
    }
    modules = ["pliant.pipeline.uncertainty", "pliant.pipeline.chain"]
    return bench.make(
        "uncertainty",
        compute,
        components=components,
        modules=modules,
        config=settings,
        inputs=source.inputs,
    )


def drawn_chains(chain: ChainModel, count: int, seed: int) -> list[ChainModel]:
    """Chains whose laws are drawn from their error bars; laws that state no error stay.

    Raises:
        UserError: no law states one.
    """
    if all(law.error is None for law in chain.laws):
        raise UserError(
            "'uncertainty' needs a law with an error bar, and the laws of this chain state none (laws of given "
            "coefficients have none); fit the law to data or leave the block out."
        )
    # a stream for each law, so that no seed's laws share the draws of another's
    inside = list(dict.fromkeys(unshared(law)[0] for law in chain.laws))
    seeds = np.random.SeedSequence(seed).generate_state(len(inside))
    drawn = {law: _draws(law, count, int(own)) for law, own in zip(inside, seeds, strict=True)}
    return [chain.with_(laws=tuple(_as(law, drawn, i) for law in chain.laws)) for i in range(count)]


def _as(law: JointLaw, drawn: Mapping[JointLaw, Sequence[JointLaw]], number: int) -> JointLaw:
    """A draw in the place of a law; segments that get different shares of the actuation have one law, and one error."""
    inside, share = unshared(law)
    return shared(drawn[inside][number], share)


def _draws(law: JointLaw, count: int, seed: int) -> tuple[JointLaw, ...]:
    return (law,) * count if law.error is None else draws(law, count, seed)


def spread(results: Sequence[TaskResult], level: float) -> dict[str, Any]:
    """What drawn laws came to.

    `tips_m` (n, 3) of the runs that settled; `tip_low_m`, `tip_high_m` (3,) the interval that holds `level` of them
    in each coordinate; `tip_radius_m` of the ball about their mean `tip_mean_m` that holds as many; `metrics`: name
    → low and high of each number that the task measures; `failed`: runs that did not settle.
    """
    settled = [r for r in results if r.final.converged and not r.not_reached]
    sides = [(1 - level) / 2, (1 + level) / 2]
    tips = np.array([r.final.tip_m for r in settled]).reshape(-1, 3)
    told: dict[str, Any] = {
        "level": level,
        "samples": len(results),
        "failed": len(results) - len(settled),
        "tips_m": tips,
    }
    if not settled:
        return told
    low, high = np.quantile(tips, sides, axis=0)
    mean = tips.mean(axis=0)
    radius = float(np.quantile(np.linalg.norm(tips - mean, axis=1), level))
    told |= {"tip_mean_m": mean, "tip_low_m": low, "tip_high_m": high, "tip_radius_m": radius}
    told["metrics"] = {
        name: _interval(values, sides) for name, values in _numbers([r.metrics for r in settled]).items()
    }
    return told


def _numbers(metrics: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    """Metrics that are one number in every run."""
    found = {}
    for name in metrics[0]:
        values = [one.get(name) for one in metrics]
        if all(isinstance(v, float | int) and not isinstance(v, bool) for v in values):
            found[name] = np.array(values, float)
    return found


def _interval(values: Array, sides: Sequence[float]) -> dict[str, float]:
    low, high = np.quantile(values, list(sides))
    return {"low": float(low), "high": float(high), "sd": float(values.std(ddof=1))}
