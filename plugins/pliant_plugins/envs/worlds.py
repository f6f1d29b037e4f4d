"""Chains that the evidence leaves possible: laws drawn from their error bars, effects from the study's posterior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.api import OpenStudy
from pliant.diagnosis.kept_posterior import kept_posterior
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.pipeline.motion import prepared_model
from pliant.pipeline.simulate import drawn_chains


@dataclass(frozen=True)
class Evidence:
    """What is known of a robot beyond its nominal model.

    Attributes:
        models: drawn chains with the task's loads and the effects applied, maps of inputs included.
        noise_m: standard deviation of a reading of the tip's coordinates, from the posterior's noise; 0 without one.
    """

    models: tuple[Model, ...]
    noise_m: float


def evidence(opened: OpenStudy, count: int, seed: int) -> Evidence:
    """Draw `count` chains.

    Raises:
        UserError: the study has no `posterior`, and its laws state no error.
    """
    study, bench = opened.study, opened.bench
    nominal = prepared_model(bench, study)[0].chain
    kept = kept_posterior(bench.registry, study)
    has_bars = any(law.error is not None for law in nominal.laws)
    if count and kept is None and not has_bars:
        raise UserError(
            f"worlds is {count}, and nothing says how sure the study is: it has no 'posterior' block (pliant extend "
            "and improve write it), and its laws state no error (fitted laws do)."
        )
    varied = [study] * count
    if kept is not None and count:
        posterior = kept.posterior
        varied = [
            study.model_copy(update={"effects": posterior.candidate.configs(x)})
            for x in posterior.draws(count, seed)
        ]
    models = [prepared_model(bench, one)[0] for one in varied]
    if has_bars:
        seeds = np.random.SeedSequence(seed).generate_state(max(count, 1))
        drawn = (drawn_chains(one.chain, 1, int(own))[0] for one, own in zip(models, seeds, strict=False))
        models = [one.with_(chain=chain) for one, chain in zip(models, drawn, strict=True)]
    noise = {} if kept is None else {name: one.floor for name, one in kept.scatter.items()}
    tips = [value for name, value in noise.items() if name.startswith(("tip_", "marker_"))]
    angle = noise.get("angle_rad", 0.0) * nominal.length_m / 2  # of a bend that is even along the chain
    return Evidence(tuple(models), max([*tips, angle]))
