"""Decks, read back by an independent reader: their content and refused problems. ccx is not needed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_reader import named, read
from pliant_calculix.abaqus import abaqus_deck, abaqus_model
from pliant_calculix.backend import Calculix
from pliant_calculix.command import main
from pliant_calculix.config import CalculixConfig
from pliant_calculix.deck import Target
from pliant_calculix.materials import hyperelastic

from pliant.errors import MissingDependencyError, UserError
from pliant.records.fem import Ribbon

STUDY = """
pliant: 1
name: tube
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 240 kPa}
"""
LONGEST_FIELD = 20  # Abaqus and CalculiX read no more of a number


def test_deck_holds_the_mesh(box: Any, rubber: Any) -> None:
    model = abaqus_model(box, rubber, "C3D20RH")
    cards = read("\n".join(abaqus_deck(model, Target(8e3, 0.075), ["a box"])))
    nodes = {int(w[0]): np.array(w[1:], float) for c in cards if c.keyword == "NODE" for w in c.words}
    body = named(cards, "ELEMENT", TYPE="C3D20RH").words
    caps = named(cards, "ELEMENT", TYPE="C3D15").words
    assert len(body) == len(box.mesh.cells)
    assert all(len(w) == 21 for w in body)
    assert all(len(w) == 16 for w in caps)
    assert {int(n) for w in [*body, *caps] for n in w[1:]} <= nodes.keys()
    # mid-edge nodes of straight elements lie between their corners
    for words in body:
        x = np.array([nodes[int(n)] for n in words[1:]])
        for middle, (a, b) in zip(range(8, 20), ((0, 1), (1, 2), (2, 3), (3, 0)), strict=False):
            np.testing.assert_allclose(x[middle], (x[a] + x[b]) / 2, atol=1e-9)
    start = {int(n) for w in named(cards, "NSET", NSET="START").words for n in w}
    assert all(nodes[n][0] == 0.0 for n in start)
    assert len(start) > len({n for n in start if n <= len(box.mesh.nodes_m)})  # its cap too
    section = {int(n) for w in named(cards, "NSET", NSET="SECTION").words for n in w}
    assert all(nodes[n][0] == pytest.approx(6.0) for n in section)


def test_cavity_is_closed(box: Any, rubber: Any) -> None:
    """The area vectors of corner polygons over the wetted faces and both caps vanish but for the mirror plane's."""
    cards = read("\n".join(abaqus_deck(abaqus_model(box, rubber), Target(0.0, 0.0), ["a box"])))
    nodes = {int(w[0]): np.array(w[1:], float) for c in cards if c.keyword == "NODE" for w in c.words}
    elements = {int(w[0]): [int(n) for n in w[1:]] for c in cards if c.keyword == "ELEMENT" for w in c.words}
    corners = {
        "S1": (0, 1, 2, 3), "S2": (4, 7, 6, 5), "S3": (0, 4, 5, 1),
        "S4": (1, 5, 6, 2), "S5": (2, 6, 7, 3), "S6": (3, 7, 4, 0),
    }  # fmt: skip
    area = np.zeros(3)
    for element, face in named(cards, "SURFACE", NAME="CAVITY").words:
        ids = elements[int(element)]
        order = (0, 1, 2) if len(ids) == 15 else corners[face]
        x = np.array([nodes[ids[k]] for k in order])
        area += sum(np.cross(x[k] - x[0], x[k + 1] - x[0]) / 2 for k in range(1, len(x) - 1))
    # the cavity is 6 mm long and 4 mm high; its half is open toward y = 0
    np.testing.assert_allclose(area, [0.0, 24.0, 0.0], atol=1e-9)


def test_numbers_fit_their_fields(box: Any, rubber: Any) -> None:
    deck = abaqus_deck(abaqus_model(box, rubber), Target(-8e3, -0.123456789012345), ["a box"])
    words = [w.strip() for line in deck if not line.startswith("*") for w in line.split(",")]
    assert max(map(len, words[1:])) <= LONGEST_FIELD
    assert "\n".join(deck).isascii()


def test_plane_equations_turn_a_rigid_section(box: Any, rubber: Any) -> None:
    """A rigid turn of the section about the reference satisfies each of its equations."""
    theta, stretch = 0.2, 0.3
    cards = read("\n".join(abaqus_deck(abaqus_model(box, rubber), Target(0.0, theta), ["a box"])))
    nodes = {int(w[0]): np.array(w[1:], float) for c in cards if c.keyword == "NODE" for w in c.words}
    turn = np.array([[np.cos(theta), 0, np.sin(theta)], [0, 1, 0], [-np.sin(theta), 0, np.cos(theta)]])
    (reference,) = (int(w[0]) for w in named(cards, "NODE", NSET="REFERENCE").words)
    (ramp,) = (int(w[0]) for w in named(cards, "NODE", NSET="TURN").words)
    section = {int(n) for w in named(cards, "NSET", NSET="SECTION").words for n in w}
    moved = {reference: np.array([stretch, 0, 0]), ramp: np.array([1.0, 0, 0])}
    for n in section:
        arm = nodes[n] - nodes[reference]
        moved[n] = turn @ arm - arm + moved[reference]
    checked = 0
    for card in cards:
        if card.keyword == "EQUATION" and int(card.words[1][0]) in section and card.words[1][1] == "1":
            terms = np.array(card.words[1]).reshape(-1, 3)
            assert len(terms) == int(card.words[0][0])
            total = sum(float(c) * moved[int(n)][int(d) - 1] for n, d, c in terms)
            assert total == pytest.approx(0.0, abs=1e-9)
            checked += 1
    assert checked == len(section)


