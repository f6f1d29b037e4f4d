"""How hard the runs of the menu drive and load: as hard as the measurement did, or as the law allows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.measurement import Measurement

# Where no load was measured, loads are this share of the torque (or force) at the largest actuation.
LOAD_OF_PEAK = 0.15
# An input that was driven to less than this share of the largest was not driven.
DRIVEN = 0.05


@dataclass(frozen=True, eq=False)
class BenchScale:
    """What a bench did, or may do, at most; and the conditions in which it stood.

    Attributes:
        chain: the chain that is driven.
        top: largest value of each input, SI; 0 for one that is not driven.
        load: (4,) the load at share 1: end moment in N·m, then the force at the tip in N, world frame.
        temperature_c, base_angles_rad, payload_kg: conditions of a plain run.
        specimen: the body that was measured last; empty without one.
    """

    chain: ChainModel
    top: Mapping[str, float]
    load: Array
    temperature_c: float = REFERENCE_TEMPERATURE_C
    base_angles_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    payload_kg: float | None = None
    specimen: str = ""

    @staticmethod
    def of_measurement(chain: ChainModel, measurement: Measurement) -> BenchScale:
        """The largest actuation and load of the measurement; a share of the law's torque where it has no load."""
        histories = [run.history for run in measurement.runs]
        last = histories[-1]
        top = {name: max(_largest(h.actuation[name]) for h in histories) for name in last.actuation}
        moment = max(_largest(h.moment_n_m) for h in histories)
        force = _strongest(histories)
        load = np.array([moment, *(np.zeros(3) if moment > 0.0 else force)])
        payload = last.payload_kg
        return BenchScale(
            chain,
            top,
            load if load.any() else _default_load(chain, top),
            float(np.median(last.temperature_c)),
            tuple(float(angle) for angle in histories[0].base_angles_rad[0]),  # type: ignore[arg-type]
            None if payload is None else float(payload[0]),
            last.specimen,
        )

    @staticmethod
    def of_chain(chain: ChainModel, largest: float | None = None) -> BenchScale:
        """The end of the laws' domain, or `largest` for every input.

        Raises:
            UserError: the law states no domain, and no largest value is given.
        """
        ends = [float(np.max(chain.laws[joint.law].domain.actuation)) for joint in chain.joints]
        end = min(ends) if largest is None else largest
        if not np.isfinite(end):
            raise UserError(
                "The study's law states no domain, so nobody knows how far the bench may drive it: give "
                "'surrogate: {domain: {actuation: [0, 15000]}}', a task with a pressure, or measurements."
            )
        top = dict.fromkeys((actuator.input for actuator in chain.actuators), end)
        return BenchScale(chain, top, _default_load(chain, top))

    @property
    def both_ways(self) -> bool:
        """Inputs of both signs are driven: opposed chambers."""
        return len({np.sign(self._sign(name)) for name in self._driven()}) > 1

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(self.top)

    def actuation(self, share: Array) -> dict[str, Array]:
        """(t,) for each input: shares above 0 drive those that pull with the strongest, below 0 the opposed."""
        driven = self._driven()
        lead = self._sign(max(driven, key=lambda name: self.top[name]))
        return {
            name: self.top[name] * np.maximum(share if self._sign(name) == lead else -share, 0.0)
            if name in driven
            else np.zeros(len(share))
            for name in self.top
        }

    def loads(self, share: Array) -> dict[str, Array]:
        """The end moment (t,) and the force at the tip (t, 3) at these shares of the load."""
        return {"moment_n_m": self.load[0] * share, "tip_force_n": np.outer(share, self.load[1:])}

    def blocking_moment(self, actuation: Mapping[str, Array]) -> Array | None:
        """(t,) the end moment that holds a joint at zero against this actuation; None for an extension."""
        if self.chain.laws[0].joint == "prismatic":
            return None
        return sum_of_efforts(self.chain, actuation)

    def _driven(self) -> list[str]:
        most = max(self.top.values())
        return [name for name, value in self.top.items() if value >= DRIVEN * most]

    def _sign(self, name: str) -> float:
        return next((a.sign for a in self.chain.actuators if a.input == name), 1.0)


def sum_of_efforts(chain: ChainModel, actuation: Mapping[str, Array]) -> Array:
    """(t,) effort of the first joint's law about its main axis at zero deformation, all actuators summed."""
    law, main = chain.laws[chain.joints[0].law], ChainGeometry.of(chain).main
    total = np.zeros(len(next(iter(actuation.values()))))
    for actuator in chain.actuators:
        values = np.asarray(actuation[actuator.input], float)
        total += actuator.sign * law.evaluate(values, np.zeros((len(values), len(chain.axes)))).tau[:, main]
    return total


def _default_load(chain: ChainModel, top: Mapping[str, float]) -> Array:
    """A share of the largest torque as end moment; of the largest force along the chain for an extension."""
    most = max(top, key=lambda name: top[name])
    alone = {name: np.array([top[name] if name == most else 0.0]) for name in top}
    peak = LOAD_OF_PEAK * float(sum_of_efforts(chain, alone)[0])
    if chain.laws[0].joint == "prismatic":
        return np.array([0.0, *(peak * chain.base_rotation[:, 0])])
    return np.array([peak, 0.0, 0.0, 0.0])


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _strongest(histories: list[History]) -> Array:
    """(3,) the largest tip force of all samples."""
    forces = np.concatenate([h.tip_force_n for h in histories])
    strongest: Array = forces[int(np.argmax(np.linalg.norm(forces, axis=1)))]
    return strongest
