"""Assignment of actuators to joints: those of the config, those of segments, or one for each actuation of laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pliant.config.chain import ActuatorConfig
from pliant.errors import UserError
from pliant.records.actuation import actuation_kind
from pliant.records.chain import Actuator
from pliant.records.law import JointLaw


@dataclass(frozen=True, eq=False)
class Wiring:
    """The actuators of a chain, and for each segment those that act on it.

    Attributes:
        actuators: all of them.
        drives: for each segment, first and last (exclusive) index of its actuators; None if all act on it.
    """

    actuators: tuple[Actuator, ...]
    drives: tuple[tuple[int, int] | None, ...]

    @staticmethod
    def from_segments(
        common: Sequence[ActuatorConfig], segments: Sequence[tuple[JointLaw | None, tuple[Actuator, ...]]]
    ) -> Wiring:
        """Return the wiring of segments, each a law (None for a rigid piece) and its own actuators.

        Raises:
            UserError: actuators and laws with different inputs, or more or fewer actuators than a law has inputs.
        """
        shared = actuators_from_configs(common)
        if not any(own for _, own in segments):
            actuators = _law_actuators(
                [law for law, _ in segments if law is not None], shared, "chain.actuators"
            )
            return Wiring(actuators, (None,) * len(segments))
        spans: dict[tuple[Actuator, ...], tuple[int, int]] = {}
        drives: list[tuple[int, int] | None] = []
        flat: list[Actuator] = []
        for number, (law, own) in enumerate(segments):
            if law is None:
                drives.append(None)
                continue
            where = f"chain.segments.{number}.actuators" if own else "chain.actuators"
            acting = _law_actuators([law], own or shared, where)
            if acting not in spans:
                spans[acting] = (len(flat), len(flat) + len(acting))
                flat += acting
            drives.append(spans[acting])
        return Wiring(tuple(flat), tuple(drives) if len(spans) > 1 else (None,) * len(segments))

    def sharers(self, segment: int) -> int:
        """Return the number of actuators that act on each joint of a segment."""
        first, last = self.drives[segment] or (0, len(self.actuators))
        return last - first


def actuators_from_configs(configs: Sequence[ActuatorConfig]) -> tuple[Actuator, ...]:
    """Return the records of config entries."""
    return tuple(Actuator(a.input, a.sign, a.rotation_rad) for a in configs)


def _law_actuators(laws: Sequence[JointLaw], given: tuple[Actuator, ...], where: str) -> tuple[Actuator, ...]:
    """Return the given actuators, or one for each actuation of the laws; all must have the laws' inputs."""
    names = sorted({law.actuation_name for law in laws})
    if len(names) > 1:
        raise UserError(f"one chain has one kind of actuation, and its laws take {' and '.join(names)}")
    law = laws[0]
    if len(law.actuations) > 1:
        return _several_actuators(law, given, where)
    for actuator in given:
        if actuation_kind(actuator.input) != actuation_kind(law.actuation_name):
            raise UserError(
                f"{where} names '{actuator.input}', but the chain's law takes {law.actuation_name}; a law that is "
                f"stated says what it takes by 'actuation_name: {actuation_kind(actuator.input).name}' in 'surrogate'."
            )
        if actuator.rotation_rad and len(law.axes) != 3:
            raise UserError(
                f"{where} turns '{actuator.input}' about the chain axis, and a {law.joint} joint has one "
                "axis: give the law 'axes' x, y and z, or leave 'rotation' out."
            )
    return given or (Actuator(law.actuation_name),)


def _several_actuators(law: JointLaw, given: tuple[Actuator, ...], where: str) -> tuple[Actuator, ...]:
    """Return one actuator for each actuation of a law, in its order."""
    wanted = law.actuations
    if not given:
        return tuple(Actuator(name) for name in wanted)
    if len(given) != len(wanted):
        more = "more" if len(given) > len(wanted) else "fewer"
        raise UserError(
            f"{where} has {len(given)} inputs, {more} than the module has actuations ({law.actuation_name}): give "
            f"{len(wanted)}, one for each in this order."
        )
    for actuator, name in zip(given, wanted, strict=True):
        if actuation_kind(actuator.input) != actuation_kind(name):
            raise UserError(
                f"{where} gives '{actuator.input}' to {name} of the law: give it an input of its kind"
            )
        if actuator.sign != 1.0 or actuator.rotation_rad:
            raise UserError(
                f"{where} turns '{actuator.input}', and the law of {law.actuation_name} knows on which side each acts: "
                "leave 'sign' and 'rotation' out, and turn the module by the segment's 'rotation'."
            )
    return given
