"""Discovery: a broken plugin is named, never fatal; a kind defined twice names both packages."""

import importlib.metadata
from types import ModuleType

import pytest

from pliant.errors import MissingDependencyError, UserError
from pliant.registry import discovery
from pliant.registry.component import Component
from pliant.registry.discovery import discover
from pliant.registry.hookspecs import hookimpl


def module_with(components, name="some_package"):
    module = ModuleType(name)

    @hookimpl
    def pliant_components():
        return components

    module.pliant_components = pliant_components
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


def test_ctrl_c_during_discovery_is_not_swallowed(monkeypatch):
    with pytest.raises(KeyboardInterrupt):
        discover_with(monkeypatch, FakeEntry("slow", fail(KeyboardInterrupt())))


@pytest.mark.parametrize(
    ("components", "cause"),
    [
        (["no component"], "which is no Component"),
        ([effect(interface="efect")], "interface 'efect'"),
        ([effect(contract=99)], "written for contract 99"),
    ],
)
def test_a_wrong_manifest_is_remembered(monkeypatch, components, cause):
    registry = discover_with(monkeypatch, FakeEntry("odd", lambda: module_with(components)))
    assert cause in registry.failures[0].cause


def test_a_module_without_the_hook_is_remembered(monkeypatch):
    registry = discover_with(monkeypatch, FakeEntry("empty", lambda: ModuleType("empty")))
    assert "has no @hookimpl pliant_components" in registry.failures[0].cause


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


def test_a_missing_package_says_what_to_install():
    component = effect(requires=("no_such_module_anywhere",), install="pip install 'x[y]'")
    with pytest.raises(MissingDependencyError, match=r"needs no_such_module_anywhere: pip install 'x\[y\]'"):
        component.build(component.config_model()(kind="stiffness"))


def test_extra_modules_join_the_installed_ones():
    registry = discover(extra=[module_with([effect("local")])])
    assert registry.get("effect", "local").package == "some_package"
    assert discovery.GROUP == "pliant"
