# SPDX-License-Identifier: Apache-2.0
"""The page's socket is for who loaded the page with its token, and for no other server's page."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import PlainTextResponse

from twinmill.workbench.guard import SOCKET, Guard

TOKEN, HOST = "secret", "127.0.0.1:8080"
PATH = f"{SOCKET}/socket.io/"


async def served(scope, receive, send):
    """A page that knows the token, and a socket that lets all in."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    else:
        right = scope["path"] != "/" or Request(scope).query_params.get("token") == TOKEN
        await PlainTextResponse("", status_code=200 if right else 403)(scope, receive, send)


def first_answer(kind: str, path: str, query: str = "", **headers: str) -> dict:
    """First message that a client gets (ASGI 3)."""
    told: list[dict] = []

    async def send(message):
        told.append(message)

    async def receive():
        return {"type": f"{kind}.connect"}

    pairs = [(k.encode(), v.encode()) for k, v in {"host": HOST, **headers}.items()]
    scope = {"type": kind, "method": "GET", "path": path, "headers": pairs}
    scope |= {"query_string": query.encode()}
    with ThreadPoolExecutor(1) as own:  # Playwright leaves this thread's loop running
        own.submit(asyncio.run, Guard(served, TOKEN, 8080)(scope, receive, send)).result()
    return told[0]


def is_welcome(**headers: str) -> bool:
    """At the socket; both of its ways say the same."""
    socket = first_answer("websocket", PATH, **headers)["type"] == "websocket.accept"
    polling = first_answer("http", PATH, f"token={TOKEN}", **headers)["status"] == 200
    assert socket == polling
    return socket


def cookie_of(query: str) -> str:
    """That the page gives."""
    headers = Headers(raw=first_answer("http", "/", query)["headers"])
    return headers.get("set-cookie", "").partition(";")[0]


def test_who_has_the_page_has_its_socket():
    assert is_welcome(cookie=cookie_of(f"token={TOKEN}"))
    assert is_welcome(cookie=cookie_of(f"token={TOKEN}"), origin=f"http://{HOST}")


def test_others_have_not():
    assert cookie_of("token=wrong") == cookie_of("") == ""
    assert not is_welcome()
    assert not is_welcome(cookie=cookie_of(f"token={TOKEN}") + "x")
    assert not is_welcome(cookie=f"twinmill_8081={TOKEN}")
    assert not is_welcome(cookie=";;=\x00")


def test_a_page_of_another_server_has_not_though_the_browser_sends_the_cookie():
    for origin in ("http://evil.example", "http://127.0.0.1:1", "null"):
        assert not is_welcome(cookie=cookie_of(f"token={TOKEN}"), origin=origin)
