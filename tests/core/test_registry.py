"""Discovery: a broken plugin is named and never fatal; a kind defined twice names both packages."""

import importlib.metadata
import re
from types import ModuleType

import pytest

from pliant.errors import ContractError, MissingDependencyError, UserError
from pliant.registry.command import Command, commands
from pliant.registry.component import Component
from pliant.registry.data_kind import DataKind, data_kinds
from pliant.registry.discovery import discover
from pliant.registry.hookspecs import hookimpl
from pliant.registry.manifests import CONTRACT_VERSION, distribution_name


def module_with(components, name="some_package", contract=CONTRACT_VERSION):
    module = ModuleType(name)

    @hookimpl
    def pliant_components():
        return components

    module.pliant_components = pliant_components
    if contract is not None:
        module.CONTRACT = contract
    return module


def effect(kind="mine", **changes):
    values = {
        "interface": "effect",
        "kind": kind,
        "config": "pliant_plugins.effects.stiffness:StiffnessConfig",
        "implementation": "pliant_plugins.effects.stiffness:Stiffness",
        "summary": "a test",
        **changes,
    }
    return Component(**values)


class FakeEntry:
    def __init__(self, name, load):
        self.name, self.value, self.load = name, f"{name}:x", load
        self.dist = None


def discover_with(monkeypatch, *entries):
    real = importlib.metadata.entry_points(group="pliant")
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [*real, *entries])
    return discover()


def fail(error):
    def load():
        raise error

    return load


def test_shipped_plugins_are_found_without_importing_heavy_libraries():
    registry = discover()
    assert registry.failures == ()
    assert {"quasistatic", "mujoco", "pybullet"} <= set(registry.kinds("physics"))
    assert "bellow_bending" in registry.kinds("family")


@pytest.mark.parametrize(
    ("error", "cause"),
    [
        (ImportError("no module named nowhere"), "ImportError: no module named nowhere"),
        (SystemExit("bye"), "SystemExit: bye"),
        (ZeroDivisionError("x\ny"), "ZeroDivisionError: x"),
        (AssertionError(), "AssertionError"),
    ],
)
def test_a_broken_plugin_is_remembered_with_its_cause(monkeypatch, error, cause):
    registry = discover_with(monkeypatch, FakeEntry("broken", fail(error)))
    assert [(f.name, f.cause) for f in registry.failures] == [("broken", cause)]
    assert "bellow_bending" in registry.kinds("family")


@pytest.mark.parametrize(
    ("contract", "cause"),
    [
        (None, r"some_package states no contract.*`parameter\(…\)`.*CONTRACT = 3"),
        (1, r"states CONTRACT = 1.*`parameter\(…\)`.*CONTRACT = 3"),
        (2, r"states CONTRACT = 2, this Pliant has 3: import public names by .* then write CONTRACT = 3"),
        (CONTRACT_VERSION + 1, r"CONTRACT = 4, this Pliant has 3: update Pliant"),
        ("3", r"CONTRACT = '3', this Pliant has 3"),
    ],
)
def test_a_plugin_with_another_contract_is_named_and_stops_nothing_else(monkeypatch, contract, cause):
    old = module_with([effect("former")], contract=contract)
    registry = discover_with(monkeypatch, FakeEntry("old", lambda: old))
    (failure,) = registry.failures
    assert (failure.name, failure.kinds) == ("old", (("effect", "former"),))
    assert re.search(cause, failure.cause)
    assert "bellow_bending" in registry.kinds("family")
    with pytest.raises(UserError, match="^effect 'former' of unknown package cannot be used: ") as error:
        registry.get("effect", "former")
    assert len(str(error.value).splitlines()) == 1


def test_an_old_manifest_that_cannot_be_read_any_more_is_named_all_the_same(monkeypatch):
    old = ModuleType("old_package")

    @hookimpl
    def pliant_components():
        return [Component("effect", "former", "old:Config", "old:Effect", "old", contract=1)]

    old.pliant_components = pliant_components
    (failure,) = discover_with(monkeypatch, FakeEntry("old", lambda: old)).failures
    assert "states no contract" in failure.cause
    assert failure.kinds == ()


