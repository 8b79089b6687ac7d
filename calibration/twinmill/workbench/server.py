# SPDX-License-Identifier: Apache-2.0
"""Serves the workbench to browsers of this machine alone; its address holds a secret."""

import asyncio
import logging
import os
import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

from fastapi import Request
from nicegui import app, ui
from pydantic import BaseModel, FiniteFloat, PositiveFloat, ValidationError
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect
from starlette.responses import PlainTextResponse, Response

from twinmill.arguments import option
from twinmill.charts.stage import STATIC as CHARTS
from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.model.model_file import ModelError
from twinmill.workbench.address_file import address_file
from twinmill.workbench.bench import Bench
from twinmill.workbench.guard import REFUSED, Guard
from twinmill.workbench.screen import Screen

HOST = "127.0.0.1"
STATIC = Path(__file__).parent / "static"
TICK_S = 0.1
SWITCH_S = 5e-4  # threads hand over so often: pages do not wait for the work of others
LISTEN_S = 0.02  # between looks whether the server listens
TOLD_S = 5.0  # for a page to say why the server ends
SENT_S = 0.5  # for what it says to be on its way
NOTHING_HERE = "There is no page at this address; take the whole address that twinmill printed."


class View(BaseModel):
    """View of the stage on a page: cursor, stretch and horizon in s, rate of play."""

    t: FiniteFloat = 0.0
    span: tuple[FiniteFloat, FiniteFloat] = (0.0, 0.0)
    ahead_s: PositiveFloat = 2.0
    rate: PositiveFloat = 1.0


def serve(bench: Bench, port: int, show: bool, say: Callable[[str], None]) -> None:
    """Serves until Ctrl-C; another secret each time.

    Args:
        bench: what is shown.
        port: 0 takes any that is free.
        show: opens the user's browser.
        say: told the address.

    Raises:
        ValueError: the port is taken, or the logs cannot be judged.
    """
    sys.setswitchinterval(SWITCH_S)
    port, token = _free_port(port), secrets.token_urlsafe(16)
    url = f"http://{HOST}:{port}/?token={token}"
    app.add_middleware(Guard, token=token, port=port)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
    logging.getLogger("uvicorn.error").addFilter(_is_worth_reporting)
    app.add_static_files("/look", STATIC, max_cache_age=0)
    app.add_static_files("/charts", CHARTS, max_cache_age=0)
    _add_data(bench, token)
    _add_page(bench, token)

    async def begin() -> None:
        tasks.append(asyncio.create_task(announced()))
        tasks.append(asyncio.create_task(opened()))

    async def announced() -> None:
        await _listening(port)
        say(url)
        if show:
            webbrowser.open(leading.as_uri())

    async def opened() -> None:
        try:
            await bench.open()
        except (ValueError, OSError) as error:
            failed.append(error)
            bench.failure = plain_line(str(error), MESSAGE_MAX)
            bench.changed("work")
            with suppress(TimeoutError):
                await asyncio.wait_for(bench.told.wait(), TOLD_S)
                await asyncio.sleep(SENT_S)
            app.shutdown()

    def end() -> None:
        bench.close()
        on_end.close()
        if bench.threads and not failed:  # which would be waited for
            sys.stdout.flush()
            os._exit(0)

    on_end = ExitStack()
    if show:
        beside = bench.state.path.with_suffix(".open.html").absolute()
        leading = on_end.enter_context(address_file(beside, url))
    tasks: list[asyncio.Task] = []
    failed: list[Exception] = []
    app.on_startup(begin)
    app.timer(TICK_S, bench.tick)
    app.on_shutdown(end)
    with on_end, suppress(KeyboardInterrupt):  # the way to end it
        ui.run(
            host=HOST,
            port=port,
            title="Twinmill",
            favicon=STATIC / "icon.svg",
            show=False,
            reload=False,
            tailwind=False,
            show_welcome_message=False,
            reconnect_timeout=10,
            gzip_middleware_factory=None,  # to the same machine it only takes time
        )
    if failed:
        raise failed[0]


def _free_port(port: int) -> int:
    """The port, or a free one for 0."""
    with socket.socket() as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind((HOST, port))
        except OSError as error:
            raise ValueError(
                f"{option('port', port)}: cannot be used ({error.strerror}); choose another, or "
                "leave it "
                "out."
            ) from error
        return tried.getsockname()[1]


async def _listening(port: int) -> None:
    """Until the server answers."""
    while True:
        with suppress(OSError):
            _, writer = await asyncio.open_connection(HOST, port)
            writer.close()
            return
        await asyncio.sleep(LISTEN_S)


def _add_page(bench: Bench, secret: str) -> None:
    @ui.page("/")
    async def page(token: str = "") -> Response | None:
        if not _same(token, secret):
            return _refused()
        await Screen(bench, secret).build()
        return None

    @app.exception_handler(404)
    async def elsewhere(request: Request, error: Exception) -> Response:
        return PlainTextResponse(NOTHING_HERE, status_code=404)


def _add_data(bench: Bench, secret: str) -> None:
    """Arrays for the browser, and what it tells of its view."""

    def answer(token: str, make: Callable[..., bytes], *arguments: int) -> Response:
        if not _same(token, secret):
            return _refused()
        try:
            content = make(*arguments)
        except LookupError:
            return PlainTextResponse("There is no such log, robot or swarm.", status_code=404)
        return Response(content, media_type="application/octet-stream")

    @app.get("/data/log")
    def log(log: int, token: str = "") -> Response:
        return answer(token, bench.log_bytes, log)

    @app.get("/data/robot")
    def robot(index: int, token: str = "") -> Response:
        return answer(token, bench.robot_bytes, index)

    @app.get("/data/prediction")
    async def prediction(
        index: int, name: str = "", value: float = 0.0, token: str = ""
    ) -> Response:
        if name and _same(token, secret):
            try:
                bench.drag(name, value)
            except ModelError as error:
                return PlainTextResponse(str(error), status_code=400)
        return await asyncio.to_thread(answer, token, bench.prediction_bytes, index)

    @app.get("/data/swarm")
    def swarm(token: str = "") -> Response:
        return answer(token, bench.swarm_bytes)

    @app.post("/data/view")
    async def view(request: Request, token: str = "") -> Response:
        if not _same(token, secret):
            return _refused()
        try:
            told = View.model_validate_json(await request.body())
        except ValidationError:
            return PlainTextResponse("This is no view of the stage.", status_code=400)
        bench.view.update(told.model_dump(exclude_unset=True))
        return Response(status_code=204)


def _same(token: str, secret: str) -> bool:
    return secrets.compare_digest(token.encode(), secret.encode())


def _refused() -> Response:
    return PlainTextResponse(REFUSED, status_code=403)


def _is_worth_reporting(record: logging.LogRecord) -> bool:
    """False of what Starlette reports when a page is left before it is whole, or told all."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, ClientDisconnect) and str(error) != "No response returned."
