"""The page's server: loopback only, behind a token, serving JSON, files of the session and its own page.

Every request of the interface carries the token in a header, which a foreign page cannot set without the browser's
preflight request (no cookie is used), names this server in `Host` (no foreign name can be bound to loopback), and,
where the browser sends an `Origin`, comes from the page itself.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module, resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from pliant.errors import PliantError, UserError
from pliant.examples_shipped import copy_example
from pliant.pipeline.study import DEFAULT_PHYSICS, DEFAULT_SURROGATE
from pliant.records.plain_values import plain
from pliant.registry.discovery import discover
from pliant.report.render import script_hashes
from pliant_app.controller import SessionController
from pliant_app.experiment import PAGE, reading, writing
from pliant_app.exports import anywhere
from pliant_app.folder import SessionFolder
from pliant_app.open_model import OpenModel
from pliant_app.page_state import as_effects
from pliant_app.uploads import receive, safe_name
from pliant_bench.loop.folder import ExperimentFolder

TOKEN = "x-pliant-token"
MOST_JSON = 1_000_000  # bytes of a request
TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
# A report is self-contained: pictures inside, only our scripts, allowed by their digests. Its origin is opaque: scripts
# reach neither this page nor the token.
OF_REPORTS = (
    f"default-src 'none'; script-src {' '.join(script_hashes())}; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; sandbox allow-scripts"
)


class Guard:
    """A filter that refuses requests that do not come from the page itself."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass the request on; every answer has our headers."""
        if scope["type"] != "http":
            raise ValueError("the page speaks HTTP alone")

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await (self._refused(Request(scope)) or self.app)(scope, receive, with_headers)

    def _refused(self, request: Request) -> Response | None:
        host = request.headers.get("host", "")
        if host.rpartition(":")[0].strip("[]") not in ("127.0.0.1", "localhost", "::1"):
            return _refusal("this page answers on loopback alone.")
        origin = request.headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return _refusal("a request from another site is refused.")
        if request.headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return _refusal("a request from another site is refused.")
        if request.url.path.startswith("/static/"):
            return None
        given = request.headers.get(TOKEN) or request.query_params.get("token", "")
        if request.method != "GET":  # a form of another site can set an address, not a header
            given = request.headers.get(TOKEN, "")
        if not secrets.compare_digest(given.encode(), self.token.encode()):
            return _refusal("the token is missing or wrong; open the address that 'pliant app' printed.")
        return None


def _refusal(sentence: str) -> Response:
    return PlainTextResponse(f"Refused: {sentence}\n", 403)


def answer(ask: Callable[[Mapping[str, Any]], Any]) -> Callable[[Request], Any]:
    """Return a route's function that answers with JSON: the result of `ask`, or the sentence of its error."""

    async def handle(request: Request) -> Response:
        try:
            values = await _values(request)
            found = await run_in_threadpool(ask, values)
        except PliantError as error:
            return JSONResponse({"error": str(error)}, 422)
        except (KeyError, TypeError, ValueError) as error:
            return JSONResponse({"error": f"the request is not understood ({error})."}, 400)
        return JSONResponse(plain(found))

    return handle


def experiment_application(folder: ExperimentFolder, token: str) -> Starlette:
    """Return the server's application on the folder of an experiment."""

    async def page(request: Request) -> Response:
        return _shipped(PAGE)

    routes = [
        Route("/", page),
        Route("/static/{name:path}", _static),
        *(Route(f"/api/{name}", answer(ask), methods=["POST"]) for name, ask in writing(folder).items()),
        *(Route(f"/api/{name}", answer(ask)) for name, ask in reading(folder).items()),
    ]
    return Starlette(routes=routes, middleware=[Middleware(Guard, token=token)])


