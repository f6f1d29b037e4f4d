"""Hostile studies, with too much data or none, are refused with their line, quickly and in little memory."""

import os
import time
import tracemalloc

import pytest
from tests.slow import slow_among

from pliant.config import yaml_file
from pliant.config.loading import load_study, with_override
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant.regular_files import read_regular
from pliant.units import UnitError, parse_quantity
from pliant_search.expressions import MOST, Symbol, parse
from pliant_tables.errors import LONGEST_MESSAGE

REGISTRY = discover()
STUDY = "pliant: 1\nname: hostile\nphysics: quasistatic\n"
BOMB = "x0: &x0 [a, a, a, a, a, a, a, a, a]\n" + "".join(
    f"x{k}: &x{k} [{', '.join([f'*x{k - 1}'] * 9)}]\n" for k in range(1, 9)
)
# Each of these gave a traceback, a hang or no message among 20 000 mutated inputs.
HOSTILE = {
    "alias bomb": (BOMB, "unfolds by its aliases into more than 20000 values"),
    "an alias of itself": ("x: &x [*x]\n", ""),
    "a merge with itself": ("x: &x {<<: *x}\n", ""),
    "a long list": (f"x: [{','.join('1' * 100_000)}]\n", "line 4: the file has more than 20000 values"),
    "many keys": ("".join(f"k{k}: 1\n" for k in range(30_000)), "more than 20000 values"),
    "a large file": (f"# {'a' * 10_000_000}\n", "more than 500 kB"),
    "a long text": (f"x: {'a' * 100_000}\n", "line 4: a text has 100000 characters; 10000 are the most"),
    "a long key": (f"? {'a' * 1000}\n: 1\n", "line 4: a key has 1000 characters; 200 are the most"),
    "brackets": (f"x: {'[' * 5000}", "line 4: blocks are nested too deeply; 64 levels are the most"),
    "braces": (f"x: {'{a: ' * 5000}", "nested too deeply"),
    "a key with a tag": ("!!float x: 1\n", "line 4: a study has no tags such as '!!float'"),
    "a value with a tag": ("x: !!bool y\n", "line 4: a study has no tags such as '!!bool'"),
    "an object": ("x: !!python/object/apply:os.system [echo]\n", "no tags such as '!!python/object/apply:os.system'"),
    "a set": ("x: !!set {a, b}\n", "no tags such as '!!set'"),
    "a stray question": ("?\n", "line 4: there is a key without a word; is there a stray '?'"),
    "a list as a key": ("? [a, b]\n: 1\n", "line 4: a key is a word, not a list"),
    "a block as a key": ("? {a: 1}\n: 1\n", "line 4: a key is a word, not a list or a block"),
    "an alias as a key": ("x: &x a\n*x : 1\n", "a key is a word, not an alias"),
    "a large number": ("task: {kind: free_bending, pressure: 1.0e+300}\n", "line 4: a number is beyond ±1e+30"),
    "a large quantity": ("chain: {module_length: 1e200 m}\n", "beyond ±1e+30, and no quantity is that large"),
    "a long hexadecimal": (f"x: 0x{'f' * 5000}\n", "a number is beyond ±1e+30"),
}  # fmt: skip


@pytest.mark.parametrize("name", slow_among(HOSTILE, "many keys", "a long list", "brackets"))
def test_a_hostile_study_is_refused_soon_in_little_memory_and_few_words(tmp_path, name):
    text, words = HOSTILE[name]
    (tmp_path / "study.yaml").write_text(STUDY + text)
    tracemalloc.start()
    began = time.process_time()
    try:
        with pytest.raises(UserError) as refused:
            load_study(tmp_path / "study.yaml", REGISTRY)
        seconds, peak = time.process_time() - began, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert words in str(refused.value) and "study.yaml" in str(refused.value)
    assert len(str(refused.value)) < LONGEST_MESSAGE
    assert seconds < 10 and peak < 500e6  # tracing slows it down fivefold


@pytest.mark.parametrize("text", ["name=" + "[" * 5000, "name=!!float x", "name=&x [*x]", "name=? "])
def test_an_override_takes_no_more_than_a_file(text):
    try:
        assert isinstance(with_override({"name": "a"}, text)["name"], str)
    except UserError as error:
        assert len(str(error)) < LONGEST_MESSAGE


def test_only_regular_files_are_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", yaml_file.Path("/dev/zero")):
        with pytest.raises(UserError, match="it is a device or a pipe, and only files are read"):
            yaml_file.read_yaml(path)
    (tmp_path / "large").write_bytes(b"x" * 2001)
    with pytest.raises(UserError, match="more than 2 kB, which is the most that a note may have"):
        read_regular(tmp_path / "large", 2000, "a note")
    assert read_regular(tmp_path / "large", 2001, "a note") == b"x" * 2001


def test_a_formula_has_as_many_operators_as_can_be_computed():
    def read(count):
        return parse("+".join(["x"] * (count + 1)), lambda name: Symbol(name, "variable"), "search.objective")

    assert read(MOST).value({"x": 2.0}) == 2 * (MOST + 1)
    assert read(MOST).names == (Symbol("x", "variable"),)
    with pytest.raises(UserError, match="it has 901 operators, and 100 are the most") as refused:
        read(901)
    assert len(str(refused.value)) < 500
    many = parse(f"sum({', '.join(['x'] * 500)})", lambda name: Symbol(name, "variable"), "search.objective")
    assert many.value({"x": 1.0}) == 500


@pytest.mark.parametrize("unit", ["m^10^10^10", "m**9999999999", "m*" * 5000, "m**1e9"])
def test_a_unit_is_looked_up_not_computed(unit):
    with pytest.raises(UnitError):
        parse_quantity(f"1 {unit}", "m")


def test_a_message_repeats_what_was_written_cut_short():
    said = str(UserError(f"unknown kind '{'q' * 100_000}'; did you mean 'mujoco'?"))
    assert len(said) < 150 and said.endswith("did you mean 'mujoco'?")
    assert len(str(UserError("a b " * 100_000))) < LONGEST_MESSAGE
    assert len(str(UserError("line\n" * 100_000))) < LONGEST_MESSAGE


def test_code_in_a_study_announces_itself_before_it_runs(tmp_path):
    (tmp_path / "loud.py").write_text(
        f"open({str(tmp_path / 'ran')!r}, 'w').close()\nraise ValueError('loud')\n"
    )
    (tmp_path / "study.yaml").write_text(STUDY + "plugins: [loud.py]\n")
    said = []

    def note(text):
        said.append((text, (tmp_path / "ran").exists()))

    with pytest.raises(UserError, match="loud"):
        load_study(tmp_path / "study.yaml", REGISTRY, note=note)
    assert (tmp_path / "ran").exists()
    ((text, ran),) = said
    assert "study.yaml runs Python code of its own" in text and "loud.py" in text and not ran
