"""An effect from a user's file outside the tree: found, listed, checked, run; its mistakes give sentences."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from pliant.cli.verbs import app
from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.records.history import History
from pliant.registry.discovery import discover
from pliant.registry.files import effect_files, load_components, with_files
from pliant.testing.histories import follow_joint, triangles
from pliant.testing.samples import sample_chain

REGISTRY = discover()
EFFECT = '''\
"""Rubber that stiffens at large angles: E'(u) = (1 + a u²) E(u)."""

from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, Model, parameter
from pliant.records.term import LawTerm


class RiseConfig(EffectConfig):
    """a."""

    kind: Literal["rise"] = "rise"
    rise: float = parameter(unit="rad^-2", neutral=0.0, bounds=(0.0, 50.0), plausible=(0.5, 5.0))


class Rise(Effect):
    """Scales the elastic part."""

    place = "law"
    recommended_experiments = ("slow_cycles", "passive_load_steps")
    config: RiseConfig

    def apply(self, model: Model) -> Model:
        return model.with_term(LawTerm("elastic", factor, (self.config.rise,)))


def factor(angle, rate, dt_s, actuation, temperature_c, old, new, parameters):
    return 1.0 + parameters[0] * angle * angle
'''
STUDY = """\
pliant: 1
name: own
plugins: [rise.py]
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 1, module_length: 11 mm, gravity: [0, 0, 0]}
effects: [{kind: rise, rise: 2}]
task: {kind: free_bending, pressure: 15 kPa}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    write(tmp_path)
    return tmp_path


def write(folder: Path, effect: str = EFFECT, study: str = STUDY) -> None:
    folder.mkdir(exist_ok=True)
    (folder / "rise.py").write_text(effect, encoding="utf-8")
    (folder / "own.yaml").write_text(study, encoding="utf-8")


def call(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def simulated(study: str = "own.yaml", *changes: str) -> dict[str, Any]:
    done = call("simulate", study, *changes, "--quiet", "--json", "out.json")
    assert done.exit_code == 0, done.output
    result: dict[str, Any] = json.loads(Path("out.json").read_text(encoding="utf-8"))
    return result


def stored(folder: Path) -> set[str]:
    """Return the keys of the simulations in the store."""
    return {p.name for p in folder.glob(".pliant/store/simulate/*") if p.is_dir()}


def angle(result: dict[str, Any]) -> float:
    """Return the equilibrium of one joint under the worked law with E scaled by 1 + a u²."""
    return float(result["metrics"]["bend_angle_rad"])


def effort(p: float, u: float, rise: float) -> float:
    elastic = -(0.1012 * u * u / 2 + 0.0245 * u)
    return 1.637e-6 * p - 1.704e-6 * p * u + (1 + rise * u * u) * elastic


def test_a_study_runs_with_it(folder: Path) -> None:
    u = angle(simulated())
    assert effort(15e3, u, 2.0) == pytest.approx(0.0, abs=1e-8)
    assert 0.2 < u < 0.35


def test_the_file_is_found_from_the_study_s_folder(folder: Path) -> None:
    write(folder / "inner")
    for name in ("rise.py", "own.yaml"):
        (folder / name).unlink()
    assert (
        simulated("inner/own.yaml") and load_study(Path("inner/own.yaml"), REGISTRY).effects[0].kind == "rise"
    )


def test_a_study_that_extends_another_has_its_files(folder: Path) -> None:
    (folder / "sub").mkdir()
    (folder / "sub" / "child.yaml").write_text("extends: ../own.yaml\nname: child\n")
    assert load_study(folder / "sub" / "child.yaml", REGISTRY).effects[0].kind == "rise"


def test_it_is_listed_beside_ours(folder: Path) -> None:
    for words in (["own.yaml"], ["--file", "rise.py"]):
        assert call("plugins", *words, "--quiet", "--json", "list.json").exit_code == 0
        rows = json.loads((folder / "list.json").read_text())["components"]
        (mine,) = [row for row in rows if row["kind"] == "rise"]
        assert (mine["interface"], mine["package"]) == ("effect", "rise.py")
        assert mine["summary"].startswith("Rubber that stiffens")
        assert {"stiffness", "mullins"} < {row["kind"] for row in rows}


@pytest.mark.slow
def test_it_is_judged_by_the_same_rules(folder: Path) -> None:
    good = call("check", "effect", "rise", "--file", "rise.py")
    assert (good.exit_code, "0 failed, 0 skipped" in good.output) == (0, True), good.output
    write(folder, EFFECT.replace("1.0 + parameters[0]", "1.0 - 2.0 * parameters[0]"))
    bad = call("check", "effect", "rise", "--file", "rise.py")
    assert bad.exit_code == 3
    assert "FAILED   terms_keep_the_joint_stable" in bad.output


def test_checks_that_one_cause_stops_take_one_line(folder: Path) -> None:
    write(folder, EFFECT.replace("place = ", "place_ = "))
    bad = call("check", "effect", "rise", "--file", "rise.py")
    assert bad.exit_code == 3
    assert bad.output.count("skipped  ") == 1 and re.search(r"skipped  \d+ checks", bad.output)


@pytest.mark.slow
def test_diagnose_tries_it_beside_ours_and_finds_it(folder: Path) -> None:
    """The joint of the bench stiffens: each run twice, with loads in both directions, 4 mrad of noise."""
    (component,) = load_components(folder / "rise.py")
    bare = Model(sample_chain(modules=1, gravity=(0, 0, 0)))
    chain = component.build(component.config_model().model_validate({"rise": 4.0})).apply(bare).chain
    random = np.random.default_rng(1)
    lines = ["run,time_s,pressure_pa,moment_n_m,angle_rad"]
    for number, load in enumerate((0.0, 0.0, 3e-3, 3e-3, -3e-3, -3e-3)):
        time_s, pressure = triangles((15e3, 0.0), 1e3, 0.5, holds_s=3.0)
        (u,) = follow_joint(chain, [History.from_arrays({"pressure_pa": pressure}, time_s, moment_n_m=load)])
        u = u + 0.004 * random.standard_normal(len(u))
        lines += [f"r{number},{t},{p},{load},{x}" for t, p, x in zip(time_s, pressure, u, strict=True)]
    (folder / "bench.csv").write_text("\n".join(lines))
    write(folder, study=STUDY.replace("effects: [{kind: rise, rise: 2}]\n", ""))
    done = call("diagnose", "own.yaml", "--data", "bench.csv", "--quiet", "--json", "found.json")
    assert done.exit_code == 0, done.output
    found = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    assert (found["verdict"], found["selected"]) == ("missing_effect", ["rise"])
    assert found["hypotheses"][0]["parameters"]["rise.rise"]["value"] == pytest.approx(4.0, abs=0.3)
    assert {"stiffness", "self_contact"} <= {kind for h in found["hypotheses"] for kind in h["kinds"]}


def test_editing_its_code_computes_anew_and_a_comment_does_not(folder: Path) -> None:
    first = simulated()
    (folder / "rise.py").write_text(EFFECT.replace("class RiseConfig", "# a remark\nclass RiseConfig"))
    keys = stored(folder)
    assert angle(simulated()) == angle(first)
    assert stored(folder) == keys
    (folder / "rise.py").write_text(EFFECT.replace("angle * angle", "abs(angle)"))
    assert angle(simulated()) < angle(first)
    assert len(stored(folder)) == len(keys) + 1


def test_where_it_lies_does_not_matter_to_keys(folder: Path, tmp_path: Path) -> None:
    simulated()
    keys = stored(folder)
    shutil.copytree(folder, tmp_path / "elsewhere", ignore=shutil.ignore_patterns(".pliant", "elsewhere"))
    simulated("elsewhere/own.yaml")
    assert stored(folder) == keys


def test_a_file_is_known_once(folder: Path) -> None:
    once = with_files(REGISTRY, [folder / "rise.py"])
    assert with_files(once, [folder / "rise.py", folder / "rise.py"]) == once
    assert len(once.components) == len(REGISTRY.components) + 1


def test_an_edited_file_is_known_by_its_new_code(folder: Path) -> None:
    write(folder)
    file = folder / "rise.py"
    before = with_files(REGISTRY, [file])
    write(folder, EFFECT.replace("1.0 + parameters", "1.5 + parameters"))
    after = with_files(REGISTRY, [file])
    assert effect_files(REGISTRY) == () and effect_files(after) == effect_files(before) == (str(file),)
    assert after.get("effect", "rise").implementation != before.get("effect", "rise").implementation


def test_a_hook_in_the_file_is_asked(folder: Path) -> None:
    hook = """

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_components():
    return [
        Component("effect", "rise", f"{__name__}:RiseConfig", f"{__name__}:Rise", "by hand", {"rise": 1})
    ]
"""
    write(folder, EFFECT + hook)
    (component,) = load_components(folder / "rise.py")
    assert (component.summary, component.example, component.package) == ("by hand", {"rise": 1}, "rise.py")
    assert simulated()


def test_the_config_may_be_named_by_init_or_be_the_only_one(folder: Path) -> None:
    for changed in (
        EFFECT.replace("    config: RiseConfig\n", ""),
        EFFECT.replace(
            "    config: RiseConfig\n",
            "    def __init__(self, config: RiseConfig) -> None:\n        super().__init__(config)\n",
        ),
        "from __future__ import annotations\n" + EFFECT,
    ):
        write(folder, changed)
        assert load_components(folder / "rise.py")[0].config.endswith(":RiseConfig")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("def factor(", "def factor((", r"rise.py, line 27: this is not Python"),
        ("import LawTerm", "import LawTrem", r"rise.py, line 6: the file fails when it is loaded .*LawTrem"),
        ('    place = "law"', "    place = 1 / 0", r"rise.py, line 19: .*ZeroDivisionError"),
        ('unit="rad^-2", ', "", r"rise.py, line 9: .*RiseConfig.rise: it has no unit"),
        ("(0.5, 5.0)", "(0.5, 500.0)", r"rise.py, line 9: .*RiseConfig.rise: plausible"),
        (
            '    place = "law"',
            "    parameters = ()",
            r"rise.py, line 16: Rise is written for contract 1.*`parameter",
        ),
        ("class Rise(Effect)", "class Rise", "rise.py: it holds no effect; define a subclass of"),
        ("def apply", "def aply", "rise.py: it holds no effect; class Rise has no method apply"),
        ("    config: RiseConfig", "    config: Risen", r"rise.py, line 16: Rise: NameError.*Risen"),
        ("(EffectConfig)", "", r"rise.py, line 16: Rise does not say which config it has"),
        ('Literal["rise"] = "rise"', "str", r"rise.py, line 9: RiseConfig does not say its kind"),
        (
            'Literal["rise"] = "rise"',
            'Literal["mullins"] = "mullins"',
            "effect 'mullins', and pliant .* give yours",
        ),
        ('"""Rubber', 'import sys; sys.exit("no")\n"""Rubber', r"rise.py, line 1: .*SystemExit: no"),
        (EFFECT, "", "rise.py: it holds no effect"),
        (EFFECT, "\0", "rise.py.*this is not Python"),
        (EFFECT, "def pliant_components(): return 3", "rise.py: pliant_components fails .*hookimpl"),
    ],
)
def test_mistakes_in_the_file_are_told_with_their_line(folder: Path, old: str, new: str, says: str) -> None:
    write(folder, EFFECT.replace(old, new))
    with pytest.raises(UserError, match=says):
        with_files(REGISTRY, [folder / "rise.py"])
    refused = call("simulate", "own.yaml")
    assert (refused.exit_code, "Traceback" in refused.output) == (2, False)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("angle * angle", "new[0]", "rise.py, line 28: 'factor' fails (IndexError: "),
        ("LawTerm(", "LawTrem(", "rise.py, line 24: 'apply' fails (NameError: name 'LawTrem'"),
    ],
)
def test_what_fails_while_it_runs_is_told_with_its_line(folder: Path, old: str, new: str, says: str) -> None:
    write(folder, _last_replaced(EFFECT, old, new))
    refused = call("simulate", "own.yaml")
    assert (refused.exit_code, says in " ".join(refused.output.split())) == (2, True), refused.output


def _last_replaced(text: str, old: str, new: str) -> str:
    before, _, after = text.rpartition(old)
    return before + new + after


LINES = EFFECT.splitlines(keepends=True)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sets(st.integers(0, len(LINES) - 1), min_size=1, max_size=3))
def test_a_file_with_lines_missing_is_an_effect_or_a_sentence(folder: Path, missing: set[int]) -> None:
    write(folder, "".join(line for number, line in enumerate(LINES) if number not in missing))
    try:
        (component,) = load_components(folder / "rise.py")
    except UserError as error:
        assert str(error).startswith("rise.py")
        assert str(error).endswith(".")
    else:
        assert component.interface == "effect"


@pytest.mark.slow
def test_a_term_that_cannot_be_compiled_is_told_by_the_check(folder: Path) -> None:
    write(folder, EFFECT.replace("angle * angle", "float(str(angle)) ** 2"))
    checked = call("check", "effect", "rise", "--file", "rise.py")
    assert checked.exit_code == 3
    assert "rise.py, line 27: the law term 'factor' cannot be compiled" in " ".join(checked.output.split())


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            "plugins: [rse.py]",
            r"own.yaml, line 3: 'plugins' names .*rse.py, which is no file; did you mean 'rise.py'",
        ),
        ("plugins: rise.py", r"own.yaml, line 3: 'plugins' needs a list of Python files"),
        ("plugins: [3]", r"own.yaml, line 3: 'plugins' needs a list"),
        ("plugins: [own.yaml]", r"own.yaml, line \d+: this is not Python"),
        ("plugins: []", r"own.yaml, line 10: unknown effect kind 'rise'"),
        ("plugins: ['']", r"which is no file"),
    ],
)
def test_a_wrong_plugins_key_is_refused(folder: Path, line: str, says: str) -> None:
    write(folder, study=STUDY.replace("plugins: [rise.py]", line))
    with pytest.raises(UserError, match=says):
        load_study(folder / "own.yaml", REGISTRY)


def test_a_missing_file_on_the_command_line_is_refused(folder: Path) -> None:
    for words in (["plugins", "--file", "no.py"], ["check", "effect", "rise", "--file", "no.py"]):
        refused = call(*words)
        assert (refused.exit_code, "no.py: no such file" in refused.output) == (2, True)


def test_an_override_names_a_file_from_here(folder: Path) -> None:
    (folder / "other").mkdir()
    (folder / "other" / "rise.py").write_text(EFFECT.replace("angle * angle", "abs(angle)"))
    assert angle(simulated("own.yaml", "plugins=[other/rise.py]")) < angle(simulated())
