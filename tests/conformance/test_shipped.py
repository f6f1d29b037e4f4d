"""Every shipped component passes its whole suite; the fast tests run the first stage of all, and some suites."""

from functools import partial

import pytest

from pliant.registry.component import Component
from pliant.testing import BoundCheck, Subject, check_component, checks_for
from pliant_plugins import manifest
from pliant_view import manifest as view

SHIPPED = [*manifest.pliant_components(), *view.pliant_components()]
# Kinds whose whole suite is fast, of interfaces with slow ones; the stand-ins of test_suite.py pass every suite.
AT_ONCE = {
    "effect": ("actuation_gain", "sensor_bias", "base_misalignment"),
    "fem": (),
    "surrogate": ("table",),
    "meta_model": (),
    "physics": ("quasistatic", "mujoco"),
    "optimizer": ("cmaes",),
    "task": ("free_bending", "tip_load", "helical_hang", "tendon_finger", "follow_shape", "grasp"),
}


def _quick(component: Component) -> bool:
    return component.kind in AT_ONCE.get(component.interface, (component.kind,))


def _name(component: Component) -> str:
    return f"{component.interface}-{component.kind}"


SUITES = [
    pytest.param(partial(check_component, c), id=_name(c), marks=[] if _quick(c) else [pytest.mark.slow])
    for c in SHIPPED
]


@pytest.mark.parametrize("check", SUITES)
def test_shipped(check: BoundCheck) -> None:
    check()


@pytest.mark.parametrize("component", [c for c in SHIPPED if not _quick(c)], ids=_name)
def test_shipped_declares_what_it_is(component: Component) -> None:
    """Manifest, config and signature are correct; the other stages require this one."""
    if missing := component.missing():
        pytest.skip(f"needs {missing}")
    subject = Subject(component)
    for check in checks_for(component.interface):
        if check.declares:
            check.run(subject)
