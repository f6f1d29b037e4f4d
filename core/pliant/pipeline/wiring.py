"""Which actuators act on which joints: those of the config, those of segments, or one for each actuation of laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pliant.config.chain import ActuatorConfig
from pliant.errors import UserError
from pliant.records.actuation import kind_of
from pliant.records.chain import Actuator
from pliant.records.law import JointLaw


@dataclass(frozen=True, eq=False)
class Wiring:
    """The actuators of a chain, and of each segment the part of them that acts on it.

    Attributes:
        actuators: all of them.
        drives: of each segment, first and last (exclusive) of its own; None where all act on it.
    """

    actuators: tuple[Actuator, ...]
    drives: tuple[tuple[int, int] | None, ...]

    @staticmethod
    def of(
        common: Sequence[ActuatorConfig], segments: Sequence[tuple[JointLaw | None, tuple[Actuator, ...]]]
    ) -> Wiring:
        """The wiring of segments, each a law (None of a rigid piece) and actuators of its own.

        Raises:
            UserError: actuators and laws that take different inputs, more or fewer of them than a law takes.
        """
        shared = actuators_of(common)
        if not any(own for _, own in segments):
            actuators = _of_laws([law for law, _ in segments if law is not None], shared, "chain.actuators")
            return Wiring(actuators, (None,) * len(segments))
        spans: dict[tuple[Actuator, ...], tuple[int, int]] = {}
        drives: list[tuple[int, int] | None] = []
        flat: list[Actuator] = []
        for number, (law, own) in enumerate(segments):
            if law is None:
                drives.append(None)
                continue
            where = f"chain.segments.{number}.actuators" if own else "chain.actuators"
            acting = _of_laws([law], own or shared, where)
            if acting not in spans:
                spans[acting] = (len(flat), len(flat) + len(acting))
                flat += acting
            drives.append(spans[acting])
        return Wiring(tuple(flat), tuple(drives) if len(spans) > 1 else (None,) * len(segments))

    def sharers(self, segment: int) -> int:
        """How many actuators act on each joint of a segment."""
        first, last = self.drives[segment] or (0, len(self.actuators))
        return last - first


def actuators_of(configs: Sequence[ActuatorConfig]) -> tuple[Actuator, ...]:
    """The records of config entries."""
    return tuple(Actuator(a.input, a.sign, a.rotation_rad) for a in configs)


def _of_laws(laws: Sequence[JointLaw], given: tuple[Actuator, ...], where: str) -> tuple[Actuator, ...]:
    """The actuators given, or one for each actuation of the laws; every one drives every law: their inputs agree."""
    names = sorted({law.actuation_name for law in laws})
    if len(names) > 1:
        raise UserError(f"one chain has one kind of actuation, and its laws take {' and '.join(names)}")
    law = laws[0]
    if len(law.actuations) > 1:
        return _of_several(law, given, where)
    for actuator in given:
        if kind_of(actuator.input) != kind_of(law.actuation_name):
            raise UserError(
                f"{where} names '{actuator.input}', but the chain's law takes {law.actuation_name}; a law that is "
                f"stated says what it takes by 'actuation_name: {kind_of(actuator.input).name}' in 'surrogate'."
            )
        if actuator.rotation_rad and len(law.axes) != 3:
            raise UserError(
                f"{where} turns '{actuator.input}' about the chain axis, and a {law.joint} joint has one "
                "axis: give the law 'axes' x, y and z, or leave 'rotation' out."
            )
    return given or (Actuator(law.actuation_name),)


def _of_several(law: JointLaw, given: tuple[Actuator, ...], where: str) -> tuple[Actuator, ...]:
    """One actuator for each actuation of a law, in its order."""
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
        if kind_of(actuator.input) != kind_of(name):
            raise UserError(
                f"{where} gives '{actuator.input}' to {name} of the law: give it an input of its kind"
            )
        if actuator.sign != 1.0 or actuator.rotation_rad:
            raise UserError(
                f"{where} turns '{actuator.input}', and the law of {law.actuation_name} knows on which side each acts: "
                "leave 'sign' and 'rotation' out, and turn the module by the segment's 'rotation'."
            )
    return given
