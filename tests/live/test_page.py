"""The live page answers this computer alone, and only who knows its token."""

import asyncio
import json
import socket
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from hopopt.errors import UsageError
from hopopt.live.server import HOST, Server

httpclient = pytest.importorskip("tornado.httpclient")
websocket = pytest.importorskip("tornado.websocket")


class Fake:
    """A session that solves nothing, and notes what it is asked."""

    def __init__(self, tell: Callable[[dict[str, Any]], None]):
        self.tell, self.asked, self.state, self.orders = tell, list[Any](), {"problem": "fake"}, self

    async def run(self) -> None:
        await asyncio.Event().wait()

    def write(self) -> None: ...

    report = pd = reached = write

    def set(self, values: Any) -> None:
        if "no" in values:
            raise UsageError("no has no slider")
        self.asked.append(values)
        self.tell({**self.state, "values": values})


def served(ask: Callable[[Server], Awaitable[Any]]) -> Any:
    """What ``ask`` returns of a server that runs meanwhile."""

    async def main() -> Any:
        server = Server(Fake, 0)  # type: ignore[arg-type]
        task = asyncio.create_task(server.run())
        await asyncio.sleep(0)
        try:
            return await ask(server)
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    return asyncio.run(main())


def status(server: Server, path: str, **headers: str) -> Awaitable[int]:
    async def got() -> int:
        url = f"http://{HOST}:{server.address.split(':')[2].split('/')[0]}{path}"
        client = httpclient.AsyncHTTPClient(force_instance=True)
        try:
            return (await client.fetch(url, raise_error=False, headers=headers)).code
        finally:
            client.close()

    return got()


def test_the_page_is_there_for_its_token_alone() -> None:
    async def ask(server: Server) -> list[int]:
        token = server.address.split("/")[3]
        port = server.address.split(":")[2].split("/")[0]
        return [
            await status(server, f"/{token}/"),
            await status(server, f"/{token}/page.js"),
            await status(server, "/"),
            await status(server, f"/{token[:-1]}x/"),
            await status(server, f"/{token}/server.py"),
            await status(server, f"/{token}/../server.py"),
            await status(server, f"/{token}/", Host=f"evil.example:{port}"),  # a name that was made to lead here
            await status(server, f"/{token}/", Origin="http://evil.example"),
        ]

    assert served(ask) == [200, 200, *[403] * 6]


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null"])
def test_another_origin_hears_nothing(origin: str | None) -> None:
    async def ask(server: Server) -> int:
        url = server.address.replace("http", "ws") + "live"
        request = httpclient.HTTPRequest(url, headers={"Origin": origin} if origin else {})
        with pytest.raises(httpclient.HTTPClientError) as refused:
            await websocket.websocket_connect(request)
        return refused.value.code

    assert served(ask) == 403


def test_what_a_page_asks_is_done_or_refused_in_a_sentence() -> None:
    async def ask(server: Server) -> list[Any]:
        url = server.address.replace("http", "ws") + "live"
        request = httpclient.HTTPRequest(url, headers={"Origin": server.address.rsplit("/", 2)[0]})
        page = await websocket.websocket_connect(request)
        heard = [json.loads(await page.read_message())]
        strange = (
            "[]", "{", '{"set": 3}', "1e999", "[" * 9000, '{"set": {"deep": ' + "[" * 9000 + "]" * 9000 + "}}",
            '{"back": NaN}', '{"back": ' + "9" * 5000 + "}",
        )  # fmt: skip
        for message in ('{"set": {"a": 1.0}}', '{"set": {"no": 1}}', '{"rm": "/"}', *strange):
            await page.write_message(message)
            heard.append(json.loads(await page.read_message()))
        page.close()
        await asyncio.sleep(0.05)
        return heard

    first, done, no_slider, strange, *rest = served(ask)
    assert first == {"problem": "fake"}
    assert done["values"] == {"a": 1.0}
    assert no_slider == {"refused": "no has no slider"}
    assert "rm" in strange["refused"]
    assert all(list(answer) == ["refused"] for answer in rest)


def test_nothing_listens_outside_this_computer() -> None:
    """Other addresses of this computer, such as 127.0.0.2, are refused too."""

    async def ask(server: Server) -> None:
        port = int(server.address.split(":")[2].split("/")[0])
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), timeout=2)

    served(ask)


def test_a_port_that_is_taken_is_named() -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=f"--port {port}: nothing can listen there"):
            Server(Fake, port)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="from 0 to 65535"):
        Server(Fake, 65536)  # type: ignore[arg-type]
