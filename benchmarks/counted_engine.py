"""A plugin file: the quasi-static engine; each chain that it loads leaves a line in the file $SPRINGS_LOG."""

from __future__ import annotations

import os
import time
from typing import Literal

from benchmarks.solved_log import candidate, note

from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.simulation import QuasistaticSimulation

CONTRACT = 3
DELAY_S = 0.02  # of a candidate, so that kills meet evaluations


class CountedQuasistaticConfig(QuasistaticConfig):
    """The config of `quasistatic` under another kind."""

    kind: Literal["counted_quasistatic"] = "counted_quasistatic"


class CountedQuasistatic(Quasistatic):
    """Statics with a log."""

    def build(self, chain: ChainModel) -> QuasistaticSimulation:
        simulation = super().build(chain)
        load = simulation.apply

        def logged(inputs: Inputs) -> None:
            note(f"begin {os.getpid()} {candidate(chain.joints[-1].offset_m[0], *inputs.actuation.values())}")
            load(inputs)
            time.sleep(DELAY_S)

        setattr(simulation, "apply", logged)  # noqa: B010 - mypy forbids the plain way
        return simulation


@hookimpl
def pliant_components() -> list[Component]:
    """Return the engine."""
    here = (f"{__name__}:CountedQuasistaticConfig", f"{__name__}:CountedQuasistatic")
    return [Component("physics", "counted_quasistatic", *here, "statics with a log", {})]