def application(controller: SessionController, token: str) -> Starlette:
    """Return the server's application on a session."""

    async def upload(request: Request) -> Response:
        try:
            name = safe_name(request.query_params.get("name", ""))
            length = request.headers.get("content-length", "")
            declared = int(length) if length.isdigit() else None
            await receive(request.stream(), declared, controller.folder.files / name)
            await run_in_threadpool(controller.take, name)
        except PliantError as error:
            return JSONResponse({"error": str(error)}, 422, headers={"Connection": "close"})
        return JSONResponse({"name": name})

    def example(_: Mapping[str, Any]) -> dict[str, Any]:
        for dropped in controller.state.data:  # the example has its own recording
            controller.forget(Path(dropped).name)
        for name in copy_example("hidden-effect", controller.folder.files):
            if name.endswith(".yaml"):
                controller.take(name)
        return {}

    posts: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "preview": lambda v: controller.preview(as_effects(v["effects"]), int(v.get("parts", 0))),
        "space": lambda v: controller.space(as_effects(v["effects"]), str(v["run"])),
        "step": lambda v: controller.step(
            as_effects(v["effects"]), [str(n) for n in v.get("off", [])], str(v.get("words", ""))
        ),
        "toggle": lambda v: controller.toggle(str(v["run"]), bool(v["on"])),
        "tick": lambda v: controller.tick(str(v["kind"]), bool(v["on"])),
        "go": lambda v: controller.go(int(v["cursor"])),
        "run": lambda v: controller.run(
            str(v["what"]), [str(kind) for kind in v.get("kinds", [])], bool(v.get("learned", False))
        ),
        "stop": lambda v: controller.stop(),
        "save": lambda v: controller.exports.save(str(v.get("name", ""))),
        "keep": lambda v: controller.exports.keep(str(v["what"]), str(v.get("name", ""))),
        "yaml": lambda v: controller.exports.as_yaml(),
        "describe": lambda v: controller.describe(v),
        "forget": lambda v: controller.forget(str(v["name"])),
        "example": example,
    }
    gets: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "pulse": lambda v: controller.status(),
        "view": lambda v: controller.view(),
        "curves": lambda v: controller.curves(),
        "where": lambda v: controller.where(),
        "screen": lambda v: controller.screen(),
        "form": lambda v: controller.form(),
    }

    async def result(request: Request) -> Response:
        return _file(controller.folder.results, str(request.path_params["name"]))

    async def saved(request: Request) -> Response:
        name = str(request.path_params["name"])
        found = _file(controller.folder.saved, name)
        if isinstance(found, FileResponse) and name.endswith(".yaml"):  # for a copy in another folder
            text = anywhere(controller.folder.saved / name)
            named = {"Content-Disposition": found.headers["content-disposition"]}
            return Response(text, media_type=found.media_type, headers=named)
        return found

    async def report(request: Request) -> Response:
        try:
            html = await run_in_threadpool(controller.exports.report)
        except PliantError as error:
            return PlainTextResponse(f"{error}\n", 422)
        return Response(html, media_type="text/html", headers={"Content-Security-Policy": OF_REPORTS})

    routes = [
        Route("/", _page),
        Route("/static/{name:path}", _static),
        Route("/api/upload", upload, methods=["POST"]),
        *(Route(f"/api/{name}", answer(ask), methods=["POST"]) for name, ask in posts.items()),
        *(Route(f"/api/{name}", answer(ask)) for name, ask in gets.items()),
        Route("/result/{name}", result),
        Route("/saved/{name}", saved),
        Route("/report", report),
    ]
    return Starlette(routes=routes, middleware=[Middleware(Guard, token=token)])


async def _values(request: Request) -> Mapping[str, Any]:
    if request.method == "GET":
        return dict(request.query_params)
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_JSON:
            raise UserError("the request is too large.")
    found = json.loads(body or b"{}")
    if not isinstance(found, dict):
        raise ValueError("an object is expected")
    return found


async def _page(request: Request) -> Response:
    return _shipped("page.html")


async def _static(request: Request) -> Response:
    return _shipped(str(request.path_params["name"]))


def _shipped(name: str) -> Response:
    """Return a file of the page itself, by one of its names."""
    if name not in _SHIPPED + _OF_REPORTS:
        return PlainTextResponse("not here\n", 404)
    folder = resources.files("pliant.report") / "templates" if name in _OF_REPORTS else _STATIC
    content = (folder / name).read_bytes()
    return Response(content, media_type=TYPES[Path(name).suffix])


_STATIC = resources.files("pliant_app") / "static"
# The code that draws in three dimensions, shared with the pages of reports.
_OF_REPORTS = ("parts.js", "scene.js", "moving.css", "vendor/uPlot.js", "vendor/uPlot.css")
_SHIPPED = (
    "page.html",
    "page.css",
    "asking.js",
    "page.js",
    "pictures.js",
    "effects.js",
    "describe.js",
    PAGE,
    "experiment.js",
)


