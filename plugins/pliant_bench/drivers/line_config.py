"""Blocks `bench` of the kinds `serial` and `socket`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.units import Time
from pliant_bench.bench import BenchConfig


class LineBenchConfig(BenchConfig):
    """How long the bench waits for an answer."""

    timeout_s: Time = Field(0.02, gt=0, le=1, description="time after which a request is repeated")
    attempts: int = Field(3, ge=1, le=20, description="a reading is lost after as many requests")
    start_s: Time = Field(
        4.0, gt=0, description="time that the microcontroller has to start after the connection"
    )
    reconnect_attempts: int = Field(
        5, ge=0, le=1000, description="attempts to connect again after a lost connection"
    )
    reconnect_s: Time = Field(
        2.0, gt=0, description="wait before each of these attempts; the bench is vented meanwhile"
    )


class SerialConfig(LineBenchConfig):
    """A serial port."""

    kind: Literal["serial"] = "serial"
    port: str = Field(
        min_length=1, examples=["/dev/ttyACM0"], description="name of the port: COM3, /dev/ttyACM0"
    )
    baud: int = Field(115200, gt=0, description="bits per second, as in the sketch")


class SocketConfig(LineBenchConfig):
    """A TCP port of this or another computer."""

    kind: Literal["socket"] = "socket"
    host: str = Field("127.0.0.1", min_length=1, description="name or address of the computer")
    port: int = Field(ge=1, le=65535, examples=[5025], description="number of the TCP port")
