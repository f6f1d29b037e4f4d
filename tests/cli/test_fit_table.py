"""`pliant fit TABLE.csv`: one command gives a law, a study, or a one-sentence refusal from any table of states."""

import json
import re

import numpy as np
import pytest

from pliant import formatting
from pliant.fem_tables.writing import write_table
from pliant.testing.samples import sample_table, softening_law

HEAD = "pressure_pa,angle_rad,moment_n_m\n"


def states(noise=0.0):
    random = np.random.default_rng(1)
    law = softening_law()
    p, u = (g.ravel() for g in np.meshgrid(np.linspace(0, 15e3, 6), np.linspace(-0.2, 0.5, 8)))
    tau = law.evaluate(p, u[:, None]).tau[:, 0]
    return p, u, tau + noise * np.ptp(tau) * random.normal(size=len(p))


def written(folder, noise=0.0, sign=1.0):
    rows = [f"{p},{u},{sign * m}" for p, u, m in zip(*states(noise), strict=True)]
    (folder / "bench.csv").write_text(HEAD + "\n".join(rows))


def test_a_table_becomes_a_law_with_its_errors(pliant, workplace):
    written(workplace)
    done = pliant("fit", "bench.csv", "--json", "fit.json").done()
    found = json.loads((workplace / "fit.json").read_text())
    assert found["command"] == "fit"
    assert set(found["heldout"]) >= {"rmse", "worst", "worst_of_range", "r2"}
    assert found["heldout"]["worst_of_range"] < 5e-3
    assert found["domain"]["actuation"] == [0, 15e3]
    assert found["unstable"] == []
    for word in (
        "worst error",
        "the published form",
        "pressure 0 to 15 kPa",
        "90 %",
        "falls with u everywhere",
    ):
        assert word in done.out


@pytest.mark.slow
def test_the_torque_display_unit_changes_everywhere_from_one_table(pliant, workplace, monkeypatch):
    """The terminal, the page and its tables show the display unit; JSON stays in SI."""
    written(workplace)
    usual = pliant("fit", "bench.csv", "--out", "usual", "--no-learning", "--json", "usual.json")
    monkeypatch.setitem(formatting.DISPLAY, "N*m", formatting.Unit("N·cm", 100.0))
    done = pliant("fit", "bench.csv", "--out", "law", "--no-learning", "--json", "law.json", "--store", "s")
    for old, new in (
        (usual.out, done.out),
        ((workplace / "usual/fit.html").read_text(), (workplace / "law/fit.html").read_text()),
    ):
        assert "mN·m" in old and "N·cm" not in old
        assert "N·cm" in new and "mN·m" not in new
    kept = [json.loads((workplace / f"{name}.json").read_text())["heldout"] for name in ("usual", "law")]
    assert kept[0] == kept[1]


@pytest.mark.slow
def test_the_written_study_runs(pliant, workplace):
    written(workplace)
    assert pliant("fit", "bench.csv", "--kind", "table", "--out", "law", "--quiet").code == 0
    assert json.loads((workplace / "law" / "fit.json").read_text())["kind"] == "table"
    done = pliant("simulate", "law/study.yaml", "chain.modules=3").done()
    assert "settled" in done.out
    study = workplace / "law" / "study.yaml"
    study.write_text(study.read_text().replace("modules: 1 ", "modules: 4 "))
    pliant("fit", "bench.csv", "--out", "law").refused("is there already, of another law")
    again = pliant("fit", "bench.csv", "--kind", "table", "--out", "law", "--no-learning").done()
    assert "kept as it was" in again.out
    assert "modules: 4 " in study.read_text()


def test_a_table_that_cannot_be_fitted_leaves_no_folder(pliant, workplace):
    (workplace / "bench.csv").write_text(HEAD + "0,0,0\n")
    assert pliant("fit", "bench.csv", "--out", "law").code == 2
    assert not (workplace / "law").exists()


@pytest.mark.slow
def test_the_study_on_a_suction_law_is_driven_by_suction(pliant, workplace):
    p, u, moment = states()
    rows = [f"{-a},{b},{m}" for a, b, m in zip(p, u, moment, strict=True)]
    (workplace / "bench.csv").write_text(HEAD + "\n".join(rows))
    done = pliant("fit", "bench.csv", "--out", "law", "--no-learning")
    assert "pressure −15 to 0 kPa\n" in done.out
    assert "pressure: -15000}" in (workplace / "law" / "study.yaml").read_text()


def test_a_reversed_sign_is_said_and_the_notes_repair_it(pliant, workplace):
    written(workplace, sign=-1.0)
    done = pliant("fit", "bench.csv", "--json", "fit.json")
    assert "unstable axis y" in done.out
    assert json.loads((workplace / "fit.json").read_text())["unstable"][0]["slope"] > 0
    (workplace / "bench.yaml").write_text("moment: sign reversed\n")
    assert "falls with u everywhere" in pliant("fit", "bench.csv").out


