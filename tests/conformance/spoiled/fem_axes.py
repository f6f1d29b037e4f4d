"""Backends whose states of several axes, extensions or tendons are falsified one by one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pliant.interfaces.fem import Held
from pliant.records.fem import FemState
from spoiled.fem import Spoiled, Wrapped, spoils


class MainAxisOnly(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return replace(state, tau=state.tau[[state.main]])


@spoils.by("states_have_all_axes", "tau has shape \\(1,\\)")
class OneEffort(Spoiled):
    """Reports the main axis's effort alone."""

    wrapper = MainAxisOnly


class PolarMoment(Wrapped):
    def rest(self) -> FemState:
        state = self.inner.rest()
        slope = state.dtau_du.copy()
        if len(slope) == 3:
            slope[0, 0] *= 1.5
        return replace(state, dtau_du=slope)


@spoils.by("small_bends_about_all_axes_follow_beam_theory", "stiffness in twist")
class HeldWarping(Spoiled):
    """A tube twice as stiff in twist as any warping allows."""

    wrapper = PolarMoment


class Lopsided(Wrapped):
    def seen(self, state: FemState) -> FemState:
        upper = np.triu(np.ones_like(state.dtau_du), 1)
        return replace(state, dtau_du=state.dtau_du + 1e-3 * np.abs(state.dtau_du).max() * upper)


@spoils.by("slopes_in_all_axes_are_exact", "is not symmetric under pressure")
class BodyFrameMoment(Spoiled):
    """Moments that are not conjugate to the rotation vector."""

    wrapper = Lopsided


class Coupled(Wrapped):
    def seen(self, state: FemState) -> FemState:
        k = len(state.tau)
        return replace(state, dtau_du=state.dtau_du - 5e-4 * (np.ones((k, k)) - np.eye(k)))


@spoils.by("axes_decouple_by_symmetry", "couples axes that symmetry separates")
class SpuriousCoupling(Spoiled):
    """What plane end sections of a whole module would do."""

    wrapper = Coupled


class HoldsAll(Wrapped):
    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        if isinstance(held, Mapping):
            here = dict(zip(self.problem.axes, start.deformation.tolist(), strict=True))
            held = {**here, **held}
        return super().constrained(actuation, held, start)


@spoils.by("axes_that_are_not_held_are_free", "not zero along the axis that is free")
class HoldsEveryAxis(Spoiled):
    """Leaves free axes where they were."""

    wrapper = HoldsAll


class Tolerant(Wrapped):
    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        if isinstance(held, Mapping):
            held = {axis: u for axis, u in held.items() if axis in self.problem.axes}
        return super().constrained(actuation, held, start)


@spoils.by("refuses_unknown_axes", "the axis 'w' was held")
class TakesAnyAxis(Spoiled):
    """Leaves out what it does not know."""

    wrapper = Tolerant


class Strain(Wrapped):
    def seen(self, state: FemState) -> FemState:
        if self.problem.joint != "prismatic":
            return state
        length = self.problem.span_m
        return replace(state, tau=state.tau * length, dtau_du=state.dtau_du * length**2)


@spoils.by("small_extensions_follow_rod_theory", "is not −E A / l")
class StrainForExtension(Spoiled):
    """The strain as a prismatic joint's coordinate."""

    wrapper = Strain


class HalfTravel(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return replace(state, travel=state.travel / 2)


@spoils.by("tendon_works_on_its_travel", "belong to different pieces")
class TravelOfTheHalf(Spoiled):
    """The tendon drawn out of one half."""

    wrapper = HalfTravel
