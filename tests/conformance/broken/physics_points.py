"""Engines that lose loads at points, cases of a batch, derivatives or files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from broken.physics import Engine, broken_by, variants
from pliant.interfaces.physics import Capabilities
from pliant.records.rollout import Inputs, PointForce, Sensitivity
from pliant.testing.stand_ins import StandInSimulation
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig


@broken_by("point_forces_act_where_they_say", "unbalanced effort")
class AtOrigins(StandInSimulation):
    """Point forces act at the origins of bodies."""

    def apply(self, inputs: Inputs) -> None:
        super().apply(replace(inputs, forces=tuple(replace(f, point_m=np.zeros(3)) for f in inputs.forces)))


@broken_by("cords_pull_toward_their_pulleys", "keeps its first direction")
class Straight(StandInSimulation):
    """Cords keep the direction that they have on the straight chain."""

    def apply(self, inputs: Inputs) -> None:
        super().apply(replace(inputs, cords=()))
        pose = self.statics.geometry.forward(0.0 * self.q)
        first = self.statics.acting(pose, replace(self.applied, cords=inputs.cords, forces=()))
        dead = tuple(
            PointForce(cord.body, cord.point_m, acting.force_n)
            for cord, acting in zip(inputs.cords, first, strict=True)
        )
        self.applied = replace(self.applied, forces=(*self.applied.forces, *dead))


@broken_by("long_cords_are_dead_forces", "under a long cord")
class Halved(StandInSimulation):
    """Takes a cord for a loop of which both strands pull."""

    def apply(self, inputs: Inputs) -> None:
        super().apply(replace(inputs, cords=tuple(c.scaled(0.5) for c in inputs.cords)))


@broken_by("points_load_spherical_joints", "not mapped")
class PlanarPoints(StandInSimulation):
    """Loads at points reach hinges only."""

    def apply(self, inputs: Inputs) -> None:
        if self.chain.laws[0].joint == "spherical":
            inputs = replace(inputs, forces=(), cords=())
        super().apply(inputs)


class Batcher(Engine):
    """Batches of the quasi-static engine."""

    capabilities = Capabilities(("revolute",), dynamic=False, batch=True, gradients=True)

    def settle_batch(self, cases):
        return Quasistatic(QuasistaticConfig()).settle_batch(cases)


@variants.by("batches_settle_as_one_by_one", "of case 1 of a batch")
class Shuffled(Batcher):
    """Answers in the order in which workers finish."""

    def settle_batch(self, cases):
        return super().settle_batch(cases)[::-1]


@variants.by("batches_roll_as_one_by_one", "of sample 1 of a rollout")
class StartsBent(Batcher):
    """Rollouts forget their first sample."""

    def rollout_batch(self, runs):
        return tuple(
            replace(r, markers_m=np.roll(r.markers_m, 1, axis=0)) for r in super().rollout_batch(runs)
        )


class PerKilopascal(StandInSimulation):
    """Derivatives of the quasi-static engine, in its own unit of pressure."""

    def sensitivity(self) -> Sensitivity:
        with Quasistatic(QuasistaticConfig()).build(self.chain) as inner:
            loads = self.applied
            inner.apply(Inputs(loads.actuation, loads.tip_force_n, loads.moment_n_m))
            inner.settle()
            good = inner.sensitivity()
        angles = {**good.joint_angles, "pressure_pa": 1e3 * good.joint_angles["pressure_pa"]}
        return replace(good, joint_angles=angles)


@variants.by("sensitivities_are_differences", "d joint_angles / d pressure_pa")
class Kilopascals(Batcher):
    """Derivatives per kilopascal."""

    simulation = PerKilopascal


@variants.by("exports_a_file", "missing or empty")
class ForgetsToWrite(Engine):
    """Names a file that it did not write."""

    capabilities = Capabilities(("revolute",), dynamic=False, export="mjcf")

    def export(self, chain, path, looks=None):
        return (path,)
