"""The conformance suite of benches: good ones pass, and every bad one is found with a sentence."""

import threading

import pytest

from pliant.registry.component import Component
from pliant.registry.discovery import discover
from pliant.testing import run_checks
from pliant_bench.emulator import Emulator

HERE = "tests.bench.bad_benches"


def component(name):
    return Component("bench", "plant", f"{HERE}:PlantConfig", f"{HERE}:{name}", "a finger of first order")


def failures(component, **changes):
    outcomes = run_checks(component, changes=changes)
    return {one.name: one.message for one in outcomes if one.status == "failed"}, outcomes


def test_a_good_bench_passes():
    failed, outcomes = failures(component("Plant"))
    assert not failed and not [one for one in outcomes if one.status == "skipped"]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("Liar", "readings of tip_x_m came, which are no outputs of the bench"),
        ("OtherCommands", "other commands of pressure_pa were recorded than asked for"),
        ("Stalling", "The bench did not answer for 0.2 s"),
        ("Dropping", "No reading came for 0.5"),
        ("NotANumber", "No reading came for 0.5"),
        ("Restarting", "The bench's clock jumped back from 0.98 s to 0 s"),
        ("Disconnecting", "The connection to the bench was lost (Input/output error)"),
        ("Unlimited", "a run with pressure_pa above its highest value was performed"),
        ("Unventable", "The bench could not be vented (Input/output error): vent it by hand"),
    ],
)
def test_every_bad_bench_is_found(name, says):
    failed, _ = failures(component(name))
    assert any(says in message for message in failed.values()), failed


@pytest.mark.parametrize("kind", ["serial", "socket", "files"])
def test_without_a_bench_the_suite_checks_what_it_can(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed, outcomes = failures(discover().get("bench", kind))
    assert not failed
    skipped = [one.message for one in outcomes if one.status == "skipped"]
    assert all("there is no bench" in one or "other software" in one for one in skipped)
    assert len(skipped) < len(outcomes) / 2


@pytest.mark.slow
def test_the_emulated_microcontroller_passes_over_a_socket(emulator_program, tmp_path):
    connections = 20
    with Emulator(emulator_program, tmp_path / "valve.log", tcp=True) as device:

        def serve():
            for _ in range(connections):
                device.accept()

        threading.Thread(target=serve, daemon=True).start()
        failed, outcomes = failures(discover().get("bench", "socket"), port=int(device.port))
        assert not failed and not [one for one in outcomes if one.status == "skipped"]
