"""The quasi-static engine: every state is an equilibrium under the present inputs."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, ClassVar

from pliant.interfaces.physics import (
    Capabilities,
    Case,
    PhysicsBackend,
    Run,
    Variation,
    roll_each,
    settle_each,
)
from pliant.interfaces.simulation import SceneSimulation
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Rollout
from pliant.records.scene import Scene
from pliant_plugins.physics.quasistatic.among_obstacles import StaticScene
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.newton import (
    NewtonOptions,
    Responder,
    Solver,
)
from pliant_plugins.physics.quasistatic.simulation import QuasistaticSimulation, newton_options
from pliant_plugins.physics.stepping import Paths, step_through

if TYPE_CHECKING:
    from pliant_plugins.physics.quasistatic.compiled_solver import Packs
    from pliant_plugins.physics.quasistatic.histories import Follower

# Cases that a thread takes at a time.
CASES_AT_ONCE = 32


class Quasistatic(PhysicsBackend):
    """Statics by Newton's method with the analytic stiffness of `pliant.mechanics.statics`."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic", "extensible"),
        dynamic=False,
        gradients=True,
        threads=True,
    )
    config: QuasistaticConfig

    def __init__(self, config: QuasistaticConfig) -> None:
        super().__init__(config)
        self._follower: Follower | None = None
        self._packs: Packs | None = None

    def build(self, chain: ChainModel) -> QuasistaticSimulation:
        return QuasistaticSimulation(chain, self.config, *self._compiled(chain))

    def _compiled(self, chain: ChainModel) -> tuple[Solver | None, Callable[[], Responder] | None]:
        """Return the compiled methods; None for chains with law terms or laws that cannot be compiled."""
        if chain.terms or (self._packs is None and any(law.scalar() is None for law in chain.laws)):
            return None, None
        from pliant_plugins.physics.quasistatic import compiled_solver as compiled  # numba takes a second

        packs = self._packs = self._packs or compiled.Packs()
        options = newton_options(chain, self.config)
        solver = compiled.compiled_solver(chain, options, packs)
        return solver, (lambda: compiled.responder(chain, options, packs)) if solver else None

    def build_static_scene(self, scene: Scene) -> SceneSimulation:
        """Return arms in equilibrium among fixed obstacles, without friction; see `StaticSceneBackend`."""
        return StaticScene(scene, self.config)

    def effort_tolerance(self) -> float:
        """Return the config's."""
        return self.config.tolerance

    def settle_batch(self, cases: Sequence[Case]) -> tuple[Equilibrium, ...]:
        """Settle each chain from its straight state, on all cores: compiled loops run in parallel."""
        cores = os.cpu_count() or 1
        size = min(CASES_AT_ONCE, -(-len(cases) // cores)) or 1
        parts = [cases[k : k + size] for k in range(0, len(cases), size)]
        with ThreadPoolExecutor(cores) as pool:
            return tuple(itertools.chain(*pool.map(self._settle_part, parts)))

    def _settle_part(self, cases: Sequence[Case]) -> list[Equilibrium]:
        """Settle together if chains can be packed and the direct method converges, else one after another."""
        from pliant_plugins.physics.quasistatic import batch, compiled_solver  # numba takes a second

        config = self.config
        packs = self._packs = self._packs or compiled_solver.Packs()
        options = NewtonOptions(config.tolerance, config.max_iterations, config.max_turn)
        together = batch.settle_together(cases, packs.laws, options)
        return [together.get(k) or settle_each(self, [case])[0] for k, case in enumerate(cases)]

    def rollout_batch(self, runs: Sequence[Run]) -> tuple[Rollout, ...]:
        return roll_each(self, runs)

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        spatial = chain.laws[0].joint != "revolute"
        if (spatial or not histories) and any(law.unwrap()[0].scalar() is None for law in chain.laws):
            return None
        if not histories and chain.terms:
            return None
        if histories:
            from pliant_plugins.physics.quasistatic.kernel import is_compiled  # numba takes a second

            compiled = is_compiled(spatial)
        else:
            from pliant_plugins.physics.compiled import is_cached

            compiled = is_cached("equilibrium", "settle")
        if compiled:
            return None
        return "compiling the simulation, about twenty seconds; this happens once after an installation."

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> Paths:
        """Follow histories in a compiled loop; laws that cannot be compiled are stepped, with finite differences."""
        if self._follower is None:
            from pliant_plugins.physics.quasistatic.histories import Follower  # numba takes a second

            self._follower = Follower(self.config)
        if all(self._follower.takes(one) for one in (chain, *(v.chain for v in towards))):
            return self._follower.follow(chain, histories, towards)
        return step_through(self.build, chain, histories, towards, self.config.longest_step_s)