def test_ctrl_c_during_discovery_is_not_swallowed(monkeypatch):
    with pytest.raises(KeyboardInterrupt):
        discover_with(monkeypatch, FakeEntry("slow", fail(KeyboardInterrupt())))


@pytest.mark.parametrize(
    ("components", "cause"),
    [
        (["no component"], "which is no Component"),
        ([effect(interface="efect")], "interface 'efect'"),
        ([effect(None)], "has kind None"),
        ([effect(["mine"])], "has kind ['mine']"),
        ([effect("")], "has kind ''"),
        ([effect(interface=["effect"])], "interface '['effect']'"),
        ([effect(config="no.colon")], "has config 'no.colon'; write it as"),
        ([effect(implementation=dict)], "has implementation <class 'dict'>"),
        ([effect(requires="mujoco")], "requires 'mujoco'; write a tuple"),
        ([effect(summary=None)], "has summary None"),
        ([effect(example=["x"])], "has example ['x']"),
        (effect(), "returned one Component; put it into a list"),
        (None, "returned None; it must return a list"),
        (7, "TypeError"),
        ("effects", "returned 'e', which is no Component"),
        ({effect().kind: 1}, "returned 'mine', which is no Component"),
    ],
)
def test_a_wrong_manifest_is_remembered(monkeypatch, components, cause):
    registry = discover_with(monkeypatch, FakeEntry("odd", lambda: module_with(components)))
    assert cause in registry.failures[0].cause


def test_a_half_removed_package_is_remembered(tmp_path):
    info = tmp_path / "ghost-1.0.dist-info"
    info.mkdir()
    (info / "entry_points.txt").write_text("[pliant]\nghost = no_such_ghost\n")
    entry = next(iter(importlib.metadata.Distribution.at(info).entry_points))
    assert distribution_name(entry) == "unknown package"


def test_metadata_that_cannot_be_read_stop_nothing(monkeypatch):
    class Unreadable:
        @property
        def name(self):
            raise OSError("no such file")

    entry = FakeEntry("ghost", fail(ImportError("no ghost")))
    entry.dist = Unreadable()
    assert discover_with(monkeypatch, entry).failures[0].package == "unknown package"


@pytest.mark.parametrize(
    ("config", "cause"),
    [
        ("builtins:dict", "is no EffectConfig"),
        ("pliant.interfaces.base:ComponentConfig", "is no EffectConfig"),
        ("pliant.interfaces.task:TaskConfig", "is no EffectConfig"),
        ("pliant.errors:closest", "is no EffectConfig"),
        ("no_such_package.config:Config", "No module named 'no_such_package'"),
        ("pliant.errors:Nothing", "no attribute 'Nothing'"),
    ],
)
def test_a_wrong_config_model_names_component_and_package(config, cause):
    component = effect(config=config).from_package("lab 1.2")
    with pytest.raises(ContractError) as caught:
        component.config_model()
    assert "effect 'mine' of lab 1.2: " in str(caught.value)
    assert cause in str(caught.value)


def test_a_kind_defined_twice_names_both_packages(monkeypatch):
    module = module_with([effect("stiffness")])
    registry = discover_with(monkeypatch, FakeEntry("second", lambda: module))
    assert "defined twice" in registry.failures[0].cause
    with pytest.raises(UserError, match="pliant .* and unknown package"):
        registry.get("effect", "stiffness")


def test_unknown_kind_names_the_close_match_the_known_and_the_failed(monkeypatch):
    registry = discover_with(monkeypatch, FakeEntry("broken", fail(ImportError("no wheel"))))
    with pytest.raises(UserError) as caught:
        registry.get("physics", "mojoco")
    text = str(caught.value)
    assert "did you mean 'mujoco'?" in text
    assert "Known kinds: mujoco, pybullet, quasistatic" in text
    assert "broken (ImportError: no wheel)" in text


