"""The live page on this computer alone: a token in its address, nothing for another origin or another host's name."""

import asyncio
import json
import secrets
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from hmac import compare_digest
from importlib import import_module
from importlib.resources import files
from typing import Any

from hopopt.errors import MissingExtraError, UsageError
from hopopt.live.processes.worker import Failed
from hopopt.live.session import Session
from hopopt.storage.folder import as_json

HOST = "127.0.0.1"
LARGEST_MESSAGE = 20_000  # bytes of what a page asks
POLICY = "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self' http://localhost:* http://127.0.0.1:*"
FILES = {
    "": ("page.html", "text/html"),
    "page.js": ("page.js", "text/javascript"),
    "page.css": ("page.css", "text/css"),
}


class Server:
    """A page of a session, at ``address`` while it runs.

    make: returns the session, from the function that it tells its state
    port: 0 for any that is free
    Raises MissingExtraError without tornado, UsageError if nothing can listen there.
    """

    def __init__(self, make: Callable[[Callable[[dict[str, Any]], None]], Session], port: int):
        self._web = _tornado("web")
        if not 0 <= port < 65536:
            raise UsageError(f"--port {port}: from 0 to 65535 are allowed")
        try:
            self._socket = socket.create_server((HOST, port))
        except OSError as error:
            raise UsageError(
                f"--port {port}: nothing can listen there ({error.strerror or error}): choose another"
            ) from None
        self._token, self._pages = secrets.token_urlsafe(18), set[Any]()
        self._socket.setblocking(False)
        self._port = self._socket.getsockname()[1]
        self.session = make(self._tell)

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://{HOST}:{self._port}/{self._token}/"

    async def run(self) -> None:
        """Serve until cancelled; Failed if the problem has no hop to begin with, once pages have been told."""
        server = _tornado("httpserver").HTTPServer(self._application(), max_body_size=LARGEST_MESSAGE)
        server.add_socket(self._socket)
        try:
            await self.session.run()
        except Failed as error:
            self.session.fault, self.session.busy = str(error), ""
            self._tell(self.session.state)
            raise
        finally:
            server.stop()
            for page in list(self._pages):
                page.close()

    def allowed(self, token: str, host: str, origin: str | None) -> bool:
        """Whether a request is the page's own: its token, this computer's name, and no other origin."""
        names = {f"{name}:{self._port}" for name in (HOST, "localhost")}
        own = origin is None or origin in {f"http://{name}" for name in names}
        return compare_digest(token.encode(), self._token.encode()) and host in names and own

    def _tell(self, state: Mapping[str, Any]) -> None:
        text = as_json(state)
        for page in list(self._pages):
            with suppress(Exception):  # one that was closed meanwhile
                page.write_message(text)

    def _application(self) -> Any:
        server, web, websocket = self, self._web, _tornado("websocket")

        class Page(web.RequestHandler):
            def get(self, token: str = "", name: str = "") -> None:
                if (
                    not server.allowed(token, self.request.host, self.request.headers.get("Origin"))
                    or name not in FILES
                ):
                    raise web.HTTPError(403)
                file, kind = FILES[name]
                self.set_header("Content-Type", f"{kind}; charset=utf-8")
                self.finish(files("hopopt.live").joinpath(file).read_text(encoding="utf-8"))

            def set_default_headers(self) -> None:
                self.clear_header("Server")
                self.set_header("Content-Security-Policy", POLICY)
                self.set_header("Referrer-Policy", "no-referrer")
                self.set_header("X-Content-Type-Options", "nosniff")
                self.set_header("Cache-Control", "no-store")

            def write_error(self, status_code: int, **more: Any) -> None:
                self.finish(f"{status_code}: open the address that hopopt explore printed, with its token")

        class Live(websocket.WebSocketHandler):
            def prepare(self) -> None:
                token, origin = self.path_kwargs["token"], self.request.headers.get("Origin")
                if origin is None or not server.allowed(token, self.request.host, origin):
                    raise web.HTTPError(403)

            def check_origin(self, origin: str) -> bool:
                return True  # prepare has looked at it

            def open(self, *given: str, **named: str) -> None:
                server._pages.add(self)
                self.write_message(as_json(server.session.state))

            def on_close(self) -> None:
                server._pages.discard(self)

            def on_message(self, message: str | bytes) -> None:
                try:
                    asked(server.session, json.loads(message))
                except UsageError as error:
                    self.write_message(json.dumps({"refused": str(error)}))
                except (ValueError, TypeError, LookupError, AttributeError, OverflowError, RecursionError):
                    self.write_message(json.dumps({"refused": "this is nothing that can be asked"}))

        return web.Application(
            [(r"/(?P<token>[\w-]+)/live", Live), (r"/(?P<token>[\w-]+)/(?P<name>[\w.]*)", Page)],
            websocket_max_message_size=LARGEST_MESSAGE, log_function=lambda handler: None,
            default_handler_class=Page, default_handler_args={},
        )  # fmt: skip


def asked(session: Session, message: Any) -> None:
    """Do what a page asks: one key that says what, with what it needs; UsageError for what a session refuses."""
    ((what, given),) = message.items()
    orders = {
        "pd": session.orders.pd,
        "reached": session.orders.reached,
        "write": session.orders.write,
        "report": session.orders.report,
    }
    if what in orders:
        orders[what]()
    elif what == "set":
        session.set(dict(given))
    elif what == "choose":
        session.choose(str(given["path"]), str(given["name"]))
    elif what == "undo":
        session.undo()
    elif what == "back":
        session.back_to(given)
    elif what == "beside":
        session.show_beside(given)
    elif what == "map":
        session.fill_map([str(entry) for entry in given])
    else:
        raise UsageError(f"nobody knows what {str(what)[:40]} means")


def _tornado(part: str) -> Any:
    try:
        return import_module(f"tornado.{part}")
    except ModuleNotFoundError:
        raise MissingExtraError("tornado", "explore") from None


def run(server: Server, opened: Callable[[str], None]) -> None:
    """Serve until Ctrl-C; ``opened`` is told the address."""

    async def main() -> None:
        opened(server.address)
        await server.run()

    with suppress(KeyboardInterrupt):
        asyncio.run(main())
