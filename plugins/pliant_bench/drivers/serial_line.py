"""Bench on a serial port, such as a microcontroller on USB."""

from __future__ import annotations

import errno

import serial
from serial.tools import list_ports

from pliant.errors import UserError
from pliant_bench.drivers.line_bench import LineBench
from pliant_bench.drivers.line_config import SerialConfig
from pliant_bench.drivers.line_protocol import Line

READ_S, WRITE_S = 0.002, 0.5


class SerialPort:
    """The bytes of a serial port."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def read(self) -> bytes:
        data: bytes = self._port.read(self._port.in_waiting or 1)
        return data

    def close(self) -> None:
        self._port.close()


class SerialBench(LineBench):
    """A microcontroller with the sketch of `plugins/pliant_bench/microcontroller` on a serial port."""

    config: SerialConfig

    @property
    def address(self) -> str:
        return self.config.port

    def open_line(self) -> Line:
        config = self.config
        try:
            port = serial.Serial(
                config.port, config.baud, timeout=READ_S, write_timeout=WRITE_S, exclusive=True
            )
        except (OSError, ValueError) as error:
            raise UserError(f"The serial port {config.port} cannot be opened: {_advice(error)}") from None
        port.reset_input_buffer()
        return SerialPort(port)


def _advice(error: Exception) -> str:
    """Return why a port cannot be opened, and what to do."""
    number = getattr(error, "errno", None)
    if number in (errno.EACCES, errno.EPERM):
        return (
            "you may not use it; add yourself to its group (sudo usermod -aG dialout $USER) and log in again."
        )
    if number in (errno.EBUSY, errno.EAGAIN):
        return "another program uses it; close its serial monitor."
    ports = ", ".join(port.device for port in list_ports.comports())
    here = f"the ports here are {ports}" if ports else "this computer has no serial port; plug the bench in"
    return f"{here}. State it as bench: {{kind: serial, port: …}}."