def _file(folder: Path, name: str) -> Response:
    """Return a file of the session, by its bare name."""
    path = folder / name
    if Path(name).name != name or name.startswith(".") or not path.is_file():
        return PlainTextResponse("not here\n", 404)
    if path.suffix == ".html":
        return FileResponse(path, media_type="text/html", headers={"Content-Security-Policy": OF_REPORTS})
    return FileResponse(path, filename=name, media_type="application/octet-stream")


LOOPBACK = "127.0.0.1"
FIRST_PORT, TRIED = 8642, 40
WARMED_BY = "hidden-effect"


def serve(controller: SessionController, port: int, browse: bool, say: Callable[[str], None]) -> None:
    """Serve the session until Ctrl-C.

    Args:
        controller: the session.
        port: on loopback; 0 for the previous port of the session, else the first free one.
        browse: whether to open the page in the browser.
        say: prints a line.

    Raises:
        UserError: the port is taken.
    """
    threading.Thread(target=warm, daemon=True).start()
    token, wanted = controller.folder.address(port)
    bound = _bound(wanted, exact=port != 0)
    with bound:
        here = int(bound.getsockname()[1])
        controller.folder.keep_address(token, here)
        address = f"http://{LOOPBACK}:{here}/?token={token}"
        say(f"page     {address}")
        say(f"session  {controller.folder.path}")
        say("Ctrl-C ends the page; everything is saved, and the same command continues.")
        if browse:
            webbrowser.open(address)
        try:
            serve_until_interrupted(application(controller, token), bound)
        finally:
            controller.runner.stop()
            say("the page has ended; everything is saved.")


def serve_experiment(folder: ExperimentFolder, port: int, browse: bool, say: Callable[[str], None]) -> None:
    """Serve the live page of an experiment until Ctrl-C; arguments as for `serve`."""
    token = secrets.token_urlsafe(24)
    with _bound(port, exact=port != 0) as bound:
        address = f"http://{LOOPBACK}:{int(bound.getsockname()[1])}/?token={token}"
        say(f"page     {address}")
        say("Ctrl-C ends the page; the experiment goes on.")
        if browse:
            webbrowser.open(address)
        serve_until_interrupted(experiment_application(folder, token), bound)


def serve_until_interrupted(app: Starlette, bound: socket.socket) -> None:
    config = uvicorn.Config(
        app,
        log_level="error",
        access_log=False,
        timeout_graceful_shutdown=2,
        server_header=False,
        lifespan="off",
    )
    with suppress(KeyboardInterrupt):  # uvicorn has ended already, and raises it again
        asyncio.run(uvicorn.Server(config).serve(sockets=[bound]))


def warm() -> None:
    """Import and compile what the first study needs, while the user is choosing files."""
    registry = discover()
    usual = [("surrogate", DEFAULT_SURROGATE), ("physics", DEFAULT_PHYSICS)]
    for interface, kind in (*usual, *(("effect", kind) for kind in registry.kinds("effect"))):
        with suppress(PliantError):  # reported when a study needs it
            registry.get(interface, kind).implementation_class()
    import_module("pliant.evidence.comparison")
    with (
        suppress(PliantError, OSError),
        TemporaryDirectory() as text,
    ):  # compiles the functions that follow runs, or loads them
        folder = Path(text)
        study, *data = (folder / name for name in sorted(copy_example(WARMED_BY, folder), reverse=True))
        OpenModel.open(study, [one for one in data if one.suffix == ".csv"], folder / "store").predicted(())


def _bound(port: int, exact: bool) -> socket.socket:
    tried = [port] if exact else [*([port] if port else []), *range(FIRST_PORT, FIRST_PORT + TRIED), 0]
    for one in tried:
        # Named TCP, since asyncio sends small packets at once only on such a socket: else an answer waits 40 ms for the
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
    """Return the folder of a session: that of the option, else one among the report folders of the study's commands.

    If another study of the same file name has that folder, return one of this study's own name.
    """
    if out is not None:
        return out
    usual = Path("runs") / f"{study.stem if study is not None else 'pliant'}-app"
    if study is None or SessionFolder(usual).state().study in ("", str(study.resolve())):
        return usual
    mark = hashlib.sha256(str(study.resolve()).encode()).hexdigest()[:6]
    return usual.with_name(f"{study.stem}-{mark}-app")
