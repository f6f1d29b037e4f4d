"""Compliant connections between modules.

    τ'(p, q) = τ(p, q + (n/2) c τ'),      c = κ / k₀

per joint: each interface between two modules is a spring that turns by c per moment, in series with the joints on both
sides. Half of it belongs to each neighbour, so that a joint has n = 1 half at the ends of the chain and n = 2
between (series springs; the lumping of a joint's own flexibility of Spong, J. Dyn. Sys. Meas. Control 109, 1987). κ is
the angle of an interface per radian of a joint at rest. The law change is exact: `series_law.py`.

Each of m actuators in parallel has its own interface, m times as soft; for linear laws they together equal the spring.
An interface has the same compliance about every axis of a ball joint. Law terms of other effects act on the joint with
its interfaces.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Literal

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel, Joint
from pliant.records.law import JointLaw
from pliant.units import Ratio
from pliant_plugins.effects.scale import rest_stiffness
from pliant_plugins.effects.series_law import SeriesLaw


class InterModuleComplianceConfig(EffectConfig):
    """Compliance κ of a connection over that of a module."""

    kind: Literal["inter_module_compliance"] = "inter_module_compliance"
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 3.0), plausible=(0.02, 0.3), example=0.15)
    """compliance of one connection / that of a joint at rest"""


class InterModuleCompliance(Effect):
    """Springs of the connections in series with the adjacent joints."""

    place = "law"
    notes = EffectNotes(
        signature="the chain bends farther under loads than its modules do, the more the larger the moment "
        "that passes a connection; joints between two others are off by more than those at the ends, and one "
        "module is right.",
        inspection="bend two neighbouring modules by hand and watch the joint of glue or the connector "
        "between them.",
        confounder="stiffness",
        distinguishing_test="read every joint: a stiffness is off by one factor in all of them, connections "
        "by half as much in the first and the last; and where pressure or a large angle stiffens modules, "
        "connections stay as they are.",
        excitation="hang loads on the vented chain, then on the pressed one, and read every joint's angle.",
        where="chains of two modules or more that bend, hinges and ball joints; every engine. Read by the "
        "sum of angles alone it is nearly a stiffness.",
    )
    recommended_experiments = ("second_sensor", "passive_load_steps", "load_steps")
    config: InterModuleComplianceConfig

    def apply(self, model: Model) -> Model:
        """Return the model with other laws in its joints.

        Raises:
            UserError: a chain of one module, or of modules that do not bend, or a law that is not stiff at rest.
        """
        chain = model.chain
        self._check(chain)
        if self.config.share == 0.0:
            return model
        compliance = self.config.share * int(chain.parts.max()) / rest_stiffness(chain)
        laws, joints = _connected(chain.laws, chain.joints, compliance)
        return model.with_(chain=chain.with_(laws=laws, joints=joints))

    def _check(self, chain: ChainModel) -> None:
        if chain.laws[0].joint == "prismatic":
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}' needs modules that bend, and this chain only extends"
            )
        if chain.n_joints < 2:
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}' is about connections between modules, and the chain has one module",
                "take it out of 'effects', or give 'chain.modules' 2 or more",
            )


@lru_cache(maxsize=128)
def _connected(
    laws: tuple[JointLaw, ...], joints: tuple[Joint, ...], compliance: float
) -> tuple[tuple[JointLaw, ...], tuple[Joint, ...]]:
    """Return laws behind their halves of the connections, and joints that have them.

    The same objects for the same input: engines tabulate a law once for each object.
    """
    ends = (0, len(joints) - 1)
    wanted = [(joint.law, 0.5 if i in ends else 1.0) for i, joint in enumerate(joints)]
    kinds = list(dict.fromkeys(wanted))
    wrapped = tuple(SeriesLaw(laws[law], halves * compliance) for law, halves in kinds)
    changed = (replace(j, law=kinds.index(kind)) for j, kind in zip(joints, wanted, strict=True))
    return wrapped, tuple(changed)
