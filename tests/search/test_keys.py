"""Keys as a study writes them, and studies that differ by some keys."""

from pathlib import Path

import pytest
from tests.search.search_studies import BASE, REGISTRY, search_study

from pliant.config.loading import load_study
from pliant.config.study_keys import study_key
from pliant.errors import InvalidDesignError, UserError
from pliant_search.problem.study_setter import StudySetter
from pliant_search.stage_keys import search_content

EXAMPLES = sorted(Path(__file__).parents[2].glob("examples/*/*.yaml"))


@pytest.fixture
def study(tmp_path):
    (tmp_path / "a.yaml").write_text(BASE)
    return load_study(tmp_path / "a.yaml", REGISTRY)


def test_workers_are_in_no_search_key(tmp_path):
    asked = "variables: {family.wall: {low: 1 mm, high: 2 mm}}\nobjective: tip_x"
    one, two = (search_content(search_study(tmp_path, asked, BASE + who), ()) for who in ("", "workers: 2\n"))
    assert one == two and "chain" in one


@pytest.mark.parametrize(
    ("written", "path", "sort", "unit", "value"),
    [
        ("family.average_radius", ("family", "average_radius_m"), "real", "m", 0.006),
        ("family.wall_m", ("family", "wall_m"), "real", "m", 0.0015),
        ("chain.segments.2.modules", ("chain", "segments", 2, "modules"), "integer", "", 6),
        ("chain.segments.1.rotation", ("chain", "segments", 1, "rotation_rad"), "real", "rad", 0.85),
        (
            "chain.segments.1.family.average_radius",
            ("chain", "segments", 1, "family", "average_radius_m"),
            *("real", "m", 0.0061),
        ),
        ("chain.gravity.2", ("chain", "gravity_m_s2", 2), "real", "m/s^2", -9.81),
        ("task.object", ("task", "object"), "other", "", {"shape": "egg"}),
        ("task.object.radius", ("task", "object", "radius_m"), "real", "m", None),
        ("effects.0.factor", ("effects", 0, "factor"), "real", "", 1.1),
        ("physics.kind", ("physics", "kind"), "text", "", "mujoco"),
        ("surrogate.kind", ("surrogate", "kind"), "text", "", None),
    ],
)
def test_a_key_has_its_path_type_unit_and_value(study, written, path, sort, unit, value):
    key = study_key(study, REGISTRY, written)
    assert (key.path, key.sort, key.unit) == (path, sort, unit)
    assert key.value == (pytest.approx(value) if isinstance(value, float) else value)
    assert key.written == written.removesuffix("_m")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("familly.wall", "did you mean 'family'"),
        ("family.waal", "did you mean 'wall'"),
        ("family", "is a whole block; name a key in it, such as 'family.inner_radius'"),
        ("meta_model.share", "the study has no 'meta_model' block"),
        ("chain.segments.7.modules", "'chain.segments' has items 0 to 3"),
        ("chain.segments.modules", "is a list; name an item by its number"),
        ("chain.base.quaternion.0", "is no list, since the study does not give it"),
        ("family.wall.x", "'family.wall' has no keys"),
        ("effects.3.factor", "'effects' has items 0 to 0"),
        ("name", "it names the output folder"),
        ("pliant", "the file's format"),
        ("search.budget", "it is the search itself"),
        ("optimizer.kind", "it is what searches"),
        ("measurements.file", "what the bench recorded"),
        ("sweep.average_radius", "what the meta-model is fitted to"),
        ("plugins.0", "they are code"),
        ("meta_model.data", "what the meta-model is fitted to"),
        ("", "is no key"),
    ],
)
def test_what_is_no_key_is_said(study, written, message):
    with pytest.raises(UserError, match=message):
        study_key(study, REGISTRY, written, "a.yaml, line 3")


