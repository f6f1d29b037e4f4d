"""A package that breaks anywhere is skipped with a note by every verb, and nothing else changes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from tests.plugins.broken import EFFECT_WAYS, SURROGATE_WAYS, WAYS, lay, lay_package
from typer.testing import CliRunner, Result

from pliant.cli.verbs import app
from pliant.registry.discovery import discover, left_out


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def answer(*arguments: str) -> tuple[dict[str, Any], str]:
    """Return the JSON of a verb that succeeds, and its whole output in one line."""
    done = call(*arguments, "--json", "answer.json")
    assert done.exit_code == 0, (done.output[-2000:], done.exception)
    result: dict[str, Any] = json.loads(Path("answer.json").read_text())
    return result, " ".join(done.output.split())


VERBS: dict[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    # verb → its arguments, ways of which it needs a note, keys of its JSON that do not change
    "diagnose": (
        ("diagnose", "joint.yaml", "--no-page"),
        tuple(EFFECT_WAYS),
        ("verdict", "selected", "hypotheses", "credible_set", "not_excited"),
    ),
    "improve": (("improve", "joint.yaml", "--force"), tuple(EFFECT_WAYS), ("steps", "verdict")),
    "plan": (("plan", "joint.yaml"), tuple(EFFECT_WAYS), ("verdict", "runs")),
    "fit --compare": (("fit", "fem.csv", "--compare"), tuple(SURROGATE_WAYS), ("heldout", "parameters")),
    "plugins": (("plugins",), (), ("components",)),
    "schema": (("schema",), (), ("schema",)),
    "check": (("check", "material", "neo_hookean"), (), ("passed", "failed")),
}


SLOW = ("diagnose", "improve", "fit --compare")  # `plan` diagnoses, too
PARAMETERS = [pytest.param(verb, marks=pytest.mark.slow) if verb in SLOW else verb for verb in VERBS]


@pytest.mark.parametrize("verb", PARAMETERS)
def test_a_verb_goes_on_without_what_breaks(site: Path, verb: str) -> None:
    arguments, noted, kept = VERBS[verb]
    before, _ = answer(*arguments)
    names = {way: lay(site, way) for way in WAYS}
    after, said = answer(*arguments)
    for way in noted:
        # the terminal shows the first notes, the page and the JSON all of them
        assert names[way] in said or names[way] in str(after.get("remarks")), f"no note on {way}"
    lists = verb in ("plugins", "schema")  # they list packages with no known error
    for key in set(kept) & set(before):
        assert _contains(after[key], before[key]) if lists else after[key] == before[key], key
    assert set(kept) & set(before)


def _contains(after: Any, before: Any) -> bool:
    """Return whether JSON values contain all values of others."""
    if isinstance(before, dict):
        return all(key in after and _contains(after[key], value) for key, value in before.items())
    if isinstance(before, list):
        return all(any(_contains(one, value) for one in after) for value in before)
    return bool(after == before)


@pytest.mark.parametrize("way", EFFECT_WAYS)
def test_a_study_that_names_it_ends_with_a_sentence(site: Path, way: str) -> None:
    name = lay(site, way)
    text = Path("joint.yaml").read_text()
    task = "task: {kind: free_bending, pressure: 15 kPa}"
    Path("named.yaml").write_text(f"{text}effects: [{{kind: {name}, share: 0.2}}]\n{task}\n")
    done = call("simulate", "named.yaml")
    if way not in ("unsuited_raises", "unsuited_returns_none", "term_cannot_be_compiled"):
        assert done.exit_code == 2, done.output
        assert name in done.output or "key 'effects.0.other' is missing" in done.output
    assert "Traceback" not in done.output
    assert done.exception is None or isinstance(done.exception, SystemExit)


def test_the_sentence_names_package_method_cause_and_line(site: Path) -> None:
    lay(site, "apply_raises")
    said = " ".join(call("diagnose", "joint.yaml", "--no-page").output.split())
    assert re.search(
        r"effect 'broken_apply_raises' of broken_apply_raises 0.1: 'apply' fails \(AttributeError: .*nothing'; "
        r".*work.py, line 9\)",
        said,
    ), said


GAIN = """\
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_components():
    c = "{name}.config:Config"
    return [{components}]
"""
CONFIG = """\
from typing import Literal
from pliant.interfaces.effect import EffectConfig, parameter


class Config(EffectConfig):
    kind: Literal["{kind}"] = "{kind}"
    share: float = parameter(unit="1", neutral=0.0, bounds=(0.0, 1.0), plausible=(0.1, 0.5))
"""


def lay_gain(site: Path, name: str, kind: str, places: tuple[str, ...]) -> None:
    components = ", ".join(
        f'Component("effect", "{kind}", c, "{name}.{place}", "a gain")' for place in places
    )
    texts = {"__init__.py": "", "config.py": CONFIG.format(kind=kind)}
    lay_package(site, name, {**texts, "manifest.py": GAIN.format(name=name, components=components)})


def test_an_effect_that_a_package_shadows_is_said_by_the_diagnosis(site: Path) -> None:
    lay_gain(site, "mine", "stiffness", ("work:Work",))
    result, said = answer("plan", "joint.yaml")
    assert "effect 'stiffness' of pliant 0.1.0 and mine 0.1: the kind is" in said
    assert "defined twice, so that none of them is used" in said
    assert [failure["name"] for failure in result["left_out_plugins"]] == ["effect 'stiffness'"]


def test_a_broken_package_shadows_nothing(site: Path) -> None:
    lay_gain(site, "mine", "stiffness", ("work:Work",))
    (site / "mine" / "config.py").write_text("1 / 0\n")
    registry = discover()
    assert registry.get("effect", "stiffness").shipped
    assert [failure.package for failure in left_out(registry, ("effect",))] == ["mine 0.1"]


def test_two_in_one_package_are_distinguished_by_their_places(site: Path) -> None:
    lay_gain(site, "twice", "two", ("one:Work", "other:Work"))
    done = call("check", "effect", "two")
    assert done.exit_code == 2
    assert (
        "defined by twice.one:Work (twice 0.1) and twice.other:Work (twice 0.1); give one of them another kind"
        in (" ".join(done.output.split()))
    )
