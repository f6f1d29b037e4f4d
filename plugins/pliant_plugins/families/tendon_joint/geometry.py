"""The tendon joint as a solid, what makes it valid, and its tendon's path in closed form.

Module frame: origin at mid-flexure, x along the chain, the tendon below the flexure at z = −h. The flexure is a
strip, x ∈ [−c/2, c/2] and t thick; the links' end faces lean back from it, so that their lower edges meet at the
closing angle and their upper edges at the opening angle of the other sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from pliant.errors import InvalidDesignError

LARGEST_MODULE_M = 1.0


@dataclass(frozen=True)
class JointGeometry:
    """Module length l, flexure c × t × w, tendon h below and b behind it, link section, angles of contact."""

    module_length_m: float
    flexure_length_m: float
    flexure_thickness_m: float
    flexure_width_m: float
    tendon_offset_m: float
    tendon_setback_m: float
    link_height_m: float
    link_width_m: float
    closing_angle_rad: float
    opening_angle_rad: float

    @property
    def span_m(self) -> float:
        """c/2, the solved half of the flexure."""
        return self.flexure_length_m / 2

    @property
    def hole_x_m(self) -> float:
        """x of the hole in the end link at rest; the tendon is twice as long between the holes."""
        return self.span_m + self.tendon_setback_m

    def edge_x_m(self, contact_rad: float) -> float:
        """x of an end link's edge, H/2 from the mid-plane, that meets its mirror image at a joint angle.

        At θ the arc of the flexure ends at x = (c/θ) sin(θ/2), turned by θ/2: an edge at depth H/2 and s behind
        it stands at x = (c/θ) sin(θ/2) + s cos(θ/2) − (H/2) sin(θ/2), which is zero at contact.
        """
        reach = self.link_height_m / 2 - self.flexure_length_m / contact_rad
        return self.span_m + reach * float(np.tan(contact_rad / 2))

    @property
    def lower_edge_x_m(self) -> float:
        """x of the end link's edge on the tendon's side."""
        return self.edge_x_m(self.closing_angle_rad)

    @property
    def upper_edge_x_m(self) -> float:
        """x of the end link's edge on the other side."""
        return self.edge_x_m(self.opening_angle_rad)

    def face_x_m(self, depth_m: float) -> float:
        """x of the end link's face at a depth below the mid-plane, t/2 ≤ depth ≤ H/2."""
        half = self.flexure_thickness_m / 2
        share = (depth_m - half) / (self.link_height_m / 2 - half)
        return self.span_m + share * (self.lower_edge_x_m - self.span_m)

    def tendon_length_m(self, angle_rad: float) -> float:
        """Length of the tendon between its holes if the flexure bends as a circular arc of length c.

        L = 2 [(c/θ) sin(θ/2) + b cos(θ/2) − h sin(θ/2)].
        """
        half = angle_rad / 2
        arc = self.span_m * float(np.sinc(half / np.pi))
        return 2 * (arc + self.tendon_setback_m * np.cos(half) - self.tendon_offset_m * np.sin(half))

    def tendon_arm_m(self, angle_rad: float) -> float:
        """−dL/dθ of `tendon_length_m`: the moment of a unit force, which grows as the joint bends."""
        half = angle_rad / 2
        # −d/dx of sin(x)/x, by its series where the quotient cancels
        slope = half / 3 if abs(half) < 1e-4 else (np.sin(half) - half * np.cos(half)) / half**2
        guided = self.tendon_setback_m * np.sin(half) + self.tendon_offset_m * np.cos(half)
        return float(self.span_m * slope + guided)

    def check(self) -> None:
        """Raise `InvalidDesignError`, with the broken inequality and by how much, unless the joint exists."""
        for name, value, sign, than, limit in self._inequalities():
            if not {"<": value < limit, ">": value > limit, "≤": value <= limit * (1 + 1e-9)}[sign]:
                raise InvalidDesignError(
                    f"tendon_joint needs {name} {sign} {than}, but {_mm(value)} against {_mm(limit)} misses it by "
                    f"{_mm(abs(value - limit))}."
                )

    def _inequalities(self) -> Iterator[tuple[str, float, str, str, float]]:
        """Name, value, sign, name of the limit and limit, in m; each may hold only where those before it do."""
        lengths = {f.name[:-2]: getattr(self, f.name) for f in fields(self) if f.name.endswith("_m")}
        yield from ((name, value, ">", "0", 0.0) for name, value in lengths.items())
        metre = "1 m (bare numbers are metres)"
        yield from ((name, value, "<", metre, LARGEST_MODULE_M) for name, value in lengths.items())
        contacts = {"closing_angle": self.closing_angle_rad, "opening_angle": self.opening_angle_rad}
        for name, angle in contacts.items():
            if not 0 < angle < np.pi:
                raise InvalidDesignError(
                    f"tendon_joint needs 0 < {name} < pi, but {name} = {angle:.6g} rad, "
                    f"off by {max(-angle, angle - np.pi):.6g} rad."
                )
        c, t, h = self.flexure_length_m, self.flexure_thickness_m, self.tendon_offset_m
        yield "flexure_length (the links need room)", c, "<", "module_length", self.module_length_m
        yield "flexure_thickness", t, "<", "link_height", self.link_height_m
        yield "flexure_width", self.flexure_width_m, "≤", "link_width", self.link_width_m
        inside, folds = max(contacts.values()) * t / 2, "flexure_length (or its inside folds)"
        yield "flexure_thickness/2 · the larger contact angle", inside, "<", folds, c
        for side, edge in (("closing", self.lower_edge_x_m), ("opening", self.upper_edge_x_m)):
            name = f"x of the link's edge that meets its image at the {side}_angle"
            yield name, edge, ">", "0", 0.0
            yield name, edge, "<", "module_length/2", self.module_length_m / 2
        yield "flexure_thickness/2", t / 2, "<", "tendon_offset", h
        yield "tendon_offset (the hole lies in the link)", h, "<", "link_height/2", self.link_height_m / 2
        hole = "flexure_length/2 + tendon_setback"
        yield hole, self.hole_x_m, "≤", "module_length/2", self.module_length_m / 2
        yield "the link's face at the tendon", self.face_x_m(h), "≤", hole, self.hole_x_m


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.6g} mm"
