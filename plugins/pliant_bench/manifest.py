"""Manifest of benches: the interface `bench` and its drivers, the study's blocks, the verb `pliant experiment`."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.block import Block
from pliant.registry.command import Command
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant.registry.interface import Interface

CONTRACT = 3
HERE = "pliant_bench"


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verb of the closed loop."""
    return [Command("experiment", f"{HERE}.command:experiment")]


@hookimpl
def pliant_interfaces() -> Iterable[Interface]:
    """Return the interface of drivers."""
    return [
        Interface(
            "bench",
            config=f"{HERE}.bench:BenchConfig",
            bases=(f"{HERE}.bench:Bench",),
            checks=(f"{HERE}.conformance",),
        )
    ]


@hookimpl
def pliant_blocks() -> Iterable[Block]:
    """Return the blocks of a study that only an experiment reads."""
    return [
        Block(
            "bench",
            interface="bench",
            description="what performs the runs of `pliant experiment` (docs/connect_your_bench.md)",
            paths=("truth", "folder"),
            reader="experiment",
            fixed="it is the bench",
        ),
        Block(
            "experiment",
            model=f"{HERE}.config:ExperimentConfig",
            description="limits and budget of `pliant experiment` (docs/connect_your_bench.md)",
            reader="experiment",
            fixed="it is the experiment",
            check=f"{HERE}.checking:check_experiment",
        ),
    ]


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the drivers."""
    drivers = f"{HERE}.drivers"
    return [
        Component(
            "bench",
            "simulated",
            f"{drivers}.simulated:SimulatedBenchConfig",
            f"{drivers}.simulated:SimulatedBench",
            "a study as the specimen, with its effects, noise and memory; no hardware",
            {"truth": "truth.yaml"},
        ),
        Component(
            "bench",
            "serial",
            f"{drivers}.line_config:SerialConfig",
            f"{drivers}.serial_line:SerialBench",
            "a microcontroller on a serial port",
            requires=("serial",),
            install="pip install 'pliant[bench]'",
        ),
        Component(
            "bench",
            "socket",
            f"{drivers}.line_config:SocketConfig",
            f"{drivers}.socket_line:SocketBench",
            "a program or microcontroller on a TCP port, with the lines of `serial`",
        ),
        Component(
            "bench",
            "files",
            f"{drivers}.files:FilesConfig",
            f"{drivers}.files:FilesBench",
            "a folder that the laboratory's own software reads protocols from and writes recordings into",
            {
                "inputs": {"pressure_pa": {"high": "15 kPa", "rate": "20 kPa/s"}},
                "outputs": {"angle_rad": {}},
            },
        ),
    ]
