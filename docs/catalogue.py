"""The effect catalogue, docs/reference/effects.md, generated from the effects; `generate.py` writes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast, get_args

from pliant.config.study import written_name
from pliant.experiments.experiment_catalogue import timed_catalogue
from pliant.experiments.planned_run import BenchScale
from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Place
from pliant.registry.component import Component
from pliant.testing.samples import PRESSURE_PA, sample_chain

INTRODUCTION = """\
# Effect catalogue

What a chain of joint laws may lack, where it acts, what gives it away in the data, and the run that shows it,
beside [effects of your own](../write_an_effect.md). The page of each has its equation, its keys and a picture of a run
that excites it; the dashed line is the model without it, the angle that of one joint unless the axis says otherwise
(of eight joints for weights).

Most are physics that a model may lack. Those marked *mistake of the record* are not: a payload, a load or a clock that
was written down wrongly. A diagnosis tries them beside the others, and its advice is then to correct the file.

A *strength* makes the effect vanish at its neutral value; a *shape* says when or how it acts, and its neutral value
is a typical one. The *plausible* range holds the central 90 % of the prior: it would not surprise an expert. Bounds
are hard; they keep out limits in which one effect becomes another (a spring that never slips is a stiffness). The *runs
that show it* are those of the [menu](#runs-of-the-menu) that excite the effect and tell it from its look-alike."""
MENU = """\
## Runs of the menu

Runs that most benches can do, with the effects that each shows best. `pliant plan` ranks them by what they would
decide between the hypotheses that are left, for your chain and your measurements."""
PLACES: dict[Place, str] = {
    "input": "before the chain: what arrives is not what was commanded",
    "law": "in every joint's law",
    "chain": "in the chain: masses, gravity, base",
    "output": "after the chain: what is read is not what is there",
}
HEAD = "| parameter | role | neutral | plausible | bounds | prior | meaning |\n|---|---|---|---|---|---|---|"


def catalogue(components: Sequence[Component]) -> str:
    """Return the page, in the order of the places at which effects act."""
    order = {place: number for number, place in enumerate(get_args(Place))}
    effects = [(component, component.implementation_class()) for component in components]
    effects.sort(key=lambda pair: (order[pair[1].place], pair[0].kind))
    rows = [
        f"| {_link(c.kind)} | {_place(e)} | {c.summary}{_origin(e)} | {_sentence(e.notes.inspection)} "
        f"| {_link(e.notes.confounder)} | {_runs(e)} |"
        for c, e in effects
    ]
    head = (
        "| kind | place | what it is | what to look at on the bench | easily taken for | runs that show it |\n"
        "|---|---|---|---|---|---|"
    )
    return "\n\n".join([INTRODUCTION, "\n".join([head, *rows]), *_menu(effects)]) + "\n"


MODELS_INTRODUCTION = """\
# Effects of models of your own

What a model that a study names in its block `model` may lack: a [Python function](../your_own_model.md) or a
[MuJoCo model](../mujoco_models.md). Behind an `@` stands the place, or a pattern of places: `viscous_damping@elbow`,
`sensor_bias@*_rad`; without it an effect acts on all of its places alike. A diagnosis tries both.

Plausible ranges of parameters with a unit are the declared ones; a MuJoCo model replaces them by the size of its own
forces, speeds and masses."""
OF_MODELS: dict[str, str] = {
    "input": "between the command and the system",
    "output": "between the system and its reading",
    "joint": "at hinges and slides",
    "tendon": "at tendons",
    "body": "at bodies that move",
    "world": "on the whole model",
    "parameter": "a number of the file",
    "state": "a declared effect of the file",
}


def models_catalogue(components: Sequence[Component]) -> str:
    """Return the page on effects of models of a user's own, by their places."""
    effects = [(c, c.implementation_class()) for c in components]
    order = list(OF_MODELS)
    effects.sort(key=lambda pair: (order.index(pair[1].place), pair[0].kind))
    head = (
        "| kind | place | what it is | kinds of models | what to look at on the bench | easily taken for |\n"
        "|---|---|---|---|---|---|"
    )
    rows = [
        f"| [{c.kind}](#{c.kind}) | {e.place} | {c.summary} | {', '.join(c.models)} | {_sentence(e.notes.inspection)} "
        f"| {_link_below(e.notes.confounder, components)} |"
        for c, e in effects
    ]
    parts = [MODELS_INTRODUCTION, "\n".join([head, *rows])]
    for component, effect in effects:
        parts += [f"## {component.kind}", *_model_facts(component, effect, components)]
    return "\n\n".join(parts) + "\n"


def _model_facts(component: Component, effect: type[Effect], components: Sequence[Component]) -> list[str]:
    notes, config = effect.notes, cast(type[EffectConfig], component.config_model())
    numbers = (*config.fit_parameters(), *config.form_parameters())
    rows = [_row(p, config) for p in numbers]
    said = [
        ("Signature", _sentence(notes.signature)),
        ("Told apart", _sentence(notes.distinguishing_test)),
        ("To see it", _sentence(notes.excitation)),
        ("Where", _sentence(notes.where)),
    ]
    about = _sentence(component.summary)
    return [
        f"{about}; it acts {OF_MODELS[effect.place]} ({', '.join(component.models)}).",
        *(["\n".join([HEAD, *rows])] if rows else []),
        *(f"**{word}:** {text}" for word, text in said if text),
    ]


def _link_below(kind: str, components: Sequence[Component]) -> str:
    known = kind in {component.kind for component in components}
    return f"[{kind}](#{kind})" if known else kind or "nothing"


def _origin(effect: type[Effect]) -> str:
    return " (*mistake of the record*)" if effect.notes.origin == "bench" else ""


def facts(component: Component) -> list[str]:
    """Return paragraphs of an effect's page: its place, its parameters, its signature, and the runs that show it."""
    effect: type[Effect] = component.implementation_class()
    notes, config = effect.notes, cast(type[EffectConfig], component.config_model())
    rows = [_row(p, config) for p in (*config.fit_parameters(), *config.form_parameters())]
    where = [f"**Makes sense for** {notes.where}"] if notes.where else []
    if not effect.fitted:
        return [
            "Its numbers are data that are learned as a whole: it acts where they say, and no diagnosis tries it.",
            f"**What gives it away:** {_sentence(notes.signature)}",
            f"**On the bench:** {_sentence(notes.inspection)}",
            f"**Told apart:** {_sentence(notes.distinguishing_test)}",
            f"**To see it:** {_sentence(notes.excitation)}",
            *where,
        ]
    mistake = (
        "It is a mistake of the record, not of the physics: correct the file, and keep the model as it is."
    )
    return [
        f"It acts {PLACES[effect.place]}.",
        *([mistake] if notes.origin == "bench" else []),
        "\n".join([HEAD, *rows]),
        f"**What gives it away:** {_sentence(notes.signature)}",
        f"**On the bench:** {_sentence(notes.inspection)}",
        f"**Easily taken for** {_link(notes.confounder, '')}: {notes.distinguishing_test}",
        f"**To see it:** {_sentence(notes.excitation)} "
        f"Runs of the [menu](../effects.md#runs-of-the-menu): {_runs(effect)}.",
        *where,
    ]


def _menu(effects: Sequence[tuple[Component, type[Effect]]]) -> list[str]:
    """Return a table of the instructions for each run of the default menu, and of the kinds that name it."""
    runs = timed_catalogue(BenchScale.from_chain(sample_chain(payload=0.01), PRESSURE_PA))
    rows = [
        f"| `{run.name}` | {run.words} | {run.needs or 'nothing more'} | "
        f"{', '.join(_link(c.kind) for c, e in effects if run.name in e.recommended_experiments)} |"
        for run in runs
    ]
    return [MENU, "\n".join(["| run | what to do | what it needs | shows |", "|---|---|---|---|", *rows])]


def _runs(effect: type[Effect]) -> str:
    return ", ".join(f"`{name}`" for name in effect.recommended_experiments)


def _row(parameter: EffectParameter, config: type[EffectConfig]) -> str:
    meaning = config.model_fields[parameter.name].description or ""
    meaning = "; ".join([meaning, *(f"at {value:g} {words}" for value, words in parameter.simpler)])
    unit = "" if parameter.unit in ("", "1") else f" {parameter.unit}"

    def span(ends: tuple[float, float]) -> str:
        return f"{ends[0]:g} … {ends[1]:g}{unit}"

    cells = (
        f"`{written_name(config, parameter.name)}`",
        parameter.role,
        f"{parameter.neutral:g}{unit}",
        span(parameter.plausible),
        span(parameter.bounds),
        parameter.prior.replace("_", "-"),
        meaning.replace("|", "\\|"),
    )
    return f"| {' | '.join(cells)} |"


def _place(effect: type[Effect]) -> str:
    return effect.place if effect.fitted else "where it says"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _link(kind: str, folder: str = "effect/") -> str:
    return f"[{kind}]({folder}{kind}.md)" if kind else "nothing"
