"""Wrapper of a joint law."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.records.law import Domain, JointKind, JointLaw, LawRecord


@dataclass(frozen=True, eq=False)
class LawWrapper(JointLaw):
    """Base of laws that wrap another law with the same joint, axes, input and domain; subclasses change the effort.

    Attributes:
        law: the wrapped law.
    """

    law: JointLaw

    @property
    def joint(self) -> JointKind:  # type: ignore[override]
        return self.law.joint

    @property
    def axes(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.law.axes

    @property
    def actuation_name(self) -> str:  # type: ignore[override]
        return self.law.actuation_name

    @property
    def domain(self) -> Domain:  # type: ignore[override]
        return self.law.domain

    def record(self) -> LawRecord:
        """Return the record of the wrapped law; wrappers are built again and never stored."""
        return self.law.record()
