"""A law around another one, of the same joint."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.records.law import Domain, JointKind, JointLaw, LawRecord


@dataclass(frozen=True, eq=False)
class LawAround(JointLaw):
    """Joint, axes, input and domain of the law inside; what is different about the effort, subclasses say.

    Attributes:
        law: the law inside.
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
        """That of the law inside: what stands around it is made anew, never stored."""
        return self.law.record()
