"""The page of a fit: its numbers are those of the report, its pictures are present, limits of the law are stated."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from tests.report.pages import check_sound, words

from pliant.errors import UserError
from pliant.fem_tables.writing import write_table
from pliant.formatting import number, percent, seconds
from pliant.pipeline.learning import learning_curve
from pliant.pipeline.reported_law import ReportedLaw, fitted_designs, fitted_law, least_stable, slope_grid
from pliant.pipeline.residuals import as_module_data
from pliant.pipeline.segments import DesignSpec, DesignStages
from pliant.pipeline.surrogate import LawStage, law_stage
from pliant.pipeline.workbench import RunContext
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain
from pliant.registry.discovery import discover
from pliant.report.document import page_table
from pliant.report.fit import (
    bar_section,
    comparison_section,
    fit_document,
    fit_sentence,
    fit_warnings,
    stored_fit_page,
)
from pliant.report.fit_page import (
    SURROGATES,
    axes_table,
    choice_table,
    cost_table,
    coverage_chart,
    coverage_table,
    errors_table,
    residual_chart,
    slope_chart,
)
from pliant.report.learning_chart import learning_table
from pliant.report.render import page
from pliant.report.stage import write_page
from pliant.report.still import still
from pliant.store.store import ArtifactStore
from pliant.testing.samples import barred_law, linear_law, sample_table, softening_law
from pliant_designs.samples import solved_designs, solved_spherical_designs, spherical_sample_law
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.45]]))
SIZE = 2e-4


@cache
def fitted() -> ReportedLaw:
    """Return a polynomial of the worked law with scatter, and its learning curve."""
    surrogate = Polynomial(PolynomialConfig(kind="polynomial", max_degree=3))
    data = as_module_data(sample_table(softening_law(), noise_n_m=3e-5))
    made = surrogate.fit_module(data)
    data = replace(data, wall_s=np.full(len(data), 0.5), iterations=np.full(len(data), 4))
    learning = learning_curve(surrogate, data)
    return ReportedLaw("bellow", "polynomial", made.law, made.report, data, 0.25, learning)


@cache
def barred() -> ReportedLaw:
    """Return a linear law whose states deviate from it by normal errors of exactly the size of its bar."""
    law = barred_law(linear_law(), BOX, SIZE, seed=2)
    data = as_module_data(sample_table(linear_law()))
    random = np.random.default_rng(3)
    n = 400
    p, u = 15e3 * random.random(n), -0.2 + 0.65 * random.random((n, 1))
    tau = linear_law().evaluate(p, u).tau + SIZE * random.standard_normal((n, 1))
    many = {
        "actuation": p, "deformation": u, "tau": tau, "role": np.full(n, "check"), "explored": np.full(n, "y"),
        "status": np.full(n, "ok"), "branch": np.full(n, "constrained"),
    }  # fmt: skip
    rest = {name: np.zeros(n) for name in ("energy_j", "travel", "iterations", "wall_s")}
    slopes = {"dtau_dp": np.zeros((n, 1)), "dtau_du": np.zeros((n, 1, 1))}
    data = replace(data, **many, **rest, **slopes)
    return ReportedLaw("linear", "sample", law, fitted().report, data, 0.1)


def written(context: RunContext, title: str, laws: list[ReportedLaw], folder: Path) -> Path:
    document = fit_document(title, laws, {"name": title}, {}, [])
    made = stored_fit_page(context, document, laws, {"name": title}).render(document)
    return write_page(folder, made.html, made.pictures, document.page)


def test_the_page_holds_every_part_and_nothing_from_outside() -> None:
    made = page(fit_document("a <law>", [fitted()], {"name": "x"}, {}, []))
    text = check_sound(made)
    assert set(made.pictures) == {"fit_law", "fit_map", "fit_bars", "fit_learning", "fit_slopes"}
    first, second = (still(coverage_chart(barred().coverage)).tobytes() for _ in range(2))
    assert first == second
    with warnings.catch_warnings():  # a constant slope is drawn as one colour
        warnings.simplefilter("error")
        assert len(still(slope_chart(barred())).tobytes()) > 5_000
    assert "a &lt;law&gt;" in made.html and fit_sentence(fitted()) in text
    assert "8.26 %" in text and "Yao, Howard, Maiolino" in text


def test_errors_are_the_reports_own() -> None:
    one = fitted()
    rows = {row[0]: row[1:] for row in errors_table(one).rows}
    told = rows[f"polynomial ({one.report.n_fitted} states fitted)"]
    assert told[0] == str(one.report.n_heldout)
    assert told[1] == number(1e3 * one.report.rmse, 3)
    assert told[3] == percent(one.report.worst_of_range, 3)
    form = one.report.details["study_form"]
    assert rows["the published form, least squares"][3] == percent(form["worst_of_range"], 3)
    assert percent(one.report.worst_of_range) in fit_sentence(one)
    assert one.misses.rows(one.misses.check).worst == pytest.approx(one.report.worst_of_range, rel=1e-9)
    assert any("published study" in name for name in rows)
    tendon = replace(one.law, actuation_name="tendon_force_n")
    assert not any("published study" in row[0] for row in errors_table(replace(one, law=tendon)).rows)


def test_the_studys_form_is_scored_here_where_the_report_has_none() -> None:
    bare = replace(fitted().report, details={"form": "other"})
    assert replace(fitted(), report=bare).study_misses == {}
    study = Polynomial(PolynomialConfig(kind="polynomial", form="study")).fit_module(fitted().data).law
    beside = replace(fitted(), report=bare, study_law=study)
    found = beside.study_misses["the published form, least squares"]
    assert found.rows(found.check).worst == pytest.approx(
        fitted().report.details["study_form"]["worst_of_range"], rel=1e-6
    )
    assert any(row[0].startswith("the published form") for row in errors_table(beside).rows)


def test_honest_bars_cover_what_they_state() -> None:
    (curve,) = barred().coverage
    assert curve.n == 400
    assert curve.covered == pytest.approx(curve.levels, abs=0.08)
    table = coverage_table([curve])
    assert table is not None and table.rows[0][1] == "400"
    assert table.rows[0][6] == percent(curve.at(0.9), 3)
    narrow = replace(barred().law, error=replace(barred().law.error, misses=0.1 * barred().law.error.misses))
    assert replace(barred(), law=narrow).coverage[0].at(0.9) < 0.4


def test_a_law_without_bars_says_so() -> None:
    bare = replace(barred(), law=replace(barred().law, error=None))
    assert bare.coverage == [] and coverage_table([]) is None
    assert any("no error bar" in one.sentence for one in fit_warnings(bare))
    assert bar_section(bare) is None and bar_section(barred()) is not None


def test_an_unstable_law_is_warned_about_with_its_worst_slope() -> None:
    soft = replace(barred().law, stiffness=np.array([[-0.01]]))
    assert least_stable(soft) == pytest.approx(0.01)
    assert least_stable(barred().law) == pytest.approx(-0.04)
    assert any("unstable" in one.sentence for one in fit_warnings(replace(barred(), law=soft)))
    assert not any("unstable" in one.sentence for one in fit_warnings(barred()))
    p, u, slopes = slope_grid(barred().law, "y")
    assert (p[0], u[-1]) == (0.0, 0.45) and np.allclose(slopes, -0.04)


def test_the_choice_lists_every_candidate_with_one_chosen() -> None:
    table = choice_table(fitted(), "y")
    found = fitted().report.details["cross_validation"]
    assert table is not None and len(table.rows) == len(found)
    assert [row[-1] for row in table.rows].count("chosen") == 1
    assert choice_table(replace(fitted(), report=replace(fitted().report, details={})), "y") is None


def test_learning_and_cost_equal_the_records() -> None:
    table = learning_table(fitted().learning)
    last = next(row for row in table.rows if row[0] == "42")
    points = {p["slopes"]: p for p in fitted().learning["points"] if p["n"] == 42}
    assert last[1:] == [
        percent(points[s][k]) for s in ("with slopes", "without slopes") for k in ("rms", "worst")
    ]
    assert "at 10 check states" in table.note and "Too few to fit: 4" in table.note
    quick = replace(fitted())
    quick.__dict__["per_second"] = 4e6
    cost = {row[0]: row[1] for row in cost_table(quick).rows}
    assert cost["solver, all states"] == "26.0 s (0.5 s a state)"
    assert cost["evaluations with slopes"] == "4 million a second"
    assert cost["one FEM state costs as much as"] == "2.0·10⁶ evaluations"


def test_surrogates_stand_side_by_side() -> None:
    rows = page_table("", SURROGATES, [fitted(), replace(barred(), name="other")]).rows
    assert [row[0] for row in rows] == ["bellow", "other"]
    section = comparison_section([fitted(), replace(barred(), name="other")])
    assert section is not None and len(section.tables[0].rows) == 2 and len(section.pictures) == 1
    assert comparison_section([fitted()]) is None


@cache
def spherical() -> ReportedLaw:
    """Return the exact law of three coupled axes, with a tenth of an error put on axis z."""
    designs = solved_spherical_designs((2, 2))
    data, law = designs.data[0], spherical_sample_law(designs.values[0])
    data = replace(data, tau=data.tau + np.array([0.0, 0.0, 1e-4]) * (data.explored == "z")[:, None])
    return ReportedLaw("three", "sample", law, fitted().report, data, 0.1)


def test_three_axes_are_told_apart() -> None:
    table = axes_table(spherical().data, spherical().law, spherical().ranges)
    assert table is not None
    worst = {row[0]: row[-1] for row in table.rows}
    assert worst["z"] == "0.1"
    assert float(worst["x"].replace("·10⁻", "e-").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789"))) < 1e-6
    assert len(still(residual_chart(spherical())).tobytes()) > 10_000


@pytest.mark.slow
def test_the_stage_writes_the_page_once_and_refuses_a_stated_law(tmp_path: Path) -> None:
    context = RunContext(discover(), ArtifactStore(tmp_path / "store"))
    write_table(sample_table(softening_law(), noise_n_m=3e-5), tmp_path / "bench.csv")
    config = PolynomialConfig(kind="polynomial", data=tmp_path / "bench.csv", max_degree=2)
    law = law_stage(context, config, None)
    made = fitted_law(context, "bench", config, law, learning=False, source="bench.csv")
    file = written(context, "bench", [made], tmp_path)
    assert file.name == "fit.html" and not (tmp_path / "pictures").exists()
    text = words(file.read_text())
    assert f"within {percent(law.report.worst_of_range)} of bench.csv on 10 states left out" in text
    first = file.read_bytes()  # it contains times that were measured then
    again = fitted_law(context, "bench", config, law, learning=False, source="bench.csv")
    assert written(context, "bench", [again], tmp_path).read_bytes() == first
    with pytest.raises(UserError, match="stated by its coefficients"):
        fitted_law(context, "stated", config, LawStage(softening_law(), None, None, None))


def test_bars_on_several_axes_are_pooled_first() -> None:
    law = spherical().law
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    random = np.random.default_rng(0)
    places = box[:, 0] + np.ptp(box, axis=1) * random.random((80, 4))
    bar = ErrorBar.from_residuals(box, places[:, 0], places[:, 1:], 1e-4 * random.standard_normal((80, 3)))
    object.__setattr__(law := replace(law), "error", bar)
    data = replace(spherical().data, role=np.full(len(spherical().data), "check"))
    curves = replace(spherical(), law=law, data=data).coverage
    assert [c.label for c in curves] == ["all axes", "axis x", "axis y", "axis z"]
    assert curves[0].n == sum(c.n for c in curves[1:])


def test_one_table_for_each_axis_makes_one_page(tmp_path: Path) -> None:
    context = RunContext(discover(), ArtifactStore(tmp_path / "store"))
    stiffness = {"x": 0.05, "y": 0.04, "z": 0.06}
    for axis, k in stiffness.items():
        write_table(replace(sample_table(linear_law(stiffness=k)), axis=axis), tmp_path / f"{axis}.csv")
    axes = {axis: {"data": tmp_path / f"{axis}.csv", "max_degree": 2} for axis in stiffness}
    config = PolynomialConfig.model_validate({"kind": "polynomial", "axes": axes})
    law = law_stage(context, config, None)
    one = fitted_law(context, "three", config, law, source="three tables")
    assert one.learning is None  # the surrogate is fitted by table, not by states of all axes
    assert one.data.axes == ("x", "y", "z") and one.data.main_axis == "y"
    assert one.misses.worst < 1e-9 and len(one.misses.state) == 3 * 52
    table = axes_table(one.data, one.law)
    assert table is not None and [row[0] for row in table.rows][:3] == ["x", "y", "z"]


@pytest.mark.slow
def test_a_design_solved_by_fem_gets_its_page_with_the_solvers_time(tmp_path: Path) -> None:
    context = RunContext(discover(), ArtifactStore(tmp_path / "store"))
    data = solved_designs((2, 2)).data[0]
    data = replace(data, wall_s=np.full(len(data), 0.5), iterations=np.full(len(data), 3))
    fem = context.make("fem", lambda partial: data, components=[], modules=[], config={}, inputs={})
    config = PolynomialConfig(kind="polynomial", max_degree=3)
    stages = DesignStages(DesignSpec(None, config), fem, law_stage(context, config, fem))
    (solved,) = fitted_designs(context, [stages], learning=False)
    assert solved.source == "FEM" and len(solved.data) == len(data)
    text = words(written(context, "solved", [solved], tmp_path).read_text())
    assert seconds(0.5 * len(data)) in text and "of FEM on" in text
