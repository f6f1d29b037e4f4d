"""The report page: it says what it was given, copes with what is missing, and needs nothing from outside."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.report.pages import check_sound, words

from pliant.records.law import Domain
from pliant.report.document import Page
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.render import page as page_of
from pliant.report.run import run_document

FREE = 0.36  # rad per joint, of conftest.py


def render(run: FinishedRun) -> Page:
    return page_of(run_document(run))


@pytest.fixture(scope="module")
def whole(kit: Any) -> FinishedRun:
    return kit.full_run()


@pytest.fixture(scope="module")
def flat(kit: Any, whole: FinishedRun) -> FinishedRun:
    """The same run without shapes: no bodies to draw, hence quick."""
    return replace(
        whole, designs=(DesignResult("flat", kit.dataset(shapes=False), kit.PlainLaw(), kit.fit_report()),)
    )


@pytest.fixture(scope="module")
def page(whole: FinishedRun) -> Page:
    return render(whole)


def test_page_is_self_contained_and_texts_are_escaped(page: Page) -> None:
    check_sound(page)
    assert "<script>" not in page.html and "diverged &lt;here&gt;" in page.html
    assert set(page.pictures) == {"finger", "module_shape", "law", "chain_pose"}


def test_page_says_what_it_was_given(page: Page) -> None:
    text = words(page.html)
    assert f"8-module finger bends {np.degrees(8 * FREE):.1f}° at 15 kPa" in text
    assert "two engines agree within" in text and "law within 0.17 % of FEM" in text
    numbers = ("0.035", "1.23 %", "0.9999870", "12.5 s", "3 ×", "1.5 mm", "15 kPa", "2026-01-02 03:04:05 UTC")
    made = ("c0ffeec0ffee", "scikit-fem 12.0", "numpy 2.4", "Python 3.11.7", "pliant 0.1.0", "Linux")
    for shown in (*numbers, *made):
        assert shown in text, shown


def test_warnings_name_every_limit(page: Page) -> None:
    text = words(page.html)
    assert "mujoco used the law outside its domain at 2 places" in text
    assert "module 3: pressure_pa by 0.25 kPa" in text and "module 2: y by 1.15°" in text
    assert "2 of 35 states have touching convolutions" in text
    assert "9 kPa, 22.9°: diverged <here>" in text
    assert "Engine pybullet was skipped: pybullet has no wheel for this Python" in text
    assert "The study sets sweep" in text


def test_same_run_same_bytes(whole: FinishedRun, page: Page) -> None:
    again = render(whole)
    assert again.html == page.html
    assert all(np.array_equal(again.pictures[name], png) for name, png in page.pictures.items())


def test_stated_law_without_fem(kit: Any, whole: FinishedRun) -> None:
    law = kit.PlainLaw(domain=Domain.unbounded(1))
    run = replace(whole, designs=(DesignResult("stated", None, law, None),), summary={})
    page = render(run)
    text = check_sound(page)
    assert set(page.pictures) == {"finger", "law", "chain_pose"}
    assert "the law is stated by its coefficients" in text and "b_e = 0.0245" in text


def test_data_from_elsewhere_and_no_engines(kit: Any) -> None:
    data = kit.dataset(shapes=False, family="table")
    fit = replace(kit.fit_report(), r2=float("nan"), details={"study_form": {"problem": "too few states"}})
    bare = {"pliant": 1, "name": "table", "surrogate": {"kind": "plain", "data": "fem.csv"}}
    run = FinishedRun(
        {}, bare, (DesignResult("table", data, kit.PlainLaw(), fit),), (), (kit.manifest("fit", 0.1),)
    )
    page = render(run)
    text = check_sound(page)
    assert set(page.pictures) == {"finger", "law"}
    assert "no chain simulated" in text and "the table's states" in text


def test_one_engine_that_did_not_converge(kit: Any, flat: FinishedRun) -> None:
    only = kit.engine("quasistatic", np.full((8, 1), 0.2), converged=False, stable=None, residual=1e-3)
    text = check_sound(render(replace(flat, engines=(only,))))
    assert "did not settle" in text and "quasistatic did not converge" in text and "agree" not in text


def test_all_engines_skipped(flat: FinishedRun) -> None:
    text = check_sound(render(replace(flat, engines=flat.engines[2:])))
    assert "Engine pybullet was skipped" in text


def test_loaded_chain_shows_gravity_and_payload(kit: Any, flat: FinishedRun) -> None:
    loaded = kit.study()
    loaded["chain"] = {"modules": 8, "gravity_m_s2": [0.0, 0.0, -9.81], "payload_kg": 0.013}
    text = check_sound(render(replace(flat, study=loaded)))
    assert "with 13 g at its tip" in text and "under gravity" in text


def test_several_designs(kit: Any, whole: FinishedRun) -> None:
    designs = tuple(
        DesignResult(f"design {n}", kit.dataset(), kit.PlainLaw(), kit.fit_report()) for n in (1, 2)
    )
    two = kit.study()
    two["chain"] = {
        "segments": [{"modules": 4}, {"modules": 4, "rotation_rad": 0.8, "family": {"wall": 0.002}}]
    }
    page = render(replace(whole, designs=designs, study=two))
    text = check_sound(page)
    assert {"law", "law_2", "module_shape", "module_shape_2"} <= set(page.pictures)
    assert "design 2: 2 of 35 states" in text


def test_spherical_joints_in_two_projections(kit: Any, whole: FinishedRun) -> None:
    axes = ("x", "y", "z")
    law = kit.PlainLaw(axes=axes, joint="spherical", domain=Domain.unbounded(3))
    angles = np.tile([0.02, 0.2, 0.1], (10, 1))
    engines = (kit.engine("quasistatic", angles, axes), kit.engine("mujoco", 1.0001 * angles, axes))
    designs = (DesignResult("helix", kit.dataset(shapes=False), law, kit.fit_report()),)
    page = render(replace(whole, designs=designs, engines=engines, study=kit.study(10)))
    check_sound(page)
    width = struct.unpack(">I", page.pictures["chain_pose"].tobytes()[16:20])[0]
    assert width > 1500


def test_thousands_of_states_stay_small(kit: Any, whole: FinishedRun) -> None:
    design = DesignResult("dense", kit.dataset(60, 60, shapes=False), kit.PlainLaw(), kit.fit_report())
    check_sound(render(replace(whole, designs=(design,), engines=())))


def test_one_module_with_its_body(kit: Any, whole: FinishedRun) -> None:
    only = kit.engine("quasistatic", np.full((1, 1), 0.3))
    page = render(replace(whole, engines=(only,), study=kit.study(1)))
    assert "One-joint finger bends 17.2°" in check_sound(page)
    many = replace(
        whole, engines=(kit.engine("quasistatic", np.full((40, 1), 1.5 / 40)),), study=kit.study(40)
    )
    check_sound(render(replace(many, designs=(replace(whole.designs[0], fem=kit.dataset(shapes=False)),))))