@pytest.mark.parametrize(
    ("written", "value", "message"),
    [
        ("family.wall", "3 kPa", "needs a length"),
        ("chain.segments.0.module_length", "-1 mm", "greater than 0"),
        ("chain.segments.0.modules", 2.5, "whole number"),
        ("chain.segments.0.modules", 0, "greater than or equal to 1"),
        ("task.friction", float("nan"), "finite number"),
        ("family.wall", float("inf"), "finite number"),
        ("task.object", "eg", "did you mean 'egg'"),
        ("physics.kind", "mujco", "did you mean 'mujoco'"),
        ("task.friction", True, "not a number"),
    ],
)
def test_a_value_is_judged_by_its_key(study, written, value, message):
    with pytest.raises(UserError, match=message) as error:
        study_key(study, REGISTRY, written).parsed(value, "search.variables.x.low", "a.yaml, line 3")
    assert str(error.value).startswith("a.yaml, line 3: 'search.variables.x.low'")


def test_setting_keys_to_what_they_are_changes_nothing():
    """Tested for every example."""
    studies = 0
    for path in EXAMPLES:
        try:
            study = load_study(path, REGISTRY)
        except UserError:
            continue  # no study
        if study.family is not None and study.family.kind == "mesh_file":
            continue  # its mesh is made by a script
        if study.model is not None:
            continue  # a search designs chains
        studies += 1
        setter, changes = StudySetter(study, REGISTRY), {}
        assert setter.study({}) == study
        for block in ("material", "fem", "chain", "task", "surrogate", "physics"):
            model = getattr(study, block)
            for name in model.model_fields_set if model is not None else ():
                key = study_key(study, REGISTRY, f"{block}.{name}")
                changes[key.path] = key.value
        assert changes, path
        found, chain = setter.study(changes), {"chain"}
        assert found.model_dump(mode="json", exclude=chain) == study.model_dump(mode="json", exclude=chain)
        for block in ("task", "chain"):
            if getattr(study, block) is not None:
                assert getattr(found, block).model_fields_set == getattr(study, block).model_fields_set
    assert studies > 10


def test_each_key_reaches_its_place_and_no_other(study):
    setter = StudySetter(study, REGISTRY)
    found = setter.study(
        {
            ("chain", "segments", 1, "family", "module_length_m"): 0.010,
            ("chain", "gravity_m_s2", 2): -1.0,
            ("chain", "base", "roll_rad"): 0.5,
            ("effects", 0, "factor"): 0.9,
            ("task", "object"): {"shape": "cylinder"},
            ("task", "object", "radius_m"): 0.02,
        }
    )
    assert found.chain.segments[1].family == pytest.approx(
        {"average_radius_m": 0.0061, "module_length_m": 0.010}
    )
    assert found.chain.gravity_m_s2 == (0.0, 0.0, -1.0)
    assert found.chain.base.roll_rad == 0.5
    assert found.effects[0].factor == 0.9
    assert (found.task.object.shape, found.task.object.radius_m) == ("cylinder", 0.02)
    assert found.family is study.family and found.material is study.material
    assert study.effects[0].factor == 1.1 and study.chain.segments[1].family == {"average_radius": "6.1 mm"}


def test_another_kind_has_its_own_keys(study):
    found = StudySetter(study, REGISTRY).study({("physics", "kind"): "pybullet"})
    assert found.physics.kind == "pybullet"
    assert type(found.physics) is REGISTRY.get("physics", "pybullet").config_model()
    with pytest.raises(UserError, match="'family"):
        StudySetter(study, REGISTRY).study({("family", "kind"): "tendon_joint", ("family", "wall_m"): 0.001})


def test_a_design_that_the_family_refuses_is_said(study):
    setter = StudySetter(study, REGISTRY)
    with pytest.raises(InvalidDesignError):
        setter.study({("family", "average_radius_m"): 0.003})
    with pytest.raises(InvalidDesignError):
        setter.study({("chain", "segments", 1, "family", "average_radius_m"): 0.003})
    with pytest.raises(UserError, match=r"chain.segments.1.family.*length"):
        setter.study({("chain", "segments", 1, "family", "wall_m"): "3 kPa"})
