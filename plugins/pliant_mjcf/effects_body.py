"""Effects that are numbers of a body: its mass, centre of mass and inertia, and a payload.

    body_mass         m' = f m,      J' = f^q J
    centre_of_mass    c' = c + d,    along the axes of the body's frame; J about the centre of mass stays
    body_inertia      J' = f J
    payload           m' = m + μ,    c' = (m c + μ p) / m',    J' = J + m S(c − c') + μ S(p − c')

with the mass m, the centre of mass c and the rotational inertia J about it, of each chosen body; S(r) = |r|² 1 − r rᵀ
(parallel axes, Huygens & Steiner), and the payload μ as a point p, given from the origin of the body's frame or a site.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from pydantic import Field

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import SystemParts, effect_kind
from pliant.records.design import Array
from pliant.units import Length, Mass, Ratio
from pliant_mjcf.changes import SpecChange
from pliant_mjcf.effect_bases import EffectChange, EffectCheck, ModelEffect
from pliant_mjcf.elements import with_id
from pliant_plugins.effects.payload_error import PayloadError

WHERE = "bodies of MuJoCo models that can move, all or those that a pattern names."


class BodyEffect(ModelEffect):
    """A change of the mass distribution of bodies."""

    place = "body"

    def write(self, spec: Any, model: Any) -> None:
        """Write the mass distribution of the chosen bodies as numbers; of all where the compiler would change them."""
        import mujoco

        numbers = self.numbers(model)
        always = int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
        if int(spec.compiler.inertiafromgeom) == always or spec.compiler.settotalmass > 0.0:
            spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
            spec.compiler.settotalmass = -1.0
            numbers = list(range(1, model.nbody))
        for k in numbers:
            body = with_id(spec.bodies, k)
            body.explicitinertial = True
            body.mass = float(model.body_mass[k])
            body.ipos, body.iquat = model.body_ipos[k].copy(), model.body_iquat[k].copy()
            body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
            body.inertia, body.fullinertia = model.body_inertia[k].copy(), np.full(6, np.nan)


class MovedMass(BodyEffect):
    """A change that moves centres of mass."""

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the change; a neutral one costs nothing."""
        if self.is_neutral:
            return parts.with_change(EffectCheck(self))
        return parts.with_change(GeneralBodies(self.pattern)).with_change(EffectChange(self))


@dataclass(frozen=True)
class GeneralBodies(SpecChange):
    """Bodies with a full mass matrix: MuJoCo compiles that of symmetric ones without children as a diagonal one."""

    pattern: str

    def edit(self, spec: Any) -> None:
        """Take the simplification from the bodies that the pattern fits."""
        for k, body in enumerate(spec.bodies):
            if k and hasattr(body, "simple") and fnmatchcase(body.name or f"body_{k}", self.pattern):
                body.simple = 0


class BodyMassConfig(EffectConfig):
    """Mass of a body."""

    kind: str = effect_kind("body_mass")
    factor: Ratio = parameter(neutral=1.0, bounds=(0.01, 100.0), plausible=(0.75, 1.35), example=1.1)
    """true mass / model's"""
    inertia_power: float = parameter(
        unit="1", neutral=1.0, bounds=(0.0, 3.0), plausible=(0.4, 1.6), role="form"
    )
    """power of the factor in the inertia: 1 for another density, below it with mass near the centre"""


class BodyMass(BodyEffect):
    """A factor of the mass, and a power of it of the inertia."""

    config: BodyMassConfig
    notes = EffectNotes(
        signature="forces that hold and accelerate the body are off by one factor; positions at rest are off where a "
        "spring or a soft drive holds it.",
        inspection="weigh the body with everything that is mounted on it, and correct the model.",
        confounder="gravity_scale",
        distinguishing_test="fast motion in the plane of no weight: a mass shows there, gravity does not.",
        excitation="hold several levels, then move fast.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "fast_cycles")

    def change(self, model: Any) -> None:
        numbers = self.numbers(model)
        model.body_mass[numbers] *= self.config.factor
        model.body_inertia[numbers] *= self.config.factor**self.config.inertia_power


class CentreOfMassConfig(EffectConfig):
    """Shift of a body's centre of mass."""

    kind: str = effect_kind("centre_of_mass")
    x_m: Length = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.02, 0.02), example="5 mm")
    """true − model's, along x of the body's frame"""
    y_m: Length = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.02, 0.02))
    """true − model's, along y of the body's frame"""
    z_m: Length = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.02, 0.02))
    """true − model's, along z of the body's frame"""


