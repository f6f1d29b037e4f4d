"""The report page: it shows its input, tolerates missing parts, and needs nothing from outside."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.report.pages import check_sound, words

from pliant.pipeline.run_folder import DesignResult, FinishedRun
from pliant.records.law import Domain
from pliant.report.document import Page
from pliant.report.render import page as page_of
from pliant.report.run import run_document

FREE = 0.36  # rad per joint, of conftest.py


def render(run: FinishedRun) -> Page:
    return page_of(run_document(run))


def design(kit: Any, name: str, law: Any = None, **data: Any) -> DesignResult:
    return DesignResult(name, kit.dataset(**data), law or kit.PlainLaw(), kit.fit_report())


@pytest.fixture(scope="module")
def whole(kit: Any) -> FinishedRun:
    return kit.full_run()


@pytest.fixture(scope="module")
def flat(kit: Any, whole: FinishedRun) -> FinishedRun:
    """Return the run without shapes: no bodies to draw, hence quick."""
    return replace(whole, designs=(design(kit, "flat", shapes=False),))


@pytest.fixture(scope="module")
def page(whole: FinishedRun) -> Page:
    return render(whole)


def test_page_is_self_contained_and_texts_are_escaped(page: Page) -> None:
    check_sound(page)
    assert "<script>alert" not in page.html and "diverged &lt;here&gt;" in page.html
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
    assert "2 of 35 states have touching walls" in text
    assert "9 kPa, 22.9°: diverged <here>" in text
    assert "Engine pybullet was skipped: pybullet has no wheel for this Python" in text
    assert "The study sets sweep" in text


@pytest.fixture(scope="module")
def runs(kit: Any, flat: FinishedRun) -> dict[str, FinishedRun]:
    """Return the flat run with a part of it changed."""
    axes, angles = ("x", "y", "z"), np.tile([0.02, 0.2, 0.1], (10, 1))
    free = Domain.unbounded(1)
    spherical = kit.PlainLaw(axes=axes, joint="spherical", domain=Domain.unbounded(3))
    unscored = replace(
        kit.fit_report(), r2=float("nan"), details={"study_form": {"problem": "too few states"}}
    )
    table = replace(design(kit, "table", shapes=False, family="table"), fit=unscored)
    loads = {"modules": 8, "gravity_m_s2": [0.0, 0.0, -9.81], "payload_kg": 0.013}
    segments = [{"modules": 1}, {"modules": 1, "rotation_rad": 0.8, "family": {"wall": 0.002}}]

    def make_run(*designs: DesignResult, engines: Any = flat.engines, **changes: Any) -> FinishedRun:
        return replace(flat, designs=designs or flat.designs, engines=engines, study=kit.study(**changes))

    def bent(total: float, modules: int, **state: Any) -> tuple[Any, ...]:
        return (kit.engine("quasistatic", np.full((modules, 1), total / modules), **state),)

    return {
        "stated": make_run(DesignResult("stated", None, kit.PlainLaw(domain=free), None)),
        "table": replace(make_run(table, engines=()), study={"pliant": 1, "name": "table"}),
        "unsettled": make_run(engines=bent(1.6, 8, converged=False, stable=None, residual=1e-3)),
        "loaded": make_run(chain=loads),
        "two": make_run(
            design(kit, "design 1"),
            design(kit, "design 2"),
            engines=bent(0.7, 2),
            chain={"segments": segments},
        ),
        "helix": make_run(
            design(kit, "helix", spherical, shapes=False),
            engines=(kit.engine("quasistatic", angles, axes), kit.engine("mujoco", 1.0001 * angles, axes)),
            modules=10,
        ),
        "dense": make_run(design(kit, "dense", n_p=60, n_u=60, shapes=False), engines=()),
        "one": make_run(engines=bent(0.3, 1), modules=1),
        "forty": make_run(engines=bent(1.5, 40), modules=40),
    }


SHOWN = [
    ("stated", "finger law chain_pose", ["the law is stated by its coefficients", "b_e = 0.0245"]),
    ("table", "finger law", ["no chain simulated", "the table's states"]),
    ("unsettled", "finger law chain_pose", ["did not settle", "quasistatic did not converge"]),
    ("loaded", "finger law chain_pose", ["with 13 g at its tip", "under gravity"]),
    ("two", "finger module_shape module_shape_2 law law_2 chain_pose", ["design 2: 2 of 35 states"]),
    ("helix", "finger law chain_pose", ["10-module finger"]),
    ("dense", "finger law", ["Engine pybullet was skipped"]),
    ("one", "finger law chain_pose", ["One-joint finger bends 17.2°"]),
    ("forty", "finger law chain_pose", ["40-module finger bends 85.9°"]),
]


@pytest.mark.parametrize(
    ("name", "pictures", "says"),
    [
        pytest.param(
            *one, marks=[pytest.mark.slow] if one[0] in ("unsettled", "loaded", "two", "forty") else []
        )
        for one in SHOWN
    ],
)
def test_a_page_shows_what_its_run_has(
    runs: dict[str, FinishedRun], name: str, pictures: str, says: list[str]
) -> None:
    run = runs[name]
    page = render(run)
    text = check_sound(page)
    assert list(page.pictures) == pictures.split()
    assert all(one in text for one in says), text[:400]
    assert ("engines agree within" in text) == (len(run.engines) > 1)
    if "chain_pose" in page.pictures:  # only the helix needs two projections
        width = struct.unpack(">I", page.pictures["chain_pose"].tobytes()[16:20])[0]
        assert (width > 1500) == (name == "helix")


@pytest.mark.slow
def test_same_run_same_bytes(kit: Any, runs: dict[str, FinishedRun]) -> None:
    run = replace(runs["one"], designs=(design(kit, "body"),))
    assert render(run).html == render(run).html
