"""The effect catalogue, docs/reference/effects.md, from the effects themselves; `generate.py` writes it."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Sequence
from typing import get_args

from pliant.interfaces.effect import Effect, EffectParameter, Place
from pliant.registry.component import Component
from pliant.units import strip_unit_suffix

INTRODUCTION = """\
# Effect catalogue

What a chain of joint laws may lack, where it acts, what gives it away in the data, and the run that shows it,
beside [effects of your own](../write_an_effect.md). Pictures show a run that excites the effect; the dashed line is the
model without it, the angle that of one joint (of eight joints for weights).

A *strength* makes the effect vanish at its neutral value; a *shape* says when or how it acts, and its neutral value
is a typical one. The *plausible* range holds the central 90 % of the prior: it would not surprise an expert. Bounds
are hard; they keep out limits in which one effect becomes another (a spring that never slips is a stiffness)."""
PLACES: dict[Place, str] = {
    "input": "before the chain: what arrives is not what was commanded",
    "law": "in every joint's law",
    "chain": "in the chain: masses, gravity, base",
    "output": "after the chain: what is read is not what is there",
}
HEAD = "| parameter | role | neutral | plausible | bounds | prior | meaning |\n|---|---|---|---|---|---|---|"


def catalogue(components: Sequence[Component]) -> str:
    """The page, in the order of the places at which effects act."""
    order = {place: number for number, place in enumerate(get_args(Place))}
    effects = [(component, component.implementation_class()) for component in components]
    effects.sort(key=lambda pair: (order[pair[1].place], pair[0].kind))
    rows = [
        f"| [{c.kind}](#{c.kind}) | {e.place} | {c.summary} | {_link(e.notes.look_alike)} |"
        for c, e in effects
    ]
    table = ["| kind | place | what it is | easily taken for |", "|---|---|---|---|", *rows]
    parts = [INTRODUCTION, "\n".join(table), *(_section(component, effect) for component, effect in effects)]
    return "\n\n".join(parts) + "\n"


def _section(component: Component, effect: type[Effect]) -> str:
    kind, notes = component.kind, effect.notes
    title, _, text = (inspect.getdoc(sys.modules[effect.__module__]) or "").partition("\n\n")
    fields = component.config_model().model_fields
    rows = [_row(p, fields[p.name].description or "") for p in effect.parameters]
    return "\n\n".join(
        [
            f"## {kind}",
            f"{title} Acts {PLACES[effect.place]}. Keys: [{kind}](effect/{kind}.md).",
            f"![{kind}: the run that shows it](../pictures/effects/{kind}.png)",
            text,
            "\n".join([HEAD, *rows]),
            f"**What gives it away:** {_sentence(notes.signature)}",
            f"**Easily taken for** {_link(notes.look_alike)}: {notes.told_apart}",
            f"**To see it:** {_sentence(notes.excited_by)}",
        ]
    )


def _row(parameter: EffectParameter, meaning: str) -> str:
    unit = "" if parameter.unit in ("", "1") else f" {parameter.unit}"

    def span(ends: tuple[float, float]) -> str:
        return f"{ends[0]:g} … {ends[1]:g}{unit}"

    cells = (
        f"`{strip_unit_suffix(parameter.name)}`",
        parameter.role,
        f"{parameter.neutral:g}{unit}",
        span(parameter.plausible),
        span(parameter.bounds),
        parameter.prior.replace("_", "-"),
        meaning.replace("|", "\\|"),
    )
    return f"| {' | '.join(cells)} |"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _link(kind: str) -> str:
    return f"[{kind}](#{kind})" if kind else "nothing"