class CentreOfMass(MovedMass):
    """A centre of mass that is shifted from the model's."""

    config: CentreOfMassConfig
    notes = EffectNotes(
        signature="moments of weight are off by an amount that depends on the angle as another phase of its sine.",
        inspection="balance the body on an edge in two directions and mark its centre of mass.",
        confounder="body_mass",
        distinguishing_test="hold the body in several orientations: a wrong mass changes the size of its moment, a "
        "wrong centre where it is zero.",
        excitation="hold levels over the whole range of angles.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "step_response")

    def change(self, model: Any) -> None:
        for k in self.numbers(model):
            model.body_ipos[k] += (self.config.x_m, self.config.y_m, self.config.z_m)
            model.body_sameframe[k] = 0


class BodyInertiaConfig(EffectConfig):
    """Rotational inertia of a body."""

    kind: str = effect_kind("body_inertia")
    factor: Ratio = parameter(neutral=1.0, bounds=(0.01, 100.0), plausible=(0.6, 1.7), example=1.2)
    """true rotational inertia about the centre of mass / model's"""


class BodyInertia(BodyEffect):
    """A factor of the rotational inertia: the same mass, farther from its centre."""

    config: BodyInertiaConfig
    notes = EffectNotes(
        signature="only fast turns are off; rest and slow motion are right.",
        inspection="hang the body on two strings, turn it and count its swings.",
        confounder="body_mass",
        distinguishing_test="hold the body against its weight: a mass shows there, an inertia does not.",
        excitation="steps and fast cycles.",
        where=WHERE,
    )
    recommended_experiments = ("fast_cycles", "step_response")

    def change(self, model: Any) -> None:
        model.body_inertia[self.numbers(model)] *= self.config.factor


class PayloadConfig(EffectConfig):
    """A mass that the model does not have."""

    kind: str = effect_kind("payload")
    mass_kg: Mass = parameter(neutral=0.0, bounds=(0.0, 1e4), plausible=(0.0, 0.2), example="50 g")
    """additional point mass"""
    x_m: Length = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.05, 0.05), role="form")
    """from the origin of the body's frame, or from the site, along x of the body's frame"""
    y_m: Length = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.05, 0.05), role="form")
    """the same along y"""
    z_m: Length = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.05, 0.05), role="form")
    """the same along z"""
    site: str = Field(
        "", description="site of the body near which it is; near the origin of the body's frame without"
    )


class Payload(MovedMass):
    """A point mass at or near the origin of a body's frame, or a site."""

    config: PayloadConfig
    notes = replace(
        PayloadError.notes,
        origin="physics",
        signature="the body moves as if it carried more: it hangs lower where it is soft, and starts and stops more "
        "slowly.",
        inspection="look for cables, markers and tools that the model does not have, and weigh them.",
        confounder="body_mass",
        distinguishing_test="take the cables and tools off: a payload is gone, a wrong mass stays.",
        excitation="hold several levels, then move fast.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "fast_cycles")

    def numbers(self, model: Any) -> list[int]:
        """Return the chosen bodies, or the one of the site; raise `UserError` without any."""
        found = super().numbers(model)
        if not self.config.site:
            return found
        found = [k for k in found if k == model.site_bodyid[self._site(model)]]
        if not found:
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}': the site '{self.config.site}' is on none of its bodies"
            )
        return found

    def _site(self, model: Any) -> int:
        import mujoco

        number = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, self.config.site))
        if number < 0:
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}': the model has no site '{self.config.site}'"
            )
        return number

    def change(self, model: Any) -> None:
        point = model.site_pos[self._site(model)].copy() if self.config.site else np.zeros(3)
        point += (self.config.x_m, self.config.y_m, self.config.z_m)
        for k in self.numbers(model):
            add_point(model, k, self.config.mass_kg, point)


def add_point(model: Any, body: int, mass_kg: float, point: Array) -> None:
    """Add a point mass at a point of the body's frame to its mass, centre of mass and inertia."""
    import mujoco

    mass, centre = float(model.body_mass[body]), model.body_ipos[body].copy()
    nine, quat = np.empty(9), np.empty(4)
    mujoco.mju_quat2Mat(nine, model.body_iquat[body])
    axes = nine.reshape(3, 3)
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    both = mass + mass_kg
    if both == 0.0:
        return
    new = (mass * centre + mass_kg * point) / both
    inertia += mass * _steiner(centre - new) + mass_kg * _steiner(point - new)
    principal, turned = np.linalg.eigh(inertia)
    turned[:, 2] *= np.sign(np.linalg.det(turned))
    mujoco.mju_mat2Quat(quat, turned.ravel())
    model.body_mass[body], model.body_ipos[body] = both, new
    model.body_inertia[body], model.body_iquat[body] = np.maximum(principal, 0.0), quat
    model.body_sameframe[body] = 0


def _steiner(r: Array) -> Array:
    return np.asarray(np.dot(r, r) * np.eye(3) - np.outer(r, r))
