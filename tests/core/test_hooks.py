"""Hooks for blocks of a study, stored records and interfaces: a package registers each as Pliant's own are."""

from dataclasses import dataclass, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Literal

import pytest
from pydantic import Field
from tests.core.test_registry import FakeEntry, discover_with

from pliant.config.loading import load_study
from pliant.config.overrides import merge
from pliant.config.paths import change_paths
from pliant.config.schema import study_schema
from pliant.config.study import Study
from pliant.config.study_keys import study_key
from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, Configured, FrozenModel
from pliant.registry.block import RESERVED, Block, blocks
from pliant.registry.command import commands
from pliant.registry.component import Component
from pliant.registry.discovery import discover
from pliant.registry.function import functions
from pliant.registry.hookspecs import hookimpl
from pliant.registry.interface import Interface, interfaces
from pliant.registry.manifests import CONTRACT_VERSION
from pliant.registry.place import imported
from pliant.registry.stored_record import StoredRecord, stored_records
from pliant.store.codec import decode, encode
from pliant.testing import checks_for, run_checks
from pliant.units import Mass

HERE = __name__


class WeighingConfig(FrozenModel):
    """Limits of a scale."""

    limit_kg: Mass = Field(description="the largest mass")
    table: Path | None = None


def check_weighing(study, registry, where):
    if study.block("weighing").limit_kg > 1.0:
        raise UserError(f"{where(('weighing', 'limit'))}: too heavy.")


class ScaleConfig(ComponentConfig):
    """Base of the configs of scales."""


class SpringScaleConfig(ScaleConfig):
    """A spring scale."""

    kind: Literal["spring"] = "spring"
    stretch: float = 1.0


class Scale(Configured[ScaleConfig]):
    """Base of scales."""


class SpringScale(Scale):
    """A scale by a spring."""


@dataclass(frozen=True)
class Weight:
    """A mass that was weighed."""

    mass_kg: float


WEIGHING = Block(
    "weighing",
    f"{HERE}:WeighingConfig",
    description="limits of a scale",
    paths=("table",),
    reader="weigh",
    fixed="it belongs to the scale",
    check=f"{HERE}:check_weighing",
)
SCALE = Interface("scale", f"{HERE}:ScaleConfig", (f"{HERE}:Scale",))
SPRING = Component("scale", "spring", f"{HERE}:SpringScaleConfig", f"{HERE}:SpringScale", "a spring")
STUDY = "pliant: 1\nname: hooked\nweighing:\n  limit: 3 g\n  table: masses.csv\nscale: spring\n"


def package(monkeypatch, **entries):
    """Discover the installed packages and one more, whose hooks return these entries."""
    module = ModuleType("lab_scales")
    module.CONTRACT = CONTRACT_VERSION
    for hook, given in entries.items():

        def answer(given=given):
            return given

        answer.__name__ = f"pliant_{hook}"
        setattr(module, f"pliant_{hook}", hookimpl(answer))
    return discover_with(monkeypatch, FakeEntry("lab_scales", lambda: module))


@pytest.fixture
def scales(monkeypatch):
    """The registry with a package that fills every hook of this page."""
    return package(
        monkeypatch,
        blocks=[WEIGHING, Block("scale", interface="scale", description="weighs")],
        records=[StoredRecord(f"{HERE}:Weight")],
        interfaces=[SCALE],
        components=[SPRING],
    )


def written(folder, text=STUDY):
    (folder / "study.yaml").write_text(text)
    return folder / "study.yaml"


def test_a_package_block_is_typed_and_its_paths_start_at_the_file(scales, tmp_path):
    study = load_study(written(tmp_path), scales)
    assert study.block("weighing") == WeighingConfig(limit="3 g", table=tmp_path / "masses.csv")
    assert study.block("scale") == SpringScaleConfig()
    assert study.read_by() == {"weigh": ["weighing"]}
    assert study.canonical()["weighing"]["limit_kg"] == 0.003
    assert study.need("scale", "a weighing").stretch == 1.0
    values = {"weighing": {"table": "a.csv"}}
    change_paths(values, str.upper)
    assert values == {"weighing": {"table": "A.CSV"}}
    assert merge({"scale": "spring"}, {"scale": {"stretch": 2}})["scale"] == {"kind": "spring", "stretch": 2}


def test_a_study_without_the_block_is_as_without_the_package(scales, tmp_path):
    study = load_study(written(tmp_path, "pliant: 1\nname: bare\n"), scales)
    assert study.block("weighing") is None and study.read_by() == {}
    assert study.canonical() == Study(name="bare").canonical()


def test_without_the_package_the_key_is_unknown(tmp_path):
    with pytest.raises(UserError, match="study.yaml, line 3: .*weighing"):
        load_study(written(tmp_path), discover())


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("3 g", "3 m"), "line 4: .*limit"),
        (("3 g", "2 kg"), "study.yaml, line 4: too heavy.$"),
        (("limit", "limits"), "line 4: .*limits.*did you mean 'limit'"),
        (("spring", "sprung"), "line 6: unknown scale kind 'sprung'"),
    ],
)
def test_block_errors_have_their_line(scales, tmp_path, change, sentence):
    with pytest.raises(UserError, match=sentence):
        load_study(written(tmp_path, STUDY.replace(*change)), scales)


