# SPDX-License-Identifier: Apache-2.0
"""A page for browsers of this machine: the cameras' pictures with what was found in them."""

import asyncio
import secrets
import socket
import threading
import time
from collections import deque
from collections.abc import AsyncIterator

import cv2
import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, StreamingResponse
from starlette.routing import Mount, Route

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.track.detect import ROBOTS
from twinmill.track.live import FrameDetections

HOST = "127.0.0.1"
WIDEST_PX = 1280
SHOWN_S = 0.1  # between pictures
RECENT_S = 2.0  # for rates, and for robots that are lost
END_S = 1
# Blue, green, red.
FOLLOWED, ROBOT, LOST, FLOOR = (60, 200, 60), (170, 220, 170), (60, 60, 235), (230, 160, 40)
LINE_PX, LETTER = 2, 0.8
FRAME = b"--frame\r\nContent-Type: image/jpeg\r\n\r\n"
HTML = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Twinmill track</title>
<style>
body { background: #fff; color: #222; font: 15px/1.5 sans-serif; margin: 1em; }
img { max-width: 100%; height: auto; display: block; margin-bottom: 0.6em; }
table { border-collapse: collapse; } td, th { padding: 0.1em 0.9em; text-align: right; }
.lost { color: #c22; } .old { opacity: 0.3; }
</style></head><body>
PICTURES
<table><thead><tr><th>robot</th><th>x (m)</th><th>y (m)</th><th>heading (°)</th>
<th>poses a second</th><th>camera</th><th></th></tr></thead><tbody id="robots"></tbody></table>
<p id="said"></p>
<script>
async function look() {
  const said = document.getElementById("said");
  try {
    const now = await (await fetch("state.json")).json();
    document.getElementById("robots").innerHTML = now.robots.map(r =>
      `<tr class="${r.lost ? "lost" : ""}"><td>${r.robot_id}</td><td>${r.x_m.toFixed(3)}</td>` +
      `<td>${r.y_m.toFixed(3)}</td><td>${r.theta_deg.toFixed(1)}</td><td>${r.rate_hz.toFixed(0)}` +
      `</td><td>${r.camera}</td><td>${r.lost ? "lost" : ""}</td></tr>`).join("");
    said.textContent = now.robots.length ? "" : "No robot's tag is seen.";
    document.body.className = "";
  } catch { said.textContent = "The tracker has ended."; document.body.className = "old"; }
}
setInterval(look, 500); look();
</script></body></html>
"""


class Page:
    """Serves until it is closed; what is not looked at is not drawn.

    Attributes:
        url: with a secret, since other users of this machine can reach its port.
    """

    def __init__(self, cameras: int, port: int = 0):
        """Begins to serve.

        Args:
            cameras: how many.
            port: 0 takes any that is free.

        Raises:
            ValueError: the port is taken.
        """
        self._last: dict[int, FrameDetections] = {}
        self._robots: dict[int, FrameDetections] = {}  # the last sight of each
        self._times: dict[tuple[str, int], deque[float]] = {}
        self._lock = threading.Lock()
        self._cameras = cameras
        self._ends = False
        token = secrets.token_urlsafe(12)
        listener = _listener(port)
        self.url = f"http://{HOST}:{listener.getsockname()[1]}/{token}/"
        routes = [
            Route("/", self._page),
            Route("/state.json", self._state),
            Route("/camera/{k:int}", self._pictures),
        ]
        app = Starlette(
            routes=[Mount(f"/{token}", routes=routes)],
            middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])],
        )
        config = uvicorn.Config(
            app, log_level="critical", lifespan="off", timeout_graceful_shutdown=END_S
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [listener]}, daemon=True
        )
        self._thread.start()

    def show(self, sight: FrameDetections) -> None:
        """The newest picture of a camera."""
        now_s = time.monotonic()
        with self._lock:
            self._last[sight.camera] = sight
            self._beat("camera", sight.camera, now_s)
            for robot_id in sight.poses:
                self._robots[robot_id] = sight
                self._beat("robot", robot_id, now_s)

    def close(self) -> None:
        """Ends the server; pages that are open show their last picture."""
        self._ends = True
        self._server.should_exit = True
        self._thread.join(2 * END_S)

    def _beat(self, kind: str, number: int, now_s: float) -> None:
        self._times.setdefault((kind, number), deque(maxlen=200)).append(now_s)

    def _rate_hz(self, kind: str, number: int) -> float:
        now_s = time.monotonic()
        times_s = self._times.get((kind, number), ())
        return sum(now_s - t < RECENT_S for t in times_s) / RECENT_S

    async def _page(self, request: Request) -> HTMLResponse:
        del request
        pictures = "".join(
            f'<img src="camera/{k}" alt="camera {k}">\n' for k in range(self._cameras)
        )
        return HTMLResponse(HTML.replace("PICTURES", pictures))

    async def _state(self, request: Request) -> JSONResponse:
        del request
        with self._lock:
            robots = [
                _told(n, sight, self._rate_hz("robot", n))
                for n, sight in sorted(self._robots.items())
            ]
        return JSONResponse({"robots": robots})

    async def _pictures(self, request: Request) -> StreamingResponse:
        parts = self._parts(request.path_params["k"])
        return StreamingResponse(parts, media_type="multipart/x-mixed-replace; boundary=frame")

    async def _parts(self, k: int) -> AsyncIterator[bytes]:
        shown = None
        while not self._ends:
            with self._lock:
                sight, rate_hz = self._last.get(k), self._rate_hz("camera", k)
            if sight is not None and sight is not shown:
                shown = sight
                yield FRAME + await asyncio.to_thread(drawn, sight, rate_hz) + b"\r\n"
            await asyncio.sleep(SHOWN_S)


def _told(robot_id: int, sight: FrameDetections, rate_hz: float) -> dict:
    x_m, y_m, theta_rad = sight.poses[robot_id].tolist()
    return {
        "robot_id": robot_id,
        "x_m": x_m,
        "y_m": y_m,
        "theta_deg": float(np.degrees(theta_rad)),
        "rate_hz": rate_hz,
        "camera": sight.camera,
        "lost": rate_hz == 0,
    }


def drawn(sight: FrameDetections, rate_hz: float) -> bytes:
    """A JPEG: robots green with an arrow to their front, pale if another camera has them.

    Floor tags are blue.
    """
    scale = min(1.0, WIDEST_PX / sight.picture.shape[1])
    picture = cv2.resize(sight.picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    for number, corners in zip(sight.numbers.tolist(), sight.corners_px, strict=True):
        colour = FOLLOWED if number in sight.poses else ROBOT if number in ROBOTS else FLOOR
        square = np.round(corners * scale).astype(np.int32)
        cv2.polylines(picture, [square], True, colour, LINE_PX, cv2.LINE_AA)
        middle, front = square.mean(axis=0), square[:2].mean(axis=0)
        tip = np.round(middle + 2 * (front - middle)).astype(int)
        if number in sight.poses:
            cv2.arrowedLine(
                picture, middle.astype(int).tolist(), tip.tolist(), colour, LINE_PX, cv2.LINE_AA
            )
        _write(picture, str(number), square.max(axis=0) + 2, colour)
    head = f"camera {sight.camera}  {rate_hz:.0f} Hz  {counted(len(sight.poses), 'robot')}"
    _write(picture, head, (10, 28), FOLLOWED if len(sight.numbers) else LOST)
    if sight.lost:
        _write(picture, f"lost: {', '.join(map(str, sight.lost))}", (10, 58), LOST)
    return cv2.imencode(".jpg", picture)[1].tobytes()


def _write(picture: np.ndarray, text: str, at, colour: tuple[int, int, int]) -> None:
    """With a dark edge, so that it can be read on any floor."""
    place = (int(at[0]), int(at[1]))
    for shade, thick in (((0, 0, 0), 2 * LINE_PX + 2), (colour, LINE_PX)):
        cv2.putText(
            picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, LETTER, shade, thick, cv2.LINE_AA
        )


def _listener(port: int) -> socket.socket:
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()  # who asks before the server runs waits
    except OSError as error:
        listener.close()
        raise ValueError(
            f"{option('port', port)}: cannot be used ({error.strerror}); choose another, or "
            "leave it out."
        ) from error
    return listener
