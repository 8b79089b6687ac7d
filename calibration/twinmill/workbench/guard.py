# SPDX-License-Identifier: Apache-2.0
"""Keeps others from the page, its socket and its secret.

Who loaded the page with the token has its cookie, and nobody else the socket. What the browser is
told with each answer keeps the page from frames of others, its address from other servers, and any
script that is not the page's own from running, should a text ever get in as HTML.
"""

import re
import secrets
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SOCKET = "/_nicegui_ws"  # where NiceGUI has it
PAGE = "/"
SCRIPT = re.compile(rb"<script(?=[\s>])")
# NiceGUI compiles its components in the browser (unsafe-eval) and styles elements one by one.
CONTENT = (
    "default-src 'self'; script-src 'self' 'unsafe-eval' 'nonce-{nonce}'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' {sockets}; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
POLICIES = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
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
        self.sockets = f"ws://127.0.0.1:{port} ws://localhost:{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request, as ASGI says."""
        path = scope.get("path", "")
        if scope["type"] == "http":
            send = self._with_policies(send)
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

    def _with_policies(self, send: Send) -> Send:
        """Scripts that stand in a page when it is loaded may run; none that comes later may."""
        nonce = secrets.token_urlsafe(16)
        content = CONTENT.format(nonce=nonce, sockets=self.sockets)
        held: list[Message] = []  # the beginning of a page, until all of it is there
        body = bytearray()

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update({**POLICIES, "Content-Security-Policy": content})
                if headers.get("content-type", "").startswith("text/html"):
                    held.append(message)
                    return
            elif held:
                body.extend(message.get("body", b""))
                if message.get("more_body", False):
                    return
                start = held.pop()
                page = SCRIPT.sub(b'<script nonce="%s"' % nonce.encode(), bytes(body))
                MutableHeaders(scope=start)["content-length"] = str(len(page))
                await send(start)
                message = {**message, "body": page}
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