def test_laws_become_cards(build: Any) -> None:
    neo = build("material", kind="neo_hookean", shear_modulus="240 kPa", poisson_ratio=0.45)
    bulk = 2 * 0.24 * 1.45 / (3 * 0.1)
    assert hyperelastic(neo, 1e-6) == ["*HYPERELASTIC, NEO HOOKE", f"0.12, {2 / bulk:.10g}"]
    yeoh = build("material", kind="yeoh", c10="100 kPa", c20="-10 kPa", c30="2 kPa")
    card, numbers = hyperelastic(yeoh, 1e-6)
    assert card == "*HYPERELASTIC, YEOH"
    assert [float(w) for w in numbers.split(",")][:3] == pytest.approx([0.1, -0.01, 0.002])
    assert numbers.count(",") == 5  # three C, three D
    ogden = build("material", kind="ogden", mu=["60 kPa", "20 kPa"], alpha=[1.3, -2.0])
    card, numbers = hyperelastic(ogden, 1e-6)
    assert card == "*HYPERELASTIC, OGDEN, N=2"
    assert [float(w) for w in numbers.split(",")][:4] == pytest.approx([0.06, 1.3, 0.02, -2.0])
    named_rubber = build("material", kind="named", name="natural rubber")
    assert hyperelastic(named_rubber, 1e-6) == hyperelastic(named_rubber.resolved, 1e-6)
    assert hyperelastic(named_rubber, 1e-6)[0] == "*HYPERELASTIC, OGDEN, N=3"


@pytest.mark.parametrize("pa", [1.0, 1e-6])
def test_no_program_default_enters_in_any_unit(build: Any, pa: float) -> None:
    """CalculiX uses D2 = D1² for an omitted D2, which is a different solid in Pa than in MPa (its issue 85)."""
    ogden = build("material", kind="ogden", mu=["60 kPa", "2 kPa", "20 kPa"], alpha=[1.3, 5.0, -2.0])
    _, *rows = hyperelastic(ogden, pa)
    *constants, d1, d2, d3 = [float(word) for row in rows for word in row.split(",")]
    assert constants == pytest.approx([6e4 * pa, 1.3, 2e3 * pa, 5.0, 2e4 * pa, -2.0])
    assert d1 == pytest.approx(2 / (pa * ogden.bulk_modulus_pa))
    # W of the higher powers at J = 1.1 is nothing beside that of the first
    assert max(0.1**4 / d2, 0.1**6 / d3) < 1e-6 * 0.1**2 / d1


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"axes": ("x", "y", "z"), "joint": "spherical"}, "axes x, y, z"),
        ({"actuation": "tendon_force_n"}, "driven by pressure only"),
        ({"ribbons": (Ribbon(0.0, 1.0),)}, "does not know 'ribbons'"),
        ({"stretches": False}, "not inextensible"),
        ({"tied": {"end": (2,)}}, "does not know 'ties'"),
        ({"fixed": {"start": (0,), "end": (0, 2)}}, "stay plane"),
    ],
)
def test_other_modules_are_refused(box: Any, rubber: Any, change: dict[str, Any], says: str) -> None:
    with pytest.raises(UserError, match=says):
        Calculix(CalculixConfig()).solver(replace(box, **change), rubber)


def test_missing_program_and_unknown_law_are_named(box: Any, rubber: Any) -> None:
    with pytest.raises(MissingDependencyError, match="apt install calculix-ccx"):
        Calculix(CalculixConfig(program="no-such-ccx")).solver(box, rubber)
    from pliant.testing.stand_ins import sample_material

    with pytest.raises(UserError, match="no card for material 'ciarlet_sample'; use mooney_rivlin"):
        Calculix(CalculixConfig()).solver(box, sample_material())


def test_command_writes_a_deck(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study, out = tmp_path / "study.yaml", tmp_path / "finger.inp"
    study.write_text(STUDY)
    call = [str(study), "--pressure", "15 kPa", "--angle", "0.3", "--out", str(out)]
    assert main(call) == 0
    assert "u = 0.3 rad" in capsys.readouterr().out
    cards = read(out.read_text())
    assert float(named(cards, "DSLOAD").words[0][2]) == pytest.approx(0.015)
    names = {c.options["NSET"] for c in cards if c.keyword == "NSET"}
    assert names >= {"START", "END", "SYMMETRY", "SECTION"}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (["--pressure", "15 mm"], "a length"),
        (["--element", "C3D8"], "C3D8"),
        (["--out", "/no/such/folder/x.inp"], "cannot be written"),
    ],
)
def test_command_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: list[str], says: str
) -> None:
    study = tmp_path / "study.yaml"
    study.write_text(STUDY)
    call = [str(study), "--pressure", "15 kPa", "--angle", "0.3", "--out", str(tmp_path / "x.inp"), *change]
    assert main(call) == 2
    assert says in capsys.readouterr().err
