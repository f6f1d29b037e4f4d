"""Posterior in a study file: written next to the fitted effects, and read back if they are unchanged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.posterior import PosteriorConfig
from pliant.config.study import Study
from pliant.diagnosis.candidates import StudyCandidate
from pliant.diagnosis.posterior import Posterior
from pliant.diagnosis.scatter import ReadingScatter
from pliant.errors import UserError
from pliant.records.design import Array
from pliant.registry.discovery import Registry

# A value of the study and of the block are the same within this share.
SAME = 1e-6
DIGITS, WRITTEN = 7, 12
# Rounded correlations may not be positive definite; smaller eigenvalues are raised to this.
SMALLEST = 1e-9


@dataclass(frozen=True, eq=False)
class KeptPosterior:
    """The stored results of a fit in a study: its posterior, and the scatter of single readings by output."""

    posterior: Posterior
    scatter: Mapping[str, ReadingScatter]


def posterior_block(posterior: Posterior, scatter: Mapping[str, ReadingScatter]) -> PosteriorConfig:
    """Return the block of a study whose effects have the posterior's values."""
    return PosteriorConfig(
        parameters=posterior.names,
        values=tuple(float(f"{value:.{WRITTEN}g}") for value in posterior.values),
        sd=_rounded(posterior.sd),
        correlation=tuple(_rounded(row) for row in posterior.correlation),
        noise={name: _rounded([one.floor])[0] for name, one in scatter.items()},
        left={name: _rounded([one.left])[0] for name, one in scatter.items()},
        freedom=_rounded([posterior.freedom])[0],
    )


def _rounded(numbers: Sequence[float] | Array) -> tuple[float, ...]:
    return tuple(float(f"{number:.{DIGITS}g}") for number in numbers)


def kept_posterior(registry: Registry, study: Study) -> KeptPosterior | None:
    """Return the posterior of a study's `posterior` block; None without one.

    Raises:
        UserError: the block does not match the effects of the study.
    """
    block = study.posterior
    if block is None:
        return None
    kinds = list(dict.fromkeys(name.partition(".")[0] for name in block.parameters))
    if missing := [kind for kind in kinds if kind not in {effect.kind for effect in study.effects}]:
        raise _stale(study, f"is of '{missing[0]}', which is not among the effects")
    forms = [
        effect.kind
        for effect in study.effects
        if any(f"{effect.kind}.{one.name}" in block.parameters for one in effect.form_parameters())
    ]
    candidate = StudyCandidate.among(registry, study.effects, kinds, forms)
    names = [parameter.name for parameter in candidate.parameters]
    if set(names) != set(block.parameters):
        other = next(iter(set(names) ^ set(block.parameters)))
        raise _stale(study, f"and the effects do not have the same parameters ('{other}')")
    order = [block.parameters.index(name) for name in names]
    x, wanted = candidate.present(), np.array(block.values)[order]
    for parameter, here, fitted in zip(candidate.parameters, x, wanted, strict=True):
        now = parameter.value(float(here))
        if abs(now - fitted) > SAME * max(abs(now), abs(fitted)):
            raise _stale(study, f"is of {parameter.name} {fitted:g}, and the effect has {now:g}")
    rates = np.array([p.slope(float(one)) for p, one in zip(candidate.parameters, x, strict=True)])
    spread = np.array(block.sd)[order] / rates
    correlation = _positive(np.array(block.correlation)[np.ix_(order, order)])
    posterior = Posterior(candidate, x, correlation * np.outer(spread, spread), block.freedom)
    outputs = {name: ReadingScatter(block.noise.get(name, 0.0), left) for name, left in block.left.items()}
    return KeptPosterior(posterior, outputs)


def _positive(correlation: Array) -> Array:
    size, vectors = np.linalg.eigh((correlation + correlation.T) / 2.0)
    return np.asarray((vectors * np.maximum(size, SMALLEST)) @ vectors.T)


def _stale(study: Study, why: str) -> UserError:
    return UserError(
        f"the 'posterior' block of study '{study.name}' {why}: bands would be those of another model. Fit again "
        "('pliant extend --refit' writes both), or leave the block out."
    )
