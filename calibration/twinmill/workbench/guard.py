# SPDX-License-Identifier: Apache-2.0
"""Keeps others from the page's socket: who loaded the page with the token has its cookie."""

import secrets
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SOCKET = "/_nicegui_ws"  # where NiceGUI has it
PAGE = "/"
REFUSED = "The address lacks the session's token; take the whole address that twinmill printed."


class Guard:
    """Refuses the socket without the cookie, or to pages of other servers.

    Args:
        app: that is guarded; it answers its page with 200 only to who knows the token.
        token: the secret.
        port: of the server: cookies of other ports come along.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self.app, self.token, self.name = app, token, f"twinmill_{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request, as ASGI says."""
        path = scope.get("path", "")
        if scope["type"] == "http" and path == PAGE:
            await self.app(scope, receive, self._with_cookie(send))
        elif scope["type"] != "lifespan" and path.startswith(SOCKET) and not self._knows(scope):
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1008, "reason": REFUSED})
            else:
                await PlainTextResponse(REFUSED, status_code=403)(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    def _with_cookie(self, send: Send) -> Send:
        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] == 200:
                cookie = f"{self.name}={self.token}; Path={PAGE}; HttpOnly; SameSite=Strict"
                MutableHeaders(scope=message).append("Set-Cookie", cookie)
            await send(message)

        return sent

    def _knows(self, scope: Scope) -> bool:
        headers = Headers(scope=scope)
        if headers.get("origin", own := f"http://{headers.get('host')}") != own:
            return False
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        told = cookies[self.name].value if self.name in cookies else ""
        return secrets.compare_digest(told.encode(), self.token.encode())
