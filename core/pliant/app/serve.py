"""Begin and end of the page's server."""

from __future__ import annotations

import asyncio
import socket
import threading
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import uvicorn

from pliant.app.desk import Desk
from pliant.app.open_model import OpenModel
from pliant.app.server import application
from pliant.errors import PliantError, UserError
from pliant.examples_shipped import copy_example
from pliant.pipeline.study import DEFAULT_PHYSICS, DEFAULT_SURROGATE
from pliant.registry.discovery import discover

LOOPBACK = "127.0.0.1"
FIRST_PORT, TRIED = 8642, 40
WARMED_BY = "hidden-effect"


def serve(desk: Desk, port: int, browse: bool, say: Callable[[str], None]) -> None:
    """Serve the session until Ctrl-C.

    Args:
        desk: the session.
        port: on loopback; 0 for the one of the session before, else the first free one.
        browse: whether to open the page in the browser.
        say: prints a line.

    Raises:
        UserError: the port is taken.
    """
    threading.Thread(target=warm, daemon=True).start()
    token, wanted = desk.folder.address(port)
    bound = _bound(wanted, exact=port != 0)
    with bound:
        here = int(bound.getsockname()[1])
        desk.folder.keep_address(token, here)
        address = f"http://{LOOPBACK}:{here}/?token={token}"
        say(f"page     {address}")
        say(f"session  {desk.folder.path}")
        say("Ctrl-C ends the page; everything is saved, and the same command goes on.")
        if browse:
            webbrowser.open(address)
        config = uvicorn.Config(
            application(desk, token),
            log_level="error",
            access_log=False,
            timeout_graceful_shutdown=2,
            server_header=False,
            lifespan="off",
        )
        server = uvicorn.Server(config)
        try:
            asyncio.run(server.serve(sockets=[bound]))
        except KeyboardInterrupt:
            pass  # uvicorn ended already, and raises it again
        finally:
            desk.bench.stop()
            say("the page has ended; everything is saved.")


def warm() -> None:
    """Import and compile what the first study needs, while the user still looks for files."""
    registry = discover()
    usual = [("surrogate", DEFAULT_SURROGATE), ("physics", DEFAULT_PHYSICS)]
    for interface, kind in (*usual, *(("effect", kind) for kind in registry.kinds("effect"))):
        with suppress(PliantError):  # said where a study needs it
            registry.get(interface, kind).implementation_class()
    import_module("pliant.evidence.comparison")
    with (
        suppress(PliantError, OSError),
        TemporaryDirectory() as text,
    ):  # compiles what follows runs, or loads it
        folder = Path(text)
        study, *data = (folder / name for name in sorted(copy_example(WARMED_BY, folder), reverse=True))
        OpenModel.open(study, [one for one in data if one.suffix == ".csv"], folder / "store").predicted(())


def _bound(port: int, exact: bool) -> socket.socket:
    tried = [port] if exact else [*([port] if port else []), *range(FIRST_PORT, FIRST_PORT + TRIED), 0]
    for one in tried:
        # Named TCP, for asyncio sends small packets at once on such a socket alone: else an answer waits 40 ms for the
        # acknowledgement of its own head (Nagle's algorithm).
        made = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            made.bind((LOOPBACK, one))
            made.listen(128)  # a page that is opened at once waits instead of being refused
            return made
        except OSError:
            made.close()
    raise UserError(f"port {port} of {LOOPBACK} is taken; give another --port, or none.")


def session_folder(study: Path | None, out: Path | None) -> Path:
    """The folder of a session: that of the option, else one beside the reports of the study's commands."""
    if out is not None:
        return out
    return Path("runs") / f"{study.stem if study is not None else 'pliant'}-app"