def test_components_may_come_from_a_generator_which_may_fail(monkeypatch):
    def components():
        yield effect("early")
        raise RuntimeError("no licence")

    lazy = FakeEntry("lazy", lambda: module_with(effect(k) for k in "ab"))
    failing, empty = (
        FakeEntry("failing", lambda: module_with(components())),
        FakeEntry("empty", lambda: ModuleType("e")),
    )
    registry = discover_with(monkeypatch, lazy, failing, empty)
    assert {"a", "b"} <= set(registry.kinds("effect")) and "early" not in registry.kinds("effect")
    causes = {failure.name: failure.cause for failure in registry.failures}
    assert "no licence" in causes["failing"] and "has no @hookimpl pliant_components" in causes["empty"]
    assert discover(extra=[module_with([effect("local")])]).get("effect", "local").package == "some_package"


def test_a_missing_package_says_what_to_install():
    for module in ("no_such_module_anywhere.inner", "pliant.errors.inner"):
        assert effect(requires=(module,)).missing() == module
    component = effect(requires=("no_such_module_anywhere",), install="pip install 'x[y]'")
    with pytest.raises(MissingDependencyError, match=r"needs no_such_module_anywhere: pip install 'x\[y\]'"):
        component.build(component.config_model()(kind="stiffness"))


def package_with_commands(*verbs):
    module = ModuleType("some_verbs")
    module.CONTRACT = CONTRACT_VERSION

    @hookimpl
    def pliant_commands():
        return verbs

    module.pliant_commands = pliant_commands
    return FakeEntry("some_verbs", lambda: module)


def test_a_package_brings_a_verb_and_no_component(monkeypatch):
    verb = Command("weigh", "pliant.cli.doctor:doctor")
    assert not discover_with(monkeypatch, package_with_commands(verb)).failures
    assert commands()["weigh"].function == verb.function
    assert commands()["weigh"].help.startswith("Check a study's magnitudes")


@pytest.mark.parametrize(
    ("verb", "cause"),
    [
        (Command("run", "pliant.cli.doctor:doctor"), "command 'run' is one of pliant; give it another name"),
        (Command("Weigh it", "pliant.cli.doctor:doctor"), "lower-case words joined by '-'"),
        (Command("weigh", "doctor"), "write 'package.module:function'"),
        ("weigh", "which is no Command"),
    ],
)
def test_a_wrong_verb_is_named_and_the_own_ones_stay(monkeypatch, verb, cause):
    registry = discover_with(monkeypatch, package_with_commands(verb))
    assert [cause in failure.cause for failure in registry.failures] == [True]
    assert commands()["run"].function == "pliant.cli.studies:run"


def test_a_package_brings_a_kind_of_data_and_a_wrong_one_is_named(monkeypatch):
    def package_with_data(*kinds):
        module = ModuleType("some_data")
        module.CONTRACT = CONTRACT_VERSION
        module.pliant_data = hookimpl(specname="pliant_data")(lambda: kinds)
        return FakeEntry("some_data", lambda: module)

    with monkeypatch.context() as patch:
        assert not discover_with(
            patch, package_with_data(DataKind("films", "some_data:is_film", "some_data:open"))
        ).failures
        assert {"counts", "films"} <= set(data_kinds())
    for kind, cause in (
        (DataKind("Films", "a:b", "a:c"), "lower-case words"),
        (DataKind("films", "a:b", "a"), "has open 'a'"),
    ):
        with monkeypatch.context() as patch:
            (failure,) = discover_with(patch, package_with_data(kind)).failures
            assert cause in failure.cause


def test_a_manifest_that_fails_hides_no_verb(monkeypatch):
    discover_with(monkeypatch, FakeEntry("broken", fail(ImportError("no such module"))))
    assert {"run", "diagnose", "optimize"} <= set(commands())
