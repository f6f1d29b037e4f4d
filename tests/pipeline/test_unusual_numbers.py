"""Numbers in the units of other programs: millimetres and tonnes, as scenes of SOFA have them."""

from pathlib import Path

import pytest
from tests.exporting.test_mujoco_alone import FINGER

from pliant import api
from pliant.pipeline.remarks import unused_blocks, unusual_numbers

EXAMPLES = Path(__file__).parents[2] / "examples"


def said(folder: Path, text: str) -> list[str]:
    (folder / "finger.yaml").write_text(text)
    return list(unusual_numbers(api.open_study(folder / "finger.yaml").study))


def test_usual_numbers_are_not_mentioned(tmp_path: Path):
    assert said(tmp_path, FINGER) == []
    assert said(tmp_path, FINGER.replace("chain: {", "chain: {gravity: [0, 0, 0], ")) == []
    assert (
        said(tmp_path, FINGER.replace("chain: {", "chain: {gravity: [0.3, 0, -1.62], ")) == []
    )  # on the Moon


@pytest.mark.parametrize(
    ("written", "meant", "key"),
    [
        (
            "chain: {",
            "chain: {gravity: [0, 0, -9810], ",
            "chain.gravity is 9810 m/s²",
        ),  # ScheiklP/sofa_env#20
        ("module_mass: 1.1 g", "module_mass: 11", "chain.module_mass is 11000 g"),
        ("module_radius: 7 mm", "module_radius: 7", "chain.module_radius is 7000 mm"),
        (
            "modules: 8, module_length: 11 mm",
            "segments: [{modules: 8, module_length: 11}]",
            "chain.segments.0",
        ),
        ("payload: 5 g", "payload: 50", "task.payload is 50000 g"),
    ],
)
def test_numbers_of_other_units_are_doubted(tmp_path: Path, written: str, meant: str, key: str):
    assert written in FINGER
    found = said(tmp_path, FINGER.replace(written, meant))
    assert len(found) == 1 and found[0].startswith(key) and found[0].endswith("Is its unit right?")


@pytest.mark.parametrize(("stated", "named"), [([], False), (["chain.base={position: [0, 0, 0.1]}"], True)])
def test_a_base_that_the_task_places_is_named_as_unused(stated, named):
    study = api.open_study(EXAMPLES / "grasp/counts.yaml", stated).study
    assert ("chain.base" in unused_blocks(study, [False])) is named