def test_a_search_sets_no_key_in_a_fixed_block(scales, tmp_path):
    study = load_study(written(tmp_path), scales)
    with pytest.raises(UserError, match="'weighing.limit' cannot be set: it belongs to the scale"):
        study_key(study, scales, "weighing.limit")
    assert study_key(study, scales, "scale.kind").kinds == ("spring",)
    assert study_key(study, scales, "scale.stretch").value == 1.0


def test_the_schema_has_the_blocks(scales):
    properties = study_schema(scales)["properties"]
    assert properties["weighing"]["description"] == "limits of a scale"
    assert {"enum": ["spring"]}.items() <= properties["scale"]["oneOf"][-1].items()


def test_a_package_record_is_stored_by_name(scales):
    tree = encode(Weight(2.0), {})
    assert tree == {"__record__": "Weight", "fields": {"mass_kg": 2.0}}
    assert decode(tree, {}) == Weight(2.0)


def test_a_record_that_no_package_registers_is_refused():
    with pytest.raises(TypeError, match="Weight is no storable record"):
        encode(Weight(2.0), {})
    with pytest.raises(ValueError, match="unknown record 'Weight'"):
        decode({"__record__": "Weight", "fields": {"mass_kg": 2.0}}, {})


def test_another_class_with_a_record_name_is_refused():
    @dataclass(frozen=True)
    class Design:
        number: int

    with pytest.raises(TypeError, match="Design is no storable record"):
        encode(Design(1), {})


def test_a_package_interface_has_components_and_a_suite(scales):
    assert scales.kinds("scale") == ["spring"] and not scales.failures
    assert interfaces()["scale"].package == "unknown package"
    assert isinstance(scales.build("scale", SpringScaleConfig()), SpringScale)
    assert {check.name for check in checks_for("scale")} == {
        check.name for check in checks_for("viewer") if check.function.__module__ == "pliant.testing.common"
    }
    failed = [
        o.message for o in run_checks(SPRING, clauses=["implementation_fills_the_interface"]) if o.message
    ]
    assert not failed


@pytest.mark.parametrize(
    ("hook", "entry", "cause"),
    [
        ("blocks", Block("Weigh it", "a:B"), "lower-case words joined by '_'"),
        ("blocks", Block("name", "a:B"), "the key is Pliant's own"),
        ("blocks", Block("weighing"), "needs either a model or an interface"),
        ("blocks", Block("weighing", "a:B", "scale"), "needs either a model or an interface"),
        ("blocks", Block("weighing", "a.B"), "has model 'a.B'"),
        ("blocks", Block("weighing", "a:B", check="c"), "has check 'c'"),
        ("blocks", Block("chain", "a:B"), "study block 'chain' is one of pliant; give it another name"),
        ("blocks", "weighing", "which is no Block"),
        ("records", StoredRecord("Weight"), "has place 'Weight'"),
        ("records", StoredRecord("a:Design"), "stored record 'Design' is one of pliant"),
        ("interfaces", Interface("Scale", "a:B", ("a:B",)), "has name 'Scale'"),
        ("interfaces", Interface("scale", "a.B", ("a:B",)), "names 'a.B'"),
        ("interfaces", Interface("scale", "a:B", ()), "has no base class"),
        ("interfaces", Interface("scale", "a:B", "a:B"), "write a tuple of texts"),
        ("interfaces", Interface("task", "a:B", ("a:B",)), "interface 'task' is one of pliant"),
    ],
)
def test_a_wrong_entry_is_named_and_the_own_ones_stay(monkeypatch, hook, entry, cause):
    (failure,) = package(monkeypatch, **{hook: [entry]}).failures
    assert cause in failure.cause
    assert blocks()["chain"].model == "pliant.config.chain:ChainConfig"
    assert interfaces()["task"].package == stored_records()["Design"].package == "pliant"


def test_the_own_blocks_are_the_study_fields():
    own = [key for key, block in blocks().items() if block.package == "pliant"]
    assert set(own) == set(Study.model_fields) - set(RESERVED)
    for block in (blocks()[key] for key in own):
        field = str(Study.model_fields[block.key].annotation)
        model = block.model_class() if block.model else interfaces()[block.interface].config_class()
        assert model.__name__ in field and block.many == field.startswith("tuple")
        assert all(block.function(name) for name in ("check", "settings") if getattr(block, name))


def test_the_own_records_and_interfaces_can_be_imported():
    for name, record in stored_records().items():
        assert is_dataclass(cls := imported(record.place)) and cls.__name__ == name
    for interface in interfaces().values():
        assert issubclass(interface.config_class(), ComponentConfig)
        assert all(issubclass(base, Configured) for base in interface.base_classes())
        assert set(interface.checks) < {check.function.__module__ for check in checks_for(interface.name)}


def test_every_place_that_ships_can_be_imported():
    for block in blocks().values():
        assert all(block.function(name) for name in ("check", "settings") if getattr(block, name))
        assert block.interface or issubclass(block.model_class(), FrozenModel)
    places = [command.function for command in commands().values()]
    places += [function.place for function in functions().values()]
    assert len(places) > 25 and all(callable(imported(place)) for place in places)
