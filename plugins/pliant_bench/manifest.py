"""Manifest of benches: the interface `bench` and its drivers, the study's blocks, the verb `pliant experiment`."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.block import Block
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant.registry.interface import Interface

CONTRACT = 3
HERE = "pliant_bench"


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
            reader="experiment",
            fixed="it is the bench",
        ),
        Block(
            "experiment",
            model=f"{HERE}.config:ExperimentConfig",
            description="limits and budget of `pliant experiment` (docs/connect_your_bench.md)",
            reader="experiment",
            fixed="it is the experiment",
        ),
    ]


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the drivers."""
    return [
        Component(
            "bench",
            "serial",
            config=f"{HERE}.drivers.line_config:SerialConfig",
            implementation=f"{HERE}.drivers.serial_line:SerialBench",
            summary="a microcontroller on a serial port",
            requires=("serial",),
            install="pip install 'pliant[bench]'",
        ),
        Component(
            "bench",
            "socket",
            config=f"{HERE}.drivers.line_config:SocketConfig",
            implementation=f"{HERE}.drivers.socket_line:SocketBench",
            summary="a program or microcontroller on a TCP port, with the lines of `serial`",
        ),
    ]
