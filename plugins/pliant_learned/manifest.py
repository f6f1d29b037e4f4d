"""The residual model of `pliant diagnose` and `pliant improve --learned`; nothing that fits is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.hookspecs import hookimpl
from pliant.registry.residual_model import ResidualModel

CONTRACT = 3


@hookimpl
def pliant_residual_models() -> Iterable[ResidualModel]:
    """Return the smooth curve over one or two covariates."""
    return [ResidualModel("curve", "pliant_learned.learning:learn")]
