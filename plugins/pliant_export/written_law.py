"""A law prepared for export: its tape, inputs and outputs, domain, and error band."""

from __future__ import annotations

import keyword
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.law import JointLaw, ScalarLaw
from pliant_export.tape import Builder, Tape
from pliant_export.tracing import TracedNumber, Tracer

# The level of the exported band, and the number of points of the domain at which it is evaluated.
LEVEL, LOOKS, SEED = 0.9, 1000, 0
NOT_WRITTEN = (
    "The law of this study has no form that other languages can take: its surrogate, or an effect around it, is a "
    "plugin's without a scalar form. Export a study whose surrogate is polynomial, neural or table."
)


def has_form(laws: Sequence[JointLaw]) -> bool:
    """Return whether all of these laws can be exported."""
    return all(law.scalar() is not None for law in laws)


@dataclass(frozen=True, eq=False)
class WrittenLaw:
    """A law as a list of steps.

    Attributes:
        name: of the functions.
        tape: inputs are the actuations, then the deformations; outputs "tau" (a), "dtau_dp" (a·m) and "dtau_du" (a·a).
        actuations, deformations: names with their units, (m) and (a).
        unit: of τ.
        domain: (m + a, 2) where the law was fitted.
        band: (a,) the law's error is below this in 90 % of cases, at the worst place of the domain; None where
            the law states no error.
    """

    name: str
    tape: Tape
    actuations: tuple[str, ...]
    deformations: tuple[str, ...]
    unit: str
    domain: Array
    band: Array | None

    @property
    def m(self) -> int:
        """Number of actuations."""
        return len(self.actuations)

    @property
    def a(self) -> int:
        """Number of axes."""
        return len(self.deformations)

    @property
    def about(self) -> tuple[str, ...]:
        """Lines that describe all of this to a reader."""
        inputs = (*self.actuations, *self.deformations)
        lines = [
            f"tau [{self.unit}] of {', '.join(self.deformations)} under {', '.join(self.actuations)}; dtau_dp and "
            "dtau_du are its slopes.",
            "Static equilibrium of a joint: tau plus the moments of all loads is zero. A stable law has dtau_du < 0.",
            "Fitted where " + ", ".join(_range(*row) for row in zip(inputs, self.domain, strict=True)) + ".",
            "Outside it is extrapolated smoothly.",
            *(BALL_JOINT if sum(name.startswith("angle_") for name in self.deformations) > 1 else ()),
        ]
        if self.band is None:
            lines.append("The law states no error.")
        else:
            off = ", ".join(f"{value:.3g}" for value in self.band)
            lines.append(
                f"With probability {LEVEL:g} it is off by less than {off} {self.unit} in the domain."
            )
        return tuple(lines)


# The frame in which the effort of a ball joint acts, for applying it as a torque.
BALL_JOINT = (
    "angle_x_rad, angle_y_rad, angle_z_rad are the rotation vector f of the child link in the rest frame of its "
    "parent, and tau is conjugate to f. The torque on the child, in the child's own frame, is T = J^-T tau with "
    "J = 1 - (1 - cos t)/t^2 K + (t - sin t)/t^3 K K, t = |f|, K the cross-product matrix of f; the parent gets -T.",
    "PyBullet reads the quaternion of a spherical joint and takes its torque in the principal axes of the child's "
    "inertia: turn f and T by the rotation A of getDynamicsInfo(body, link)[4], f = A q, torque = A^T T.",
)


def written(law: JointLaw, name: str) -> WrittenLaw:
    """Return the law as a list of steps.

    Raises:
        UserError: the law has no scalar form, or one that cannot be traced.
    """
    scalar = law.scalar()
    if scalar is None:
        raise UserError(NOT_WRITTEN)
    actuations = tuple(part.strip() for part in law.actuation_name.split(","))
    unit, coordinate = ("N", "m") if law.joint == "prismatic" else ("N*m", "rad")
    stem = "extension" if law.joint == "prismatic" else "angle"
    deformations = tuple(f"{stem}_{axis}_{coordinate}" for axis in law.axes)
    tape = _tape(scalar, actuations, deformations)
    domain = np.vstack([law.domain.actuation, law.domain.deformation])
    return WrittenLaw(identifier(name), tape, actuations, deformations, unit, domain, _band(law, domain))


def identifier(name: str) -> str:
    """Return a name that is a valid identifier in C and Python."""
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower() or "law"
    return f"law_{plain}" if plain[0].isdigit() or keyword.iskeyword(plain) else plain


def _tape(scalar: ScalarLaw, actuations: tuple[str, ...], deformations: tuple[str, ...]) -> Tape:
    m, a = len(actuations), len(deformations)
    build = Builder((*actuations, *deformations), scalar.parameters)
    p = [TracedNumber(build.input(k)) for k in range(m)]
    u = [TracedNumber(build.input(m + k)) for k in range(a)]
    tau, by_p, by_u = Tracer(build).fill(scalar.function, p if m > 1 else p[0], u, scalar.parameters)
    share = getattr(scalar, "less_rest", 0.0)
    if share:  # the elasticity that a law behind a shared joint must not add a second time
        rest, _, rest_by_u = Tracer(build).fill(scalar.function, 0.0, u, scalar.parameters)
        tau, by_u = (
            [
                build.op("-", k, build.op("*", build.number(share), r))
                for k, r in zip(all_of, less, strict=True)
            ]
            for all_of, less in ((tau, rest), (by_u, rest_by_u))
        )
    return build.tape({"tau": tau, "dtau_dp": by_p, "dtau_du": by_u}).needed()


def _band(law: JointLaw, domain: Array) -> Array | None:
    if not law.states_error or not np.isfinite(domain).all():
        return None
    points = np.random.default_rng(SEED).uniform(domain[:, 0], domain[:, 1], (LOOKS, len(domain)))
    m = len(domain) - len(law.axes)
    band = law.band(points[:, 0] if m == 1 else points[:, :m], points[:, m:], LEVEL)
    return None if band is None else np.asarray(band.max(axis=0), float)


def _range(name: str, limits: Array) -> str:
    low, high = (float(limit) for limit in limits)
    if not (np.isfinite(low) or np.isfinite(high)):
        return f"{name} has any value"
    return f"{name} is {low:.6g} to {high:.6g}"