def two_chambers(n=60, seed=2):
    """Return states of τ = g (p₁ − p₂) − k u + c (p₁ + p₂) u at random pressures and angles of a bench, (n, 4)."""
    p = np.random.default_rng(seed).uniform(0, 15e3, (n, 2))
    u = np.random.default_rng(seed + 1).uniform(-0.4, 0.4, n)
    return np.column_stack([p, u, 2e-6 * (p[:, 0] - p[:, 1]) - 0.04 * u - 3e-7 * p.sum(axis=1) * u])


def test_a_table_with_several_pressures_becomes_a_law_that_drives_a_chain(pliant, workplace):
    rows = "\n".join(",".join(map(repr, map(float, row))) for row in two_chambers())
    (workplace / "bench.csv").write_text(f"pressure_1_pa,pressure_2_pa,angle_rad,moment_n_m\n{rows}\n")
    done = pliant("fit", "bench.csv", "--out", "law", "--no-learning").done()
    assert "pressure 1 0" in done.out and "falls with u everywhere" in done.out
    assert "% of them lie in it" in done.out  # the law has an error bar, which is evaluated here
    found = json.loads((workplace / "law/fit.json").read_text())
    assert found["parameters"]["actuation_name"] == "pressure_1_pa, pressure_2_pa"
    assert found["heldout"]["worst_of_range"] < 1e-6
    study = workplace / "law" / "study.yaml"
    assert "inputs: {pressure_1_pa: 1" in study.read_text()
    pushed = ("task.inputs.pressure_1_pa=12 kPa", "task.inputs.pressure_2_pa=4 kPa", "--json", "-")
    settled = json.loads(pliant("simulate", "law/study.yaml", *pushed).done().out)
    # g Δp = (k + c Σp) u
    assert settled["joint_angles_rad"][0] == pytest.approx(2e-6 * 8e3 / (0.04 + 3e-7 * 16e3), rel=1e-6)


@pytest.mark.slow
def test_a_table_with_all_axes_is_fitted_as_a_whole(pliant, workplace):
    from tests.pipeline.test_tables import module

    data = module(("x", "y", "z"), "y", n=48, seed=3)
    stiff = -0.03 * np.eye(3)
    data.deformation[:] *= 0.1
    data.energy_j[:] = data.travel[:] = np.nan
    data.dtau_du[:] = stiff
    data.dtau_dp[:] = [0.0, 1e-6, 0.0]
    data.tau[:] = data.deformation @ stiff + data.actuation[:, None] * data.dtau_dp
    write_table(data, workplace / "axes.csv")
    pliant("fit", "axes.csv", "--json", "fit.json").done()
    found = json.loads((workplace / "fit.json").read_text())
    assert found["parameters"]["axes"] == ["x", "y", "z"]
    assert found["heldout"]["worst_of_range"] < 1e-3


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "the table is empty"),
        (HEAD + "0,0,0\n1000,0.1,0\n", "bench.csv: a polynomial law needs at least 6 states"),
        (HEAD + "0,0,0\n1000,zero,0\n", "line 3, column angle_rad: 'zero' is not a number"),
        (
            "pressure,angle_rad,moment_n_m\n1000,0.1,0\n",
            "column 'pressure_pa' or 'tendon_force_n' is missing",
        ),
        (HEAD + "".join(f"{p},{p / 50},{p * 1e-3}\n" for p in range(9)), "is it in kPa\\?"),
    ],
)
def test_what_is_wrong_is_one_message(pliant, workplace, text, sentence):
    (workplace / "bench.csv").write_text(text)
    done = pliant("fit", "bench.csv").refused()
    assert re.search(sentence, done.err)
    assert "Traceback" not in done.err


@pytest.mark.slow
def test_what_is_for_tables_only_is_refused_for_studies(pliant, workplace):
    (workplace / "study.yaml").write_text("pliant: 1\nname: a\n")
    pliant("fit", "study.yaml", "--compare").refused("--compare is for a table")
    written(workplace)
    assert "changes a study" in pliant("fit", "bench.csv", "surrogate.form=study").err
    assert "kind 'tabel'" in pliant("fit", "bench.csv", "--kind", "tabel").err


def test_a_folder_is_not_called_as_a_file(pliant, workplace):
    pliant("fit", "bellow.csv", "--out", "law.yaml").refused("law.yaml is called as a file", "say law,")


def test_a_pdf_is_no_table(pliant, workplace):
    (workplace / "paper.pdf").write_bytes(b"%PDF-1.7\n")
    assert "it is a PDF" in pliant("fit", "paper.pdf").err


def test_shipped_slopes_are_used(pliant, workplace):
    write_table(sample_table(softening_law()), workplace / "fem.csv")
    assert pliant("fit", "fem.csv", "--kind", "table").code == 0
